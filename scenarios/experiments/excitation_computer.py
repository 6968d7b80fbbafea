"""The excitation computer: plays 100-point files, or records, periodically through the converters of its board."""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.excitation import KINDS
from scenarios.experiments.waveform import LONGEST, Parameter, Waveform, read_points, read_signals
from scenarios.files import codec
from scenarios.files.errors import ScenarioError, unknown

FILE = "file"
"""Kind of an excitation whose points lie in a file of their own; reading it makes the kind `points`."""

FASTEST = 1000.0
"""Most repetitions of a file per second, Hz: the board converts a hundred thousand points per second."""

MISSES_POINTS = (
    f"a file is played faster than {SAMPLE_RATE:g} points per second: the position loop misses points, and tones alias"
)
"""Warning about an excitation that `Excitation.misses_points`."""


@dataclass(frozen=True)
class Excitation:
    """An excitation of one axis: a waveform, and how the excitation computer plays it.

    Attributes:
        kind: Name of the excitation, one of `KINDS`.
        parameters: Its arguments by name; those left out keep their defaults.
        repeat_frequency: How often the file repeats per second, Hz; by default as the excitation was meant: 0.5 Hz, or
            0.25 Hz for `two_sines` whose lower tone needs 4 s, a record at its own rate. It scales every frequency of
            the file.
        iterations: How often the file is played, then 0 V; until the end by default.
    """

    kind: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    repeat_frequency: float | None = None
    iterations: int | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ScenarioError(unknown("excitation", self.kind, KINDS))
        object.__setattr__(self, "parameters", MappingProxyType(_checked(self.kind, self.parameters)))
        if self.repeat_frequency is not None and not 1.0 / LONGEST <= self.repeat_frequency <= FASTEST:
            raise ScenarioError(
                f"excitation {self.kind!r}: repeat_frequency must be {1.0 / LONGEST:.3g} Hz, once in the longest "
                f"experiment, to {FASTEST:g} Hz, given {self.repeat_frequency}"
            )
        if self.iterations is not None and not 1 <= self.iterations < 2**31:
            raise ScenarioError(f"excitation {self.kind!r}: iterations must be 1 or more, given {self.iterations}")
        self.waveform()  # raises here, not in the middle of a campaign, where a value is bad

    # The hash of a dataclass fails on the mapping of the parameters, and so does pickle.
    def __hash__(self) -> int:
        return hash((self.kind, tuple(sorted(self.parameters.items())), self.repeat_frequency, self.iterations))

    def __reduce__(self) -> tuple[type["Excitation"], tuple[object, ...]]:
        return (Excitation, (self.kind, dict(self.parameters), self.repeat_frequency, self.iterations))

    def waveform(self) -> Waveform:
        """One period, a file's 100 points or a record, with the update rate at which it is played."""
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as no finite number
            waveform = KINDS[self.kind](**self.parameters)
        rate = self.repeat_frequency
        return waveform if rate is None else replace(waveform, update_rate=len(waveform.points) * rate)

    def __repr__(self) -> str:
        # A record may have a million samples.
        parts = [repr(self.kind)]
        for name, value in (*self.parameters.items(), *((name, getattr(self, name)) for name in SETTINGS)):
            if value is not None:
                parts.append(f"{name}=<{len(value)} numbers>" if isinstance(value, tuple) else f"{name}={value!r}")
        return f"Excitation({', '.join(parts)})"

    @classmethod
    def from_signal(
        cls, signal: ArrayLike, sample_rate: float = float(SAMPLE_RATE), *, iterations: int | None = None
    ) -> "Excitation":
        """Play a signal of one's own, of any length, e.g. the input that `sysid.design_input` returns.

        Args:
            signal: Voltages (n,) or (n, 1), V.
            sample_rate: Samples per second of the signal, Hz.
            iterations: How often it is played, then 0 V; until the end of the experiment by default.

        Raises:
            ScenarioError: No signal of one channel, or a sample that is not finite or too large.
        """
        try:
            samples = np.asarray(signal)
        except ValueError as error:
            raise ScenarioError("signal: expected real numbers in V (n,), given rows of several lengths") from error
        # Text, complex numbers and truth values would be converted without a word.
        if samples.dtype.kind not in "iuf":
            raise ScenarioError(f"signal: expected real numbers in V (n,), given {samples.dtype} numbers or objects")
        samples = samples.astype(float)
        if samples.ndim == 2 and samples.shape[1] == 1:
            samples = samples[:, 0]
        if samples.ndim != 1:
            raise ScenarioError(
                f"signal: expected one channel (n,) or (n, 1) in V, given an array {samples.shape}; "
                "for several axes give one excitation each"
            )
        parameters: dict[str, Parameter] = {"samples": tuple(samples.tolist()), "sample_rate": float(sample_rate)}
        return cls("record", parameters, iterations=iterations)

    def requested_volts(self, duration: float, *, rate: int = SAMPLE_RATE) -> np.ndarray:
        """Voltage that the file requests of the converter `(N, 1)`, V, at the rate of the position loop in Hz."""
        return self.waveform().play(duration, iterations=self.iterations, rate=rate)

    @property
    def misses_points(self) -> bool:
        """Whether the file is played faster than the position loop reads: it then misses points, and tones alias."""
        # A rate of 50 Hz that was computed may be off by its last digit.
        return self.waveform().update_rate > SAMPLE_RATE * (1.0 + 1e-9)

    def to_table(self) -> dict[str, Any]:
        """Write the excitation as plain values of a TOML table."""
        settings = {name: getattr(self, name) for name in SETTINGS if getattr(self, name) is not None}
        return {"kind": self.kind, **settings, **self.parameters}

    @classmethod
    def from_table(cls, table: object, folder: Path = Path()) -> "Excitation":
        """Build an excitation from parsed TOML, reading the waveform file that it may name.

        Args:
            table: The parsed table.
            folder: Folder that relative paths of waveform files start from.

        Raises:
            ScenarioError: No table, no kind, or anything wrong in it.
        """
        if not isinstance(table, Mapping) or not isinstance(table.get("kind"), str):
            kinds = ", ".join((*KINDS, FILE))
            raise ScenarioError(f"excitation must be a table with a kind, given {table!r}; kinds: {kinds}")
        settings: dict[str, Any] = {}
        for name, setting_type in SETTINGS.items():
            if name in table:
                settings[name] = codec.structure(setting_type, table[name], name)
        parameters = {key: value for key, value in table.items() if key != "kind" and key not in SETTINGS}
        if table["kind"] == FILE:
            if set(parameters) != {"path"} or not isinstance(parameters["path"], str):
                keys = ", ".join(parameters) or "none of them"
                raise ScenarioError(f"excitation {FILE!r} takes a path and {', '.join(SETTINGS)}; given {keys}")
            return cls("points", {"points": read_points(folder / parameters["path"])}, **settings)
        if table["kind"] == "record" and "path" in parameters:
            if "samples" in parameters or not isinstance(parameters["path"], str):
                raise ScenarioError("excitation 'record' takes samples, or the path of a file with them; expected one")
            column, rate = parameters.pop("column", None), parameters.get("sample_rate")
            columns = () if column is None else (codec.structure(str, column, "column"),)
            rate = None if rate is None else codec.structure(float, rate, "sample_rate")
            (signal,) = read_signals(folder / parameters.pop("path"), columns, rate)
            parameters |= {"samples": signal.samples, "sample_rate": signal.sample_rate}
        return cls(table["kind"], parameters, **settings)


SETTINGS: Mapping[str, Any] = {"repeat_frequency": float, "iterations": int}
"""Settings of the excitation computer; all other keys are parameters of the waveform."""

codec.register(Excitation, Excitation.from_table, Excitation.to_table)


def check_outputs(excitations: Sequence[Excitation], axes: Sequence[str], independent_channels: bool) -> None:
    """Raise `ScenarioError` unless there is one excitation for all axes or one per axis, and outputs enough."""
    if len(excitations) not in (1, len(axes)):
        raise ScenarioError(
            f"{len(excitations)} excitations for {len(axes)} axes; expected one for all, or one per axis"
        )
    different = len(set(excitations))
    if different > BOARD.outputs and not independent_channels:
        raise ScenarioError(
            f"{different} different excitations for the axes {', '.join(axes)}; the excitation computer has "
            f"{BOARD.outputs} analogue outputs: expected at most so many different ones, or independent_channels = true"
        )


def _checked(kind: str, parameters: Mapping[str, object]) -> dict[str, Parameter]:
    """Return all parameters of an excitation, defaults filled in, of the right types."""
    # The signature of the function is the list of what an excitation takes.
    defaults = {key: argument.default for key, argument in inspect.signature(KINDS[kind]).parameters.items()}
    for key in parameters:
        if key not in defaults:
            raise ScenarioError(f"excitation {kind!r}: {unknown('parameter', key, defaults)}")
    for key, default in defaults.items():
        if key not in parameters and default is inspect.Parameter.empty:
            raise ScenarioError(f"excitation {kind!r} needs {key}; it takes {', '.join(defaults)}")
    hints = get_type_hints(KINDS[kind])
    complete = dict(defaults)
    for key, value in parameters.items():
        complete[key] = codec.structure(hints[key], value, f"{kind}.{key}")
    return complete
