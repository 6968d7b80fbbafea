"""The index of a data set, held against itself, the manifest, the checksums and the spec."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

from scenarios.datasets.chunk import about
from scenarios.datasets.folder_files import Files
from scenarios.datasets.index import array_line
from scenarios.datasets.layout import INDEX, MANIFEST, SPEC
from scenarios.datasets.manifest import entry_of
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.withhold import public_facts
from scenarios.files.errors import ScenarioError

MOST_BYTES = 2**30
"""No index is larger."""

MOST_SPEC = 2**24
"""No spec is larger, in bytes."""

MOST_SHOWN = 20
"""Differences of one kind that are complained about one by one."""

HASH = re.compile("[0-9a-f]{64}")

Arrays = dict[str, dict[str, str]]
"""Hash of each array, by file."""


@dataclass
class Index:
    """What the papers of a build say of its experiments.

    Attributes:
        entries: The experiments, as the index has them.
        arrays: Hash of each array, by file; of the stages' files too.
        files: Hash of each file that the manifest names.
        spec: The spec; None where it is kept apart, or damaged.
        plan: What it asks for; None without it.
        problems: What is wrong.
        notes: What could not be checked.
    """

    entries: list[dict[str, Any]] = field(default_factory=list)
    arrays: Arrays = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    spec: DataSetSpec | None = None
    plan: DataSetPlan | None = None
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def checked_index(folder: Path, files: Files) -> Index:
    """Read what the papers of a build say, and compare.

    Args:
        folder: That of the data set.
        files: Its files.
    """
    index = Index()
    try:
        label = _read_index(folder, files, index)
    except (ValueError, RecursionError) as error:
        return Index(problems=[f"{INDEX}: {error}"])
    except (LookupError, TypeError, AttributeError) as error:
        return Index(problems=[f"{INDEX} is no index of a data set: {error!r}"])
    _read_manifest(folder, files, index)
    _read_spec(folder, files, index)
    if index.spec is not None and index.spec.label != label:
        index.problems.append(f"{INDEX} is of {label!r}, {SPEC} of {index.spec.label!r}")
    if index.plan is not None:
        _first(index, _differences(index.plan, index.entries))
    return index


def _read_index(folder: Path, files: Files, index: Index) -> str:
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
    if digest.hexdigest() != record["hash"]:
        index.problems.append(f"{INDEX}: its array hashes give {digest.hexdigest()}, its hash is {record['hash']!r}")
    return str(record["data_set"])


def _read_manifest(folder: Path, files: Files, index: Index) -> None:
    if MANIFEST not in files.sizes:
        if MANIFEST not in files.sums:
            index.notes.append(f"{MANIFEST} is not in this copy: arrays made after the experiments have no hash")
        return
    indexed = dict(index.arrays)
    with (folder / MANIFEST).open("rb") as stream:
        for number, line in enumerate(iter(lambda: stream.readline(MOST_BYTES), b""), start=1):
            try:
                entry = entry_of(line)
                if entry is None:
                    raise ValueError("it is no line of a manifest, or a damaged one")
                arrays: Arrays = {str(file): dict(hashes) for file, hashes in entry["arrays"].items()}
                index.files |= {str(file): str(value) for file, value in entry["files"].items()}
            except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
                index.problems.append(f"{MANIFEST}, line {number}: {error}")
                return
            for file, hashes in arrays.items():
                if "number" in entry and indexed.get(file) != hashes:
                    index.problems.append(f"{file}: {MANIFEST} and {INDEX} give it different array hashes")
                index.arrays.setdefault(file, hashes)


def _read_spec(folder: Path, files: Files, index: Index) -> None:
    if SPEC not in files.sums and SPEC not in files.sizes:
        index.notes.append(f"{SPEC} is kept apart: parts and lengths were not held against it, nothing was simulated")
        return
    try:
        text = _text(folder, files, SPEC, MOST_SPEC)
        index.spec = DataSetSpec.from_toml(text, source=SPEC)
        index.plan = DataSetPlan(index.spec)
    except (ScenarioError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        index.problems.append(str(error) if str(error).startswith(SPEC) else f"{SPEC}: {error}")


def _text(folder: Path, files: Files, place: str, most: int) -> str:
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
        for key, value in _told(public_facts(planned) if plan.spec.withheld else about(planned)).items():
            if entry.get(key) != value:
                yield f"{INDEX}: {entry['name']} has {key} = {entry.get(key)!r}, {SPEC} asks for {value!r}"


def _told(facts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Facts as JSON has them."""
    told: Mapping[str, Any] = json.loads(json.dumps(facts))
    return told


def _first(index: Index, problems: Iterator[str]) -> None:
    for number, problem in enumerate(problems):
        if number == MOST_SHOWN:
            index.problems.append(f"{INDEX}: more differences from {SPEC}")
            return
        index.problems.append(problem)
