"""Compare the folder of a data set with its own checksums, index and spec; no path leads out of the folder."""

import json
import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from scenarios.datasets.index import hash_of_all
from scenarios.datasets.plan import INDEX, PRIVATE, SPEC, SUMS, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError

LINE = re.compile(rb"([0-9a-f]{64})  ([^\x00-\x1f\x7f\\]{1,4096})\n")
"""A line of the checksums, as the builder writes it; no other spelling passes, so that no byte can change unseen."""

MOST_SHOWN = 20
"""Problems of one kind that are reported one by one."""

MOST_BYTES = {INDEX: 2**30, SPEC: 2**24}
"""No index and no spec is larger; nor any other file than 2**36 bytes."""


@dataclass
class CheckedFolder:
    """Files, index and spec of a data set, as far as they can be read.

    Attributes:
        sizes: Sizes by path of the files that are there and listed in the checksums, bytes.
        sums: Checksums of the files that are listed.
        entries: Entries of the experiments in the index.
        arrays: Hash of each array, by file; those of the stages too.
        plan: The plan of the spec; None if the spec is missing or damaged.
        problems: One line for each thing that is wrong.
        notes: One line for each thing that cannot be checked.
    """

    sizes: dict[str, int] = field(default_factory=dict)
    sums: dict[str, str] = field(default_factory=dict)
    entries: list[dict[str, Any]] = field(default_factory=list)
    arrays: dict[str, dict[str, str]] = field(default_factory=dict)
    plan: DataSetPlan | None = None
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def check_folder(folder: Path) -> CheckedFolder:
    """List the files of a data set, read its checksums, index and spec, and compare.

    Args:
        folder: Folder of the data set; links in it are not followed.
    """
    checked = list_files(folder)
    try:
        label = _read_index(folder, checked)
    except (ValueError, RecursionError) as error:
        checked.problems.append(f"{INDEX}: {error}")
    except (LookupError, TypeError, AttributeError) as error:
        checked.problems.append(f"{INDEX} is no index of a data set: {error!r}")
    else:
        _check_spec(folder, checked, label)
        return checked
    checked.entries, checked.arrays = [], {}
    return checked


def list_files(folder: Path) -> CheckedFolder:
    """List the files of a data set, and compare them with its checksums."""
    checked = CheckedFolder()
    problems, sizes, unreadable = checked.problems, checked.sizes, list[OSError]()
    for parent, folders, names in os.walk(folder, onerror=unreadable.append):
        folders.sort()
        for name in sorted((*names, *folders)):
            path = Path(parent, name)
            place = path.relative_to(folder).as_posix()
            status = path.lstat()
            if not place.isprintable():
                problems.append(f"{place!r}: expected a name of printable characters")
            elif stat.S_ISDIR(status.st_mode):
                continue
            elif not stat.S_ISREG(status.st_mode):
                kind = "a link" if stat.S_ISLNK(status.st_mode) else "no ordinary file"
                problems.append(f"{place!r} is {kind}; expected files alone")
            elif status.st_size > 2**36:
                problems.append(f"{place!r} has {status.st_size} bytes; expected at most {2**36}")
            else:
                sizes[place] = status.st_size
    problems += [f"{error.filename}: cannot be listed: {error.strerror}" for error in unreadable]
    if sizes.pop(SUMS, None) is None:
        problems.append(f"{SUMS} is missing: no file can be checked against it")
        return checked
    _read_sums(folder / SUMS, checked)
    problems += [f"{place} is missing" for place in checked.sums if place not in sizes]
    for place in [place for place in sizes if place not in checked.sums]:
        problems.append(f"{place} is not listed in {SUMS}")
        del sizes[place]
    return checked


def _read_sums(path: Path, checked: CheckedFolder) -> None:
    """Read the checksums; a wrong line is a problem."""
    sums, bad = checked.sums, 0
    with path.open("rb") as stream:
        # A line of any length would fill the memory.
        for number, line in enumerate(iter(lambda: stream.readline(8192), b""), start=1):
            match = LINE.fullmatch(line)
            place = match[2].decode(errors="replace") if match else ""
            if match is None:
                wrong = f"{line[:100]!r} given, expected a SHA-256, two spaces, a file and the end of the line"
            elif not {"", ".", ".."}.isdisjoint(place.split("/")):
                wrong = f"{place[:100]!r} leads out of the folder, or is no plain path; it is not looked at"
            elif place == SUMS or place in sums:
                wrong = f"{place!r} is listed twice" if place in sums else f"{SUMS} lists itself"
            else:
                sums[place] = match[1].decode()
                continue
            bad += 1
            checked.problems.append(f"{SUMS}, line {number}: {wrong}")
            if bad > MOST_SHOWN:
                checked.problems.append(f"{SUMS}: more wrong lines; it is damaged")
                return
    if not sums:
        checked.problems.append(f"{SUMS} lists no file")


def _read_index(folder: Path, checked: CheckedFolder) -> str:
    """Read the index, and return the label of the data set."""
    record = json.loads(_text(folder, checked, INDEX))
    for entry in record["experiments"]:
        for file, hashes in entry["arrays"].items():
            for name, value in hashes.items():
                if not re.fullmatch("[0-9a-f]{64}", value):
                    raise ValueError(f"{file}:{name} has the hash {value!r}, expected 64 digits")
            if checked.arrays.setdefault(file, hashes) is not hashes:
                raise ValueError(f"{file} belongs to two experiments")
        if wrong := [key for key in ("name", "file", "part", "arm") if not isinstance(entry[key], str)]:
            raise ValueError(f"an experiment has {wrong[0]} = {entry[wrong[0]]!r}, expected a text")
        if not (entry["failed"] is None or isinstance(entry["failed"], str)):
            raise ValueError(f"{entry['name']} has failed = {entry['failed']!r}, expected null or a text")
        if entry["failed"] is None and entry["file"] not in entry["arrays"]:
            raise ValueError(f"{entry['name']} has no array hashes of {entry['file']}")
        checked.entries.append(dict(entry))
    for piece in record.get("stages", ()):
        for file, hashes in piece["arrays"].items():
            checked.arrays.setdefault(str(file), dict(hashes))
    if (whole := hash_of_all(entry["arrays"] for entry in record["experiments"])) != record["hash"]:
        checked.problems.append(f"{INDEX}: its array hashes give {whole}, its hash is {record['hash']!r}")
    return str(record["data_set"])


def _check_spec(folder: Path, checked: CheckedFolder, label: str) -> None:
    """Read the spec, and compare the index with it."""
    if SPEC not in checked.sums and SPEC not in checked.sizes:
        checked.notes.append(f"{SPEC} is not in this copy: parts and lengths were not checked against it")
        return
    try:
        spec = DataSetSpec.from_toml(_text(folder, checked, SPEC), source=SPEC)
        checked.plan = DataSetPlan(spec)
    except (ScenarioError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        checked.problems.append(str(error) if str(error).startswith(SPEC) else f"{SPEC}: {error}")
        return
    if spec.label != label:
        checked.problems.append(f"{INDEX} is of {label!r}, {SPEC} of {spec.label!r}")
    differences = list(islice(_differences(checked.plan, checked.entries), MOST_SHOWN + 1))
    checked.problems += differences[:MOST_SHOWN]
    if len(differences) > MOST_SHOWN:
        checked.problems.append(f"{INDEX}: more differences from {SPEC}")


def _text(folder: Path, checked: CheckedFolder, place: str) -> str:
    if place not in checked.sizes:
        raise ValueError("it is missing, or not listed")
    if checked.sizes[place] > MOST_BYTES[place]:
        raise ValueError(f"{checked.sizes[place]} bytes given, expected at most {MOST_BYTES[place]}")
    # A file that is no text raises a ValueError too.
    return (folder / place).read_text(encoding="utf-8")


def _differences(plan: DataSetPlan, entries: list[dict[str, Any]]) -> Iterator[str]:
    if len(plan) != len(entries):
        yield f"{INDEX} has {len(entries)} experiments, {SPEC} asks for {len(plan)}"
        return
    private = PRIVATE if plan.spec.withheld else ()
    for planned, entry in zip(plan, entries, strict=True):
        facts = {key: value for key, value in planned.facts.items() if key not in private}
        # JSON has lists in place of tuples.
        for key, value in json.loads(json.dumps(facts)).items():
            if entry.get(key) != value:
                yield f"{INDEX}: {entry['name']} has {key} = {entry.get(key)!r}, {SPEC} asks for {value!r}"
