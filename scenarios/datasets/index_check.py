"""Check the index of a data set against itself and the spec."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from scenarios.datasets.chunk import about
from scenarios.datasets.folder_check import FolderFiles
from scenarios.datasets.index import array_line
from scenarios.datasets.plan import INDEX, SPEC, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.withhold import public_facts
from scenarios.files.errors import ScenarioError

MOST_BYTES = 2**30
"""No index is larger."""

MOST_SPEC = 2**24
"""No spec is larger, in bytes."""

MOST_SHOWN = 20
"""Differences of one kind that are reported one by one."""

HASH = re.compile("[0-9a-f]{64}")

Arrays = dict[str, dict[str, str]]
"""Hash of each array, by file."""


@dataclass
class CheckedIndex:
    """Index and spec of a data set, as far as they can be read.

    Attributes:
        entries: Entries of the experiments.
        arrays: Hash of each array, by file; those of the stages too.
        spec: The spec; None if it is withheld or damaged.
        plan: Its plan; None without it.
        problems: One line for each thing that is wrong.
        notes: One line for each thing that could not be checked.
    """

    entries: list[dict[str, Any]] = field(default_factory=list)
    arrays: Arrays = field(default_factory=dict)
    spec: DataSetSpec | None = None
    plan: DataSetPlan | None = None
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def check_index(folder: Path, files: FolderFiles) -> CheckedIndex:
    """Read index and spec, and compare.

    Args:
        folder: Folder of the data set.
        files: Its files.
    """
    index = CheckedIndex()
    try:
        label = _read_index(folder, files, index)
    except (ValueError, RecursionError) as error:
        return CheckedIndex(problems=[f"{INDEX}: {error}"])
    except (LookupError, TypeError, AttributeError) as error:
        return CheckedIndex(problems=[f"{INDEX} is no index of a data set: {error!r}"])
    _read_spec(folder, files, index)
    if index.spec is not None and index.spec.label != label:
        index.problems.append(f"{INDEX} is of {label!r}, {SPEC} of {index.spec.label!r}")
    if index.plan is not None:
        _first(index, _differences(index.plan, index.entries))
    return index


def _read_index(folder: Path, files: FolderFiles, index: CheckedIndex) -> str:
    """Read the index and return the label of the data set."""
    record = json.loads(_text(folder, files, INDEX, MOST_BYTES))
    digest = sha256()
    for entry in record["experiments"]:
        arrays = entry["arrays"]
        for file in sorted(arrays):
            for name in sorted(arrays[file]):
                if not HASH.fullmatch(arrays[file][name]):
                    raise ValueError(f"{file}:{name} has the hash {arrays[file][name]!r}, expected 64 digits")
                digest.update(array_line(file, name, arrays[file][name]))
            if index.arrays.setdefault(file, arrays[file]) is not arrays[file]:
                raise ValueError(f"{file} belongs to two experiments")
        if not isinstance(entry["name"], str) or not isinstance(entry["file"], str):
            raise ValueError(f"an experiment has the name {entry['name']!r} and the file {entry['file']!r}")
        if not (entry["failed"] is None or isinstance(entry["failed"], str)):
            raise ValueError(f"{entry['name']} has failed = {entry['failed']!r}, expected null or a text")
        if entry["failed"] is None and entry["file"] not in arrays:
            raise ValueError(f"{entry['name']} has no array hashes of {entry['file']}")
        index.entries.append(dict(entry))
    for piece in record.get("stages", ()):
        for file, arrays in piece["arrays"].items():
            index.arrays.setdefault(str(file), dict(arrays))
    if digest.hexdigest() != record["hash"]:
        index.problems.append(f"{INDEX}: its array hashes give {digest.hexdigest()}, its hash is {record['hash']!r}")
    return str(record["data_set"])


def _read_spec(folder: Path, files: FolderFiles, index: CheckedIndex) -> None:
    if SPEC not in files.sums and SPEC not in files.sizes:
        index.notes.append(f"{SPEC} is not in this copy: parts and lengths were not checked against it")
        return
    try:
        text = _text(folder, files, SPEC, MOST_SPEC)
        index.spec = DataSetSpec.from_toml(text, source=SPEC)
        index.plan = DataSetPlan(index.spec)
    except (ScenarioError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        index.problems.append(str(error) if str(error).startswith(SPEC) else f"{SPEC}: {error}")


def _text(folder: Path, files: FolderFiles, place: str, most: int) -> str:
    if place not in files.sizes:
        raise ValueError("it is missing, or not listed")
    if files.sizes[place] > most:
        raise ValueError(f"{files.sizes[place]} bytes given, expected at most {most}")
    # The error of a text that is none is a ValueError too.
    return (folder / place).read_text(encoding="utf-8")


def _differences(plan: DataSetPlan, entries: list[dict[str, Any]]) -> Iterator[str]:
    if len(plan) != len(entries):
        yield f"{INDEX} has {len(entries)} experiments, {SPEC} asks for {len(plan)}"
        return
    for planned, entry in zip(plan, entries, strict=True):
        for key, value in _as_json(public_facts(planned) if plan.spec.withheld else about(planned)).items():
            if entry.get(key) != value:
                yield f"{INDEX}: {entry['name']} has {key} = {entry.get(key)!r}, {SPEC} asks for {value!r}"


def _as_json(facts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Facts as the index holds them, with lists in place of tuples."""
    plain: Mapping[str, Any] = json.loads(json.dumps(facts))
    return plain


def _first(index: CheckedIndex, problems: Iterator[str]) -> None:
    for number, problem in enumerate(problems):
        if number == MOST_SHOWN:
            index.problems.append(f"{INDEX}: more differences from {SPEC}")
            return
        index.problems.append(problem)
