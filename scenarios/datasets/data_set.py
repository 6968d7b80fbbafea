"""A built data set on disk: its index, its parts, and its records as inputs and outputs, read on demand."""

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, overload

import numpy as np

from hmtb_twin.files.netcdf import Contents, read_netcdf
from scenarios.datasets.index import hash_of_records, read_index
from scenarios.datasets.plan import INDEX, SPEC, TRUTH, UNFINISHED, ListedExperiment
from scenarios.datasets.spec import DataSetSpec, load_spec
from scenarios.datasets.spec_tables import PARTS
from scenarios.experiments.scenario import NAME
from scenarios.files.errors import DAMAGE, ScenarioError, unknown
from sysid import IOData

Joints = str | Sequence[str]
"""One joint, or the joints of a record with several inputs."""


class Signals(NamedTuple):
    """Contents of the file of an experiment.

    Attributes:
        u: Inputs (N, nu), rad.
        y: Outputs (N, ny), rad; of the window alone where the others are withheld.
        dt: Sampling time, s, as the exact ratio.
        window: Samples at the start whose outputs are given to find an initial state.
    """

    u: np.ndarray
    y: np.ndarray
    dt: Fraction
    window: int

    @property
    def withheld(self) -> bool:
        """Whether outputs behind the window are withheld."""
        return len(self.y) < len(self.u)


@dataclass(frozen=True, eq=False, repr=False)
class DataRecord(ListedExperiment):
    """Inputs and outputs of an experiment, in the shape of the `nonlinear_benchmarks` package: `u, y = record`.

    The file is read once, when its numbers are first used.

    Attributes:
        file: Its file, relative to the folder of the data set.
        failed: Why there is no record; None where there is one.
        arrays: Hash of each array of its file, as the index says.
        read: Reads the file.
    """

    file: str
    failed: str | None
    arrays: Mapping[str, str]
    read: Callable[[], Signals]

    @cached_property
    def signals(self) -> Signals:
        """Contents of the file; the arrays are locked. A missing or damaged file raises `ScenarioError`."""
        return self.read()

    @property
    def u(self) -> np.ndarray:
        """Input, rad: (N,) where there is one, else (N, nu)."""
        return self.signals.u[:, 0] if self.signals.u.shape[1] == 1 else self.signals.u

    @property
    def y(self) -> np.ndarray:
        """Output, rad: (N,) where there is one, else (N, ny); where outputs are withheld, N is that of the window."""
        return self.signals.y[:, 0] if self.signals.y.shape[1] == 1 else self.signals.y

    @property
    def sampling_time(self) -> float:
        """Sampling time, s; the exact ratio is `signals.dt`."""
        return float(self.signals.dt)

    @property
    def state_initialization_window_length(self) -> int | None:
        """Samples at the start whose outputs are given to find an initial state; None for training records."""
        return None if self.part == "train" else self.signals.window

    def iodata(self) -> IOData:
        """Return the record for the estimators of `sysid`, with names, units and window; withheld outputs are NaN."""
        signals = self.signals
        y = np.full((len(signals.u), signals.y.shape[1]), np.nan)
        y[: len(signals.y)] = signals.y
        return IOData(
            signals.u,
            y,
            float(signals.dt),
            input_names=tuple(f"{joint} commanded" for joint in self.joints),
            output_names=tuple(f"{joint} measured" for joint in self.joints),
            input_units=("rad",) * len(self.joints),
            output_units=("rad",) * len(self.joints),
            intersample="zoh",
            window=self.state_initialization_window_length or 0,
            name=self.name,
            missing=signals.withheld or bool(np.isnan(y).any()),
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
        """Return the input (0), the output (1), or consecutive samples with what remains of the window.

        Raises:
            ScenarioError: Another number, a step, or nothing left.
        """
        if not isinstance(index, slice):
            if index not in (0, 1):
                raise ScenarioError(f"{self.name}[{index!r}] given, expected 0 (input), 1 (output) or samples a:b")
            return self.y if index else self.u
        signals = self.signals
        start, stop, step = index.indices(len(signals.u))
        if step != 1 or stop <= start:
            raise ScenarioError(
                f"{self.name}[{index.start}:{index.stop}:{step}] of {len(signals.u)} samples given, expected a:b"
            )
        window = max(min(signals.window, stop) - start, 0)
        part = Signals(signals.u[start:stop], signals.y[start:stop], signals.dt, window)
        return replace(self, read=lambda: part)

    def __repr__(self) -> str:
        return f"<DataRecord {self.name}: {self.part}, {', '.join(self.joints)}>"


@dataclass(frozen=True)
class DataSet:
    """A data set on disk, of which only the index has been read.

    Attributes:
        folder: Its folder.
        label: Name with version.
        hash: Hash of all its arrays, as its index says.
        index: Its experiments in order, failed ones too.
        incomplete: Why experiments have no record, and what else could not be made, by name, in the order of the index.
    """

    folder: Path
    label: str
    hash: str
    index: tuple[DataRecord, ...] = field(repr=False)
    incomplete: Mapping[str, str] = field(repr=False)

    @property
    def records_hash(self) -> str:
        """Hash of the arrays of all records, as papers cite it; see `hash_of_records`."""
        return hash_of_records({"file": one.file, "arrays": {one.file: one.arrays}} for one in self.index)

    @property
    def train(self) -> tuple[DataRecord, ...]:
        """Records to identify from."""
        return self.records("train")

    @property
    def validation(self) -> tuple[DataRecord, ...]:
        """Records to choose a model by; none in some data sets."""
        return self.records("validation")

    @property
    def test(self) -> tuple[DataRecord, ...]:
        """Records to score a model on."""
        return self.records("test")

    def records(self, part: str | None = None) -> tuple[DataRecord, ...]:
        """Return the records of a part, or all, in order; none is read yet.

        Args:
            part: `train`, `validation` or `test`.

        Raises:
            ScenarioError: No such part.
        """
        if part is not None and part not in PARTS:
            raise ScenarioError(unknown("part", part, PARTS))
        # Copies, so that numbers which have been read go with the records, and do not stay with the data set.
        return tuple(replace(one) for one in self.index if one.failed is None and part in (None, one.part))

    def record(self, name: str) -> DataRecord:
        """Return the record of an experiment.

        Raises:
            ScenarioError: There is no such experiment, or it failed.
        """
        known = {one.name: one for one in self.index}
        if name not in known:
            raise ScenarioError(f"{self.label}: {unknown('experiment', name, known)}")
        if known[name].failed is not None:
            raise ScenarioError(f"{self.label}: {name} has no record: {known[name].failed}")
        return replace(known[name])

    def select(
        self, *, joint: Joints | None = None, block: str | None = None, arm: str | None = None, twin: int | None = None
    ) -> "DataSet":
        """Return the data set with some of its experiments.

        Args:
            joint: The joint of records with one input and output; several names: of records with exactly these.
            block: Block of the spec.
            arm: The arm under its conditions.
            twin: Number of the randomised twin.

        Raises:
            ScenarioError: No experiment is left; the text lists the choices.
        """
        joints = None if joint is None else (joint,) if isinstance(joint, str) else tuple(joint)
        left = self.index
        for key, value in {"joints": joints, "block": block, "arm": arm, "twin": twin}.items():
            if value is None:
                continue
            selected = tuple(one for one in left if getattr(one, key) == value)
            if not selected:
                known = [_shown(one) for one in dict.fromkeys(getattr(one, key) for one in left)]
                choices = "; ".join(known[:12]) + (f"; and {len(known) - 12} more" if len(known) > 12 else "")
                raise ScenarioError(f"{self.label}: no experiment with {key} = {_shown(value)}; there are: {choices}")
            left = selected
        return replace(self, index=left)

    @property
    def failed(self) -> Mapping[str, str]:
        """Why experiments have no record, by name."""
        return {one.name: one.failed for one in self.index if one.failed is not None}

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms under their conditions, in order."""
        return tuple(dict.fromkeys(one.arm for one in self.index))

    @cached_property
    def spec(self) -> DataSetSpec:
        """The spec that it was built from; `ScenarioError` where it is not in the folder."""
        return load_spec(self.folder / SPEC)

    @property
    def truth(self) -> Path | None:
        """Folder of what only the simulation knows; None where it is not in this copy."""
        return self.folder / TRUTH if (self.folder / TRUTH).is_dir() else None


def open_data_set(folder: str | Path) -> DataSet:
    """Open a data set; only its index is read, however many records there are.

    Args:
        folder: Its folder, or the name of one in the cache; see `scenarios.load_dataset`.

    Raises:
        ScenarioError: There is none, it is not finished, or its index is damaged.
    """
    folder = Path(folder)
    if not os.path.lexists(folder) and len(folder.parts) == 1 and (cache_folder() / folder / INDEX).is_file():
        folder = cache_folder() / folder
    if not (folder / INDEX).is_file():
        unfinished = folder.parent / f"{folder.name}{UNFINISHED}"
        if folder.name.endswith(UNFINISHED) or unfinished.is_dir():
            raise ScenarioError(f"{folder} is not built to its end; to resume: hmtb dataset build")
        what = f"no {INDEX} in it" if folder.is_dir() else "no such folder"
        raise ScenarioError(
            f"{str(folder)!r} is no data set: {what}; expected a folder that hmtb dataset build made, or the name of "
            f"one that hmtb dataset get has put into {cache_folder()}"
        )
    try:
        index = read_index(folder)
        entries = tuple(_data_record(folder, entry) for entry in index["experiments"])
        if not NAME.fullmatch(index["data_set"]):
            raise ValueError(f"data set {index['data_set']!r} names no folder")
        incomplete: dict[str, str] = {}
        for entry in index["experiments"]:
            incomplete |= {entry["name"]: entry["failed"]} if entry["failed"] else {}
            incomplete |= entry.get("missing", {})
        incomplete |= {
            f"{one['stage']}: {one['piece']}": one["failed"] for one in index.get("stages", ()) if one["failed"]
        }
        return DataSet(folder, str(index["data_set"]), str(index["hash"]), entries, incomplete)
    except DAMAGE as error:
        raise ScenarioError(f"{folder / INDEX} is damaged, or of another version: {error}") from error


def cache_folder() -> Path:
    """Return the folder of the copies: HMTB_CACHE, else hmtb-twin in XDG_CACHE_HOME or ~/.cache."""
    if own := os.environ.get("HMTB_CACHE"):
        return Path(own).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "hmtb-twin"


def load(
    folder: str | Path,
    *,
    joint: Joints | None = None,
    block: str | None = None,
    arm: str | None = None,
    twin: int | None = None,
) -> tuple[DataRecord | tuple[DataRecord, ...], DataRecord | tuple[DataRecord, ...]]:
    """Read the training and the test records of a data set.

    As in the `nonlinear_benchmarks` package a part with one record is that record, a part with several a tuple of them.
    The parts of `open_data_set` are always tuples.

    Args:
        folder: Folder of the data set.
        joint: The joint of records with one input and output; several names: of records with exactly these.
        block: Block of the spec.
        arm: The arm under its conditions.
        twin: Number of the randomised twin.

    Raises:
        ScenarioError: No data set there, or no such records in it.
    """
    selected = open_data_set(folder).select(joint=joint, block=block, arm=arm, twin=twin)
    for part, records in (("train", selected.train), ("test", selected.test)):
        if not records:
            counts = Counter(one.part for one in selected.index if one.failed is None)
            present = ", ".join(f"{count} for {name}" for name, count in counts.items()) or "none at all"
            raise ScenarioError(f"{selected.label}: no {part} records selected, but {present}; see open_data_set")
    train, test = selected.train, selected.test
    return train[0] if len(train) == 1 else train, test[0] if len(test) == 1 else test


def _data_record(folder: Path, entry: Mapping[str, Any]) -> DataRecord:
    path = PurePosixPath(entry["file"])
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"file {entry['file']!r} is outside the folder")
    for key in ("name", "part", "block", "arm"):
        if not isinstance(entry[key], str):
            raise TypeError(f"{key} {entry[key]!r} is no text")
    if not NAME.fullmatch(entry["name"]) or entry["part"] not in PARTS:
        raise ValueError(f"name {entry['name']!r} or part {entry['part']!r} names no file")
    arrays = dict(entry.get("arrays", {}).get(entry["file"], {}))
    return DataRecord(
        **{key: entry[key] for key in ("name", "part", "block", "arm", "twin", "file", "failed")},
        joints=tuple(entry["joints"]),
        arrays=arrays,
        read=partial(_read_signals, folder / path, entry["name"], arrays),
    )


def _shown(value: object) -> str:
    return ", ".join(value) if isinstance(value, tuple) else repr(value)


def _read_signals(path: Path, experiment: str, hashes: Mapping[str, str]) -> Signals:
    contents = read_netcdf(path, only=("u", "y"))
    try:
        if contents.attributes["experiment"] != experiment:
            raise ScenarioError(
                f"{path} is of experiment {contents.attributes['experiment']!r}, expected {experiment!r}"
            )
        u, y = contents.variables["u"].values, contents.variables["y"].values
        window = int(contents.attributes["initialisation_window"])
        expected = len(u) if contents.variables["y"].dims[0] == "sample" else min(window, len(u))
        if len(y) != expected:
            raise ScenarioError(f"{path}: {len(y)} samples of y given, expected {expected}")
        for name in contents.differing({name: hashes.get(name) for name in ("u", "y")}):
            raise ScenarioError(f"{path}: {name} differs from what the index says; see hmtb dataset check")
        for values in (u, y):
            if values.ndim != 2 or values.dtype != np.float64:
                raise ScenarioError(f"{path}: {values.shape}, {values.dtype} given as u or y, expected (N, n), float64")
            values.setflags(write=False)
        return Signals(u, y, sampling_time(contents), window)
    except KeyError as error:
        raise ScenarioError(f"{path} has no {error.args[0]!r}: expected a record of this version") from error
    except (TypeError, ArithmeticError) as error:
        raise ScenarioError(f"{path} is damaged: {error}") from error


def sampling_time(contents: Contents) -> Fraction:
    """Return the exact sampling time of a record, s."""
    return Fraction(*(int(contents.attributes[f"sampling_time_{word}"]) for word in ("numerator", "denominator")))
