"""Compare the folder of a data set with its own checksums, index and spec; no path leads out of the folder."""

import json
import os
import re
import stat
from collections.abc import Iterator, Mapping
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
"""No index and no spec is larger: they are read whole."""

MOST_FILE_BYTES = 2**36
"""No other file is larger, 64 GiB."""


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
    # `json` follows nested lists by recursion.
    except (ValueError, RecursionError) as error:
        checked.problems.append(f"{INDEX}: {error}")
    except (LookupError, TypeError, AttributeError) as error:
        checked.problems.append(f"{INDEX} is no index of a data set: {error!r}")
    else:
        _check_spec(folder, checked, label)
        return checked
    # Half an index must not pass for a whole one.
    checked.entries, checked.arrays = [], {}
    return checked


def list_files(folder: Path) -> CheckedFolder:
    """List the files of a data set, and compare them with its checksums."""
    checked = CheckedFolder()
    problems, sizes, unreadable = checked.problems, checked.sizes, list[OSError]()
    for parent, folders, names in os.walk(folder, onerror=unreadable.append):
        folders.sort()  # in place: the order in which `walk` goes on
        for name in sorted((*names, *folders)):
            _list_file(Path(parent, name), folder, checked)
    problems += [f"{error.filename}: cannot be listed: {error.strerror}" for error in unreadable]
    if sizes.pop(SUMS, None) is None:
        problems.append(f"{SUMS} is missing: no file can be checked against it")
        return checked
    _read_sums(folder / SUMS, checked)
    problems += [f"{path} is missing" for path in checked.sums if path not in sizes]
    for path in [path for path in sizes if path not in checked.sums]:
        problems.append(f"{path} is not listed in {SUMS}")
        del sizes[path]
    return checked


def _list_file(file: Path, folder: Path, checked: CheckedFolder) -> None:
    """Note the size of a file, or why it is not read: a link could lead out, reading a pipe would never end."""
    path = file.relative_to(folder).as_posix()
    status = file.lstat()
    if not path.isprintable():
        checked.problems.append(f"{path!r}: expected a name of printable characters")
    elif stat.S_ISDIR(status.st_mode):
        return
    elif not stat.S_ISREG(status.st_mode):
        file_type = "a link" if stat.S_ISLNK(status.st_mode) else "no ordinary file"
        checked.problems.append(f"{path!r} is {file_type}; expected files alone")
    elif status.st_size > MOST_FILE_BYTES:
        checked.problems.append(f"{path!r} has {status.st_size} bytes; expected at most {MOST_FILE_BYTES}")
    else:
        checked.sizes[path] = status.st_size


def _read_sums(sums_file: Path, checked: CheckedFolder) -> None:
    """Read the checksums; a wrong line is a problem."""
    sums, wrong_lines = checked.sums, 0
    with sums_file.open("rb") as stream:
        # A line of any length would fill the memory.
        for line_number, line in enumerate(iter(lambda: stream.readline(8192), b""), start=1):
            match = LINE.fullmatch(line)
            path = match[2].decode(errors="replace") if match else ""
            if match is None:
                wrong = f"{line[:100]!r} given, expected a SHA-256, two spaces, a file and the end of the line"
            elif not {"", ".", ".."}.isdisjoint(path.split("/")):
                wrong = f"{path[:100]!r} leads out of the folder, or is no plain path; it is not looked at"
            elif path in sums:
                wrong = f"{path!r} is listed twice"
            elif path == SUMS:
                wrong = f"{SUMS} lists itself"
            else:
                sums[path] = match[1].decode()
                continue
            wrong_lines += 1
            checked.problems.append(f"{SUMS}, line {line_number}: {wrong}")
            if wrong_lines > MOST_SHOWN:
                checked.problems.append(f"{SUMS}: more wrong lines; it is damaged")
                return
    if not sums:
        checked.problems.append(f"{SUMS} lists no file")


def _read_index(folder: Path, checked: CheckedFolder) -> str:
    """Read the index, and return the label of the data set."""
    index = json.loads(_text(folder, checked, INDEX))
    for listed in index["experiments"]:
        for file, hashes in listed["arrays"].items():
            _check_hashes(file, hashes)
            # The object itself is there only if no experiment before had arrays of this file.
            if checked.arrays.setdefault(file, hashes) is not hashes:
                raise ValueError(f"{file} belongs to two experiments")
        _check_listed(listed)
        checked.entries.append(dict(listed))
    for piece in index.get("stages", ()):
        for file, hashes in piece["arrays"].items():
            checked.arrays.setdefault(str(file), dict(hashes))
    hash_of_arrays = hash_of_all(listed["arrays"] for listed in index["experiments"])
    if hash_of_arrays != index["hash"]:
        checked.problems.append(f"{INDEX}: its array hashes give {hash_of_arrays}, its hash is {index['hash']!r}")
    return str(index["data_set"])


def _check_hashes(file: str, hashes: Mapping[str, str]) -> None:
    for name, value in hashes.items():
        if not re.fullmatch("[0-9a-f]{64}", value):
            raise ValueError(f"{file}:{name} has the hash {value!r}, expected 64 digits")


def _check_listed(listed: Mapping[str, Any]) -> None:
    """Refuse an experiment of the index whose entries have other types than those that this program writes."""
    for key in ("name", "file", "part", "arm"):
        if not isinstance(listed[key], str):
            raise ValueError(f"an experiment has {key} = {listed[key]!r}, expected a text")
    if not (listed["failed"] is None or isinstance(listed["failed"], str)):
        raise ValueError(f"{listed['name']} has failed = {listed['failed']!r}, expected null or a text")
    if listed["failed"] is None and listed["file"] not in listed["arrays"]:
        raise ValueError(f"{listed['name']} has no array hashes of {listed['file']}")


def _check_spec(folder: Path, checked: CheckedFolder, label: str) -> None:
    """Read the spec, and compare the index with it."""
    if SPEC not in checked.sums and SPEC not in checked.sizes:
        checked.notes.append(f"{SPEC} is not in this copy: parts and lengths were not checked against it")
        return
    try:
        spec = DataSetSpec.from_toml(_text(folder, checked, SPEC), source=SPEC)
        checked.plan = DataSetPlan(spec)
    # A downloaded spec may ask for any number of anything.
    except (ScenarioError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        message = str(error)
        checked.problems.append(message if message.startswith(SPEC) else f"{SPEC}: {message}")
        return
    if spec.label != label:
        checked.problems.append(f"{INDEX} is of {label!r}, {SPEC} of {spec.label!r}")
    # One more than is shown tells whether there are others.
    differences = list(islice(_differences(checked.plan, checked.entries), MOST_SHOWN + 1))
    checked.problems += differences[:MOST_SHOWN]
    if len(differences) > MOST_SHOWN:
        checked.problems.append(f"{INDEX}: more differences from {SPEC}")


def _text(folder: Path, checked: CheckedFolder, path: str) -> str:
    """The text of the index or the spec, if it is listed and not too large."""
    if path not in checked.sizes:
        raise ValueError("it is missing, or not listed")
    if checked.sizes[path] > MOST_BYTES[path]:
        raise ValueError(f"{checked.sizes[path]} bytes given, expected at most {MOST_BYTES[path]}")
    # A file that is no text raises a ValueError too.
    return (folder / path).read_text(encoding="utf-8")


def _differences(plan: DataSetPlan, experiments: list[dict[str, Any]]) -> Iterator[str]:
    """Differences between the experiments in the index and those that the spec asks for."""
    if len(plan) != len(experiments):
        yield f"{INDEX} has {len(experiments)} experiments, {SPEC} asks for {len(plan)}"
        return
    private = PRIVATE if plan.spec.withheld else ()
    for planned, listed in zip(plan, experiments, strict=True):
        facts = {key: value for key, value in planned.facts.items() if key not in private}
        # JSON has lists in place of tuples.
        for key, value in json.loads(json.dumps(facts)).items():
            if listed.get(key) != value:
                yield f"{INDEX}: {listed['name']} has {key} = {listed.get(key)!r}, {SPEC} asks for {value!r}"
