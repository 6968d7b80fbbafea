"""One experiment of a data set as its user sees it: inputs and outputs, read on demand."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Literal, overload

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Attribute, Contents, Variable, read_netcdf
from sysid import IOData

GIVEN = ("sample", "u", "joint_commanded")
"""Variables of a scored record that are given for all samples."""

WINDOW = "window_sample"
"""Along it stands what is given for the initialisation window."""


def public_contents(contents: Contents, part: str, window: int) -> Contents:
    """Cut a record for publication without its truth.

    Seed and provenance go, which would tell how to simulate it again; of a scored record also everything that was
    measured behind the initialisation window. Force, torque and the other joints are measured too: they show how the
    arm moved, better than the commands do.

    Args:
        contents: The complete record.
        part: Part of the data set that it belongs to.
        window: Samples of the initialisation window.
    """
    attributes = {
        key: value for key, value in contents.attributes.items() if key != "seed" and not key.startswith("provenance_")
    }
    if part != "test":
        return Contents(contents.variables, attributes)
    window = min(window, len(contents.variables["u"].values))
    index = {**contents.variables["sample"].attributes, "long_name": "sample number within the initialisation window"}
    variables: dict[str, Variable] = {}
    for name, variable in contents.variables.items():
        if variable.dims[:1] != ("sample",) or name in GIVEN:
            variables[name] = variable
            continue
        cut = np.ascontiguousarray(variable.values[:window])
        variables[name] = Variable((WINDOW, *variable.dims[1:]), cut, variable.attributes)
    variables[WINDOW] = Variable((WINDOW,), np.arange(window, dtype=np.int64), index)
    return Contents(variables, {**attributes, "withheld": f"what was measured from sample {window} on"})


@dataclass(frozen=True)
class Signals:
    """What the file of an experiment says.

    Attributes:
        u: Inputs (N, nu), rad.
        y: Outputs (N, ny), rad; of the window alone where the others are withheld.
        dt: Sampling time, s, as the exact ratio.
        input_names: One per input.
        output_names: One per output.
        input_unit: Of all inputs.
        output_unit: Of all outputs.
        window: Samples at the start in which outputs are given to find an initial state.
        attributes: All of the file.
    """

    u: np.ndarray
    y: np.ndarray
    dt: Fraction
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    input_unit: str
    output_unit: str
    window: int
    attributes: Mapping[str, Attribute]

    @property
    def withheld(self) -> bool:
        """Whether outputs behind the window are kept apart."""
        return len(self.y) < len(self.u)


@dataclass(frozen=True, eq=False, repr=False)
class DataRecord:
    """Inputs and outputs of an experiment, in the shape of the `nonlinear_benchmarks` package: `u, y = record`.

    The file is read at the first look at its numbers, once.

    Attributes:
        name: The experiment.
        part: `train`, `validation` or `test`.
        block: Block of the spec that it belongs to.
        arm: The arm under its conditions.
        twin: Number of the randomised twin; None where there are none.
        joints: Whose commands are the inputs and whose angles the outputs.
        read: Reads the file.
    """

    name: str
    part: str
    block: str
    arm: str
    twin: int | None
    joints: tuple[str, ...]
    read: Callable[[], Signals] = field(repr=False)

    @cached_property
    def signals(self) -> Signals:
        """All that the file says; its arrays are locked.

        Raises:
            ScenarioError: The file is missing, damaged, or of another experiment.
        """
        return self.read()

    @property
    def u(self) -> np.ndarray:
        """Input, rad: (N,) where there is one, else (N, nu)."""
        return _squeezed(self.signals.u)

    @property
    def y(self) -> np.ndarray:
        """Output, rad: (N,) where there is one, else (N, ny); where outputs are withheld, N is that of the window."""
        return _squeezed(self.signals.y)

    @property
    def sampling_time(self) -> float:
        """Sampling time, s; the exact ratio is `signals.dt`."""
        return float(self.signals.dt)

    @property
    def state_initialization_window_length(self) -> int | None:
        """Samples at the start in which the outputs are given, to find an initial state; None for training records."""
        return None if self.part == "train" else self.signals.window

    def iodata(self) -> IOData:
        """The record for the estimators of `sysid`: with names, units, and the window that enters no score.

        Outputs that are withheld are missing there: NaN, as `IOData` has it.
        """
        signals = self.signals
        y = np.full((len(signals.u), signals.y.shape[1]), np.nan)
        y[: len(signals.y)] = signals.y
        return IOData(
            signals.u,
            y,
            float(signals.dt),
            input_names=signals.input_names,
            output_names=signals.output_names,
            input_units=(signals.input_unit,) * signals.u.shape[1],
            output_units=(signals.output_unit,) * signals.y.shape[1],
            intersample=_intersample(signals.attributes, self.name),
            window=self.state_initialization_window_length or 0,
            name=self.name,
            missing=bool(np.isnan(y).any()),
        )

    def __iter__(self) -> Iterator[np.ndarray]:
        yield self.u
        yield self.y

    def __len__(self) -> int:
        return len(self.signals.u)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> "DataRecord": ...
    def __getitem__(self, index: int | slice) -> "np.ndarray | DataRecord":
        """The input (0), the output (1), or consecutive samples; what is left of the window stays one.

        Raises:
            ScenarioError: Another number, a step, or nothing left.
        """
        if not isinstance(index, slice):
            if index not in (0, 1):
                raise ScenarioError(f"{self.name}[{index!r}] given, expected 0 (input), 1 (output) or samples a:b")
            return self.y if index else self.u
        whole = self.signals
        start, stop, step = index.indices(len(whole.u))
        if step != 1 or stop <= start:
            raise ScenarioError(
                f"{self.name}[{index.start}:{index.stop}:{step}] of {len(whole.u)} samples given, expected a:b"
            )
        left = max(min(whole.window, stop) - start, 0)
        part = replace(whole, u=whole.u[start:stop], y=whole.y[start:stop], window=left)
        return replace(self, read=lambda: part)

    def __repr__(self) -> str:
        """What the index says: nothing is read for it."""
        return f"<DataRecord {self.name}: {self.part}, {', '.join(self.joints)}>"


def read_signals(path: Path, experiment: str) -> Signals:
    """Read the file of an experiment.

    Args:
        path: The file.
        experiment: Its name, which the file must bear.

    Raises:
        ScenarioError: The file is missing, damaged, or of another experiment.
    """
    contents = read_netcdf(path)
    try:
        if contents.attributes["experiment"] != experiment:
            raise ScenarioError(
                f"{path} is of experiment {contents.attributes['experiment']!r}, expected {experiment!r}"
            )
        u, y = contents.variables["u"], contents.variables["y"]
        window = _whole(contents.attributes["initialisation_window"])
        given = len(u.values) if y.dims[0] == "sample" else min(window, len(u.values))
        if len(y.values) != given:
            raise ScenarioError(f"{path}: {len(y.values)} samples of y found, expected {given}")
        return Signals(
            u=_locked(u.values, path, "u"),
            y=_locked(y.values, path, "y"),
            dt=sampling_time(contents),
            input_names=_names(contents.variables["input"]),
            output_names=_names(contents.variables["output"]),
            input_unit=str(u.attributes["units"]),
            output_unit=str(y.attributes["units"]),
            window=window,
            attributes=contents.attributes,
        )
    except KeyError as error:
        raise ScenarioError(
            f"{path} has no {error.args[0]!r}: no record of a data set, or of another version"
        ) from error


def sampling_time(contents: Contents) -> Fraction:
    """Sampling time of a record, s, exactly."""
    return Fraction(*(_whole(contents.attributes[f"sampling_time_{word}"]) for word in ("numerator", "denominator")))


def _intersample(attributes: Mapping[str, Attribute], name: str) -> Literal["zoh", "foh", "bl"]:
    match attributes.get("intersample"):
        case "zoh":
            return "zoh"
        case "foh":
            return "foh"
        case "bl":
            return "bl"
        case other:
            raise ScenarioError(f"{name}: intersample = {other!r} given, expected zoh, foh or bl")


def _whole(value: Attribute) -> int:
    return int(value)


def _names(variable: Variable) -> tuple[str, ...]:
    return tuple(map(str, variable.values))


def _locked(values: np.ndarray, path: Path, name: str) -> np.ndarray:
    if values.ndim != 2 or values.dtype != np.float64:
        raise ScenarioError(f"{path}: {name} of shape {values.shape}, {values.dtype} found, expected (N, n) of float64")
    values.setflags(write=False)
    return values


def _squeezed(values: np.ndarray) -> np.ndarray:
    return values[:, 0] if values.shape[1] == 1 else values
