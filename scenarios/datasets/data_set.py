"""A built data set on disk: its index, its parts, and its records as inputs and outputs, read on demand."""

import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple, overload

import numpy as np

from hmtb_twin.files.netcdf import Contents, read_netcdf
from scenarios.datasets.index import hash_of_records, read_index
from scenarios.datasets.plan import INDEX, SPEC, TRUTH, UNFINISHED, ListedExperiment
from scenarios.datasets.record_block import PARTS
from scenarios.datasets.spec import DataSetSpec, load_spec
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
        units = ("rad",) * len(self.joints)
        return IOData(
            signals.u,
            y,
            float(signals.dt),
            input_names=tuple(f"{joint} commanded" for joint in self.joints),
            output_names=tuple(f"{joint} measured" for joint in self.joints),
            input_units=units,
            output_units=units,
            intersample="zoh",  # the control computer holds a command until its next tick
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
        section = Signals(signals.u[start:stop], signals.y[start:stop], signals.dt, window)
        return replace(self, read=lambda: section)

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
        return hash_of_records({"file": record.file, "arrays": {record.file: record.arrays}} for record in self.index)

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
        recorded = [record for record in self.index if record.failed is None]
        # Copies, so that numbers which have been read go with the records, and do not stay with the data set.
        return tuple(replace(record) for record in recorded if part in (None, record.part))

    def record(self, name: str) -> DataRecord:
        """Return the record of an experiment.

        Raises:
            ScenarioError: There is no such experiment, or it failed.
        """
        records = {record.name: record for record in self.index}
        if name not in records:
            raise ScenarioError(f"{self.label}: {unknown('experiment', name, records)}")
        if records[name].failed is not None:
            raise ScenarioError(f"{self.label}: {name} has no record: {records[name].failed}")
        return replace(records[name])

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
        joints: tuple[str, ...] | None = None
        if joint is not None:
            joints = (joint,) if isinstance(joint, str) else tuple(joint)
        remaining = self.index
        for key, value in {"joints": joints, "block": block, "arm": arm, "twin": twin}.items():
            if value is None:
                continue
            selected = tuple(record for record in remaining if getattr(record, key) == value)
            if not selected:
                values = dict.fromkeys(getattr(record, key) for record in remaining)
                raise ScenarioError(
                    f"{self.label}: no experiment with {key} = {_shown(value)}; there are: {_choices_in_words(values)}"
                )
            remaining = selected
        return replace(self, index=remaining)

    @property
    def failed(self) -> Mapping[str, str]:
        """Why experiments have no record, by name."""
        return {record.name: record.failed for record in self.index if record.failed is not None}

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms under their conditions, in order."""
        return tuple(dict.fromkeys(record.arm for record in self.index))

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
    # What lies in the working folder goes before the cache, even a broken link.
    if not os.path.lexists(folder) and len(folder.parts) == 1 and (cache_folder() / folder / INDEX).is_file():
        folder = cache_folder() / folder
    if not (folder / INDEX).is_file():
        raise ScenarioError(_why_no_data_set(folder))
    try:
        index = read_index(folder)
        records = tuple(_data_record(folder, listed) for listed in index["experiments"])
        if not NAME.fullmatch(index["data_set"]):
            raise ValueError(f"data set {index['data_set']!r} names no folder")
        return DataSet(folder, str(index["data_set"]), str(index["hash"]), records, _reasons_of_failures(index))
    except DAMAGE as error:
        raise ScenarioError(f"{folder / INDEX} is damaged, or of another version: {error}") from error


def _why_no_data_set(folder: Path) -> str:
    """Message about a folder without an index: unfinished, without data, or not there."""
    unfinished = folder.parent / f"{folder.name}{UNFINISHED}"
    if folder.name.endswith(UNFINISHED) or unfinished.is_dir():
        return f"{folder} is not built to its end; to resume: hmtb dataset build"
    reason = f"no {INDEX} in it" if folder.is_dir() else "no such folder"
    return (
        f"{str(folder)!r} is no data set: {reason}; expected a folder that hmtb dataset build made, or the name of "
        f"one that hmtb dataset get has put into {cache_folder()}"
    )


def _reasons_of_failures(index: Mapping[str, Any]) -> dict[str, str]:
    """Why experiments have no record, files of their truth are missing, and pieces of stages failed, by name."""
    reasons: dict[str, str] = {}
    for experiment in index["experiments"]:
        if experiment["failed"]:
            reasons[experiment["name"]] = experiment["failed"]
        reasons |= experiment.get("missing", {})
    for piece in index.get("stages", ()):
        if piece["failed"]:
            reasons[f"{piece['stage']}: {piece['piece']}"] = piece["failed"]
    return reasons


def cache_folder() -> Path:
    """Return the folder of the copies: HMTB_CACHE, else hmtb-twin in XDG_CACHE_HOME or ~/.cache."""
    if hmtb_cache := os.environ.get("HMTB_CACHE"):
        return Path(hmtb_cache).expanduser()
    # An empty XDG_CACHE_HOME counts as none, as the XDG base directory specification has it.
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
            counts = Counter(record.part for record in selected.index if record.failed is None)
            present = ", ".join(f"{count} for {name}" for name, count in counts.items()) or "none at all"
            raise ScenarioError(f"{selected.label}: no {part} records selected, but {present}; see open_data_set")
    return _single_or_all(selected.train), _single_or_all(selected.test)


def _single_or_all(records: tuple[DataRecord, ...]) -> DataRecord | tuple[DataRecord, ...]:
    return records[0] if len(records) == 1 else records


def _data_record(folder: Path, listed: Mapping[str, Any]) -> DataRecord:
    """The record of an experiment as the index lists it; no path of a downloaded index leads out of the folder."""
    path = PurePosixPath(listed["file"])
    if path.is_absolute() or ".." in path.parts:
        raise ValueError(f"file {listed['file']!r} is outside the folder")
    for key in ("name", "part", "block", "arm"):
        if not isinstance(listed[key], str):
            raise TypeError(f"{key} {listed[key]!r} is no text")
    if not NAME.fullmatch(listed["name"]) or listed["part"] not in PARTS:
        raise ValueError(f"name {listed['name']!r} or part {listed['part']!r} names no file")
    arrays = dict(listed.get("arrays", {}).get(listed["file"], {}))
    return DataRecord(
        **{key: listed[key] for key in ("name", "part", "block", "arm", "twin", "file", "failed")},
        joints=tuple(listed["joints"]),
        arrays=arrays,
        read=partial(_read_signals, folder / path, listed["name"], arrays),
    )


MOST_CHOICES = 12
"""Choices that an error lists."""


def _choices_in_words(values: Iterable[object]) -> str:
    """The first choices, and how many others there are."""
    choices = [_shown(value) for value in values]
    if len(choices) > MOST_CHOICES:
        choices[MOST_CHOICES:] = [f"and {len(choices) - MOST_CHOICES} more"]
    return "; ".join(choices)


def _shown(value: object) -> str:
    return ", ".join(value) if isinstance(value, tuple) else repr(value)


def _read_signals(path: Path, experiment: str, hashes: Mapping[str, str]) -> Signals:
    """Read inputs and outputs of a record, and compare their hashes with those of the index."""
    contents = read_netcdf(path, only=("u", "y"))
    try:
        # Before the hashes, which differ too where two files were exchanged, but say less.
        if contents.attributes["experiment"] != experiment:
            raise ScenarioError(
                f"{path} is of experiment {contents.attributes['experiment']!r}, expected {experiment!r}"
            )
        u, y = contents.variables["u"].values, contents.variables["y"].values
        window = int(contents.attributes["initialisation_window"])
        # Where the outputs are withheld, y runs along the samples of the window alone.
        expected = len(u) if contents.variables["y"].dims[0] == "sample" else min(window, len(u))
        if len(y) != expected:
            raise ScenarioError(f"{path}: {len(y)} samples of y given, expected {expected}")
        for name in contents.differing({name: hashes.get(name) for name in ("u", "y")}):
            raise ScenarioError(f"{path}: {name} differs from what the index says; see hmtb dataset check")
        for values in (u, y):
            if values.ndim != 2 or values.dtype != np.float64:
                raise ScenarioError(f"{path}: {values.shape}, {values.dtype} given as u or y, expected (N, n), float64")
            # All users of the record share them.
            values.setflags(write=False)
        return Signals(u, y, sampling_time(contents), window)
    except KeyError as error:
        raise ScenarioError(f"{path} has no {error.args[0]!r}: expected a record of this version") from error
    except (TypeError, ArithmeticError) as error:
        raise ScenarioError(f"{path} is damaged: {error}") from error


def sampling_time(contents: Contents) -> Fraction:
    """Return the exact sampling time of a record, s."""
    # A ratio, because 0.02 s is no binary fraction.
    numerator, denominator = (contents.attributes[f"sampling_time_{word}"] for word in ("numerator", "denominator"))
    return Fraction(int(numerator), int(denominator))
