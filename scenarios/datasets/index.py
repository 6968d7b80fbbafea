"""Index of a data set: experiments and pieces of stages with the hashes of their arrays, and one hash of all."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from scenarios.datasets.plan import INDEX
from scenarios.files.atomic_write import replacing


@dataclass(frozen=True)
class IndexSummary:
    """An index in short.

    Attributes:
        experiments: Number of experiments that have a record.
        failed: Why others have none, and what else could not be made, by name.
        hash: Hash of the arrays of all experiments.
    """

    experiments: int
    failed: Mapping[str, str]
    hash: str


def write_index(
    folder: Path, label: str, experiments: Iterable[Mapping[str, Any]], stages: Iterable[Mapping[str, Any]] = ()
) -> None:
    """Write the index entry by entry: of a million experiments only one is in memory.

    Args:
        folder: Folder of the data set.
        label: Name and version of the data set.
        experiments: Journal entries of the experiments, in the order of the plan.
        stages: Journal entries of the pieces of stages, in their order.

    Raises:
        OSError: The file cannot be written.
    """
    digest = sha256()
    with replacing(folder / INDEX, durable=True) as partial, partial.open("wb") as stream:
        stream.write(f'{{\n "data_set": {json.dumps(label)},\n "experiments": ['.encode())
        for number, entry in enumerate(experiments):
            arrays = entry.get("arrays", {})
            for file in sorted(arrays):
                for name in sorted(arrays[file]):
                    digest.update(array_line(file, name, arrays[file][name]))
            line = {**entry["about"], "arrays": arrays, "failed": entry.get("failed")}
            line |= {"missing": entry["missing"]} if entry.get("missing") else {}
            stream.write(f"{',' if number else ''}\n  {json.dumps(line, allow_nan=False)}".encode())
        stream.write(b'\n ],\n "stages": [')
        for number, entry in enumerate(stages):
            line = {key: entry.get(key) for key in ("stage", "piece", "arrays", "failed")}
            stream.write(f"{',' if number else ''}\n  {json.dumps(line, allow_nan=False)}".encode())
        stream.write(f'\n ],\n "hash": "{digest.hexdigest()}"\n}}\n'.encode())


def array_line(file: str, name: str, array_hash: str) -> bytes:
    """Line of one array in the hash of all; arrays in the order of the plan, then of files, then of names."""
    return f"{array_hash}  {file}:{name}\n".encode()


def read_index(folder: Path) -> Any:
    """The index of a data set, as `json` has it."""
    return json.loads((folder / INDEX).read_text(encoding="utf-8"))


def summary(folder: Path) -> IndexSummary:
    """The index of a finished data set in short."""
    index = read_index(folder)
    experiments = index["experiments"]
    failed: dict[str, str] = {}
    for entry in experiments:
        failed |= {entry["name"]: entry["failed"]} if entry["failed"] else {}
        failed |= entry.get("missing", {})
    for entry in index.get("stages", ()):
        failed |= {f"{entry['stage']}: {entry['piece']}": entry["failed"]} if entry["failed"] else {}
    return IndexSummary(sum(not entry["failed"] for entry in experiments), failed, index["hash"])
