"""A built data set, opened from its folder: its parts, and the records in them."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from scenarios.datasets.data_record import DataRecord, read_signals
from scenarios.datasets.layout import INDEX, PARTS, SPEC, TRUTH, UNFINISHED
from scenarios.datasets.spec import DataSetSpec, load_spec
from scenarios.files.errors import ScenarioError, unknown

Joints = str | Sequence[str]
"""One joint, or the joints of a record with several inputs."""


@dataclass(frozen=True)
class IndexEntry:
    """A line of the index of a data set.

    Attributes:
        name: The experiment.
        part: `train`, `validation` or `test`.
        block: Block of the spec that it belongs to.
        arm: The arm under its conditions.
        twin: Number of the randomised twin; None where there are none.
        joints: Whose commands are the inputs and whose angles the outputs.
        file: Its record, relative to the folder of the data set.
        failed: Why there is no record; None where there is one.
        facts: Everything that the index says of it.
    """

    name: str
    part: str
    block: str
    arm: str
    twin: int | None
    joints: tuple[str, ...]
    file: str
    failed: str | None
    facts: Mapping[str, Any] = field(repr=False)


@dataclass(frozen=True)
class DataSet:
    """A data set on disk, of which only the index has been read.

    Attributes:
        folder: Where it is.
        label: Name with version.
        hash: Of all its arrays together, as its index says.
        listings: Its experiments, in order, those without a record too.
    """

    folder: Path
    label: str
    hash: str
    listings: tuple[IndexEntry, ...] = field(repr=False)

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
        """The records of a part, or all, in order; each is read when its numbers are asked for.

        Args:
            part: `train`, `validation` or `test`.

        Raises:
            ScenarioError: No such part.
        """
        if part is not None and part not in PARTS:
            raise ScenarioError(unknown("part", part, PARTS))
        return tuple(self._record(line) for line in self.listings if line.failed is None and part in (None, line.part))

    def record(self, name: str) -> DataRecord:
        """The record of an experiment.

        Raises:
            ScenarioError: There is no such experiment, or it failed.
        """
        known = {line.name: line for line in self.listings}
        if name not in known:
            raise ScenarioError(f"{self.label}: {unknown('experiment', name, known)}")
        if known[name].failed is not None:
            raise ScenarioError(f"{self.label}: {name} has no record: {known[name].failed}")
        return self._record(known[name])

    def select(
        self,
        *,
        joint: Joints | None = None,
        block: str | None = None,
        arm: str | None = None,
        twin: int | None = None,
    ) -> "DataSet":
        """The same data set with those experiments alone that are asked for.

        Args:
            joint: The joint of records with one input and output; several names: of records with exactly these.
            block: Block of the spec.
            arm: The arm under its conditions.
            twin: Number of the randomised twin.

        Raises:
            ScenarioError: No experiment is left; the text says what there is.
        """
        joints = None if joint is None else (joint,) if isinstance(joint, str) else tuple(joint)
        wanted = {"joints": joints, "block": block, "arm": arm, "twin": twin}
        left = self.listings
        for key, value in wanted.items():
            if value is not None:
                found = tuple(line for line in left if getattr(line, key) == value)
                if not found:
                    raise ScenarioError(
                        f"{self.label}: no experiment with {key} = {_shown(value)}; {_choice(left, key)}"
                    )
                left = found
        return replace(self, listings=left)

    @property
    def failed(self) -> Mapping[str, str]:
        """Why experiments have no record, by name."""
        return {line.name: line.failed for line in self.listings if line.failed is not None}

    @property
    def arms(self) -> tuple[str, ...]:
        """The arms under their conditions, in order."""
        return tuple(dict.fromkeys(line.arm for line in self.listings))

    @property
    def spec(self) -> DataSetSpec:
        """The spec that it was built from.

        Raises:
            ScenarioError: It is not in the folder, or no spec.
        """
        return load_spec(self.folder / SPEC)

    @property
    def truth(self) -> Path | None:
        """Folder of what only the simulation knows; None where it is kept apart."""
        return self.folder / TRUTH if (self.folder / TRUTH).is_dir() else None

    def _record(self, line: IndexEntry) -> DataRecord:
        read = partial(read_signals, self.folder / line.file, line.name)
        return DataRecord(line.name, line.part, line.block, line.arm, line.twin, line.joints, read)


def open_data_set(folder: str | Path) -> DataSet:
    """Open a data set; only its index is read, however many records there are.

    Args:
        folder: Its folder, wherever it is.

    Raises:
        ScenarioError: There is none, it is not finished, or its index is damaged.
    """
    folder = Path(folder)
    if not (folder / INDEX).is_file():
        unfinished = folder.with_name(folder.name + UNFINISHED)
        if folder.name.endswith(UNFINISHED) or unfinished.is_dir():
            raise ScenarioError(f"{folder} is not built to its end; go on with: hmtb dataset build")
        what = f"no {INDEX} in it" if folder.is_dir() else "no such folder"
        raise ScenarioError(f"{str(folder)!r} is no data set: {what}; expected a folder that hmtb dataset build made")
    try:
        index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
        listings = tuple(_listing(entry) for entry in index["experiments"])
        return DataSet(folder, str(index["data_set"]), str(index["hash"]), listings)
    except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
        raise ScenarioError(f"{folder / INDEX} is damaged, or of another version: {error}") from error


def load(
    folder: str | Path,
    *,
    joint: Joints | None = None,
    block: str | None = None,
    arm: str | None = None,
    twin: int | None = None,
) -> tuple[DataRecord | tuple[DataRecord, ...], DataRecord | tuple[DataRecord, ...]]:
    """Read the training and test records of a data set, in two words: train, test.

    As in the `nonlinear_benchmarks` package a part with one record is that record, a part with several a tuple of them.
    Where that is in the way: `open_data_set`, whose parts are always tuples.

    Args:
        folder: Folder of the data set, wherever it is.
        joint: The joint of records with one input and output; several names: of records with exactly these.
        block: Block of the spec.
        arm: The arm under its conditions.
        twin: Number of the randomised twin.

    Returns:
        The training part and the test part.

    Raises:
        ScenarioError: No data set there, or no such records in it.
    """
    chosen = open_data_set(folder).select(joint=joint, block=block, arm=arm, twin=twin)
    parts = {part: chosen.records(part) for part in ("train", "test")}
    for part, records in parts.items():
        if not records:
            counts = Counter(line.part for line in chosen.listings if line.failed is None)
            there = ", ".join(f"{count} for {name}" for name, count in counts.items()) or "none at all"
            raise ScenarioError(
                f"{chosen.label}: no {part} records among those asked for, but {there}; open_data_set gives those"
            )
    train, test = (records[0] if len(records) == 1 else records for records in parts.values())
    return train, test


def _listing(entry: Mapping[str, Any]) -> IndexEntry:
    place = PurePosixPath(entry["file"])
    if place.is_absolute() or ".." in place.parts:
        raise ValueError(f"file {entry['file']!r} is outside the folder")
    return IndexEntry(
        name=entry["name"],
        part=entry["part"],
        block=entry["block"],
        arm=entry["arm"],
        twin=entry["twin"],
        joints=tuple(entry["joints"]),
        file=entry["file"],
        failed=entry["failed"],
        facts=entry,
    )


def _shown(value: object) -> str:
    return ", ".join(value) if isinstance(value, tuple) else repr(value)


def _choice(listings: Sequence[IndexEntry], key: str) -> str:
    """What there is to choose from, up to a dozen."""
    known = list(dict.fromkeys(getattr(line, key) for line in listings))
    text = "; ".join(_shown(value) for value in known[:12])
    return f"there are: {text}" + (f"; and {len(known) - 12} more" if len(known) > 12 else "")
