"""Index of a data set, with the hashes of arrays and one hash of all; and the checksums of its files."""

import json
from collections.abc import Iterable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from hmtb_twin.files.atomic_write import replacing, write_whole
from hmtb_twin.files.hashes import file_hash
from scenarios.datasets.plan import INDEX, SUMS


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
    with replacing(folder / INDEX, durable=True) as partial, partial.open("w", encoding="utf-8") as stream:
        # Piece by piece: `json.dump` would need the list of all experiments.
        stream.write(f'{{\n "data_set": {json.dumps(label)},\n "experiments": [')
        separator = ""
        for finished in experiments:
            arrays = finished.get("arrays", {})
            digest.update(array_lines(arrays))
            listed = {**finished["about"], "arrays": arrays, "failed": finished.get("failed")}
            if finished.get("missing"):
                listed["missing"] = finished["missing"]
            stream.write(f"{separator}\n  {json.dumps(listed, allow_nan=False)}")
            separator = ","
        stream.write('\n ],\n "stages": [')
        separator = ""
        for finished in stages:
            listed = {key: finished.get(key) for key in ("stage", "piece", "arrays", "failed")}
            stream.write(f"{separator}\n  {json.dumps(listed, allow_nan=False)}")
            separator = ","
        stream.write(f'\n ],\n "hash": "{digest.hexdigest()}"\n}}\n')


def hash_of_all(experiments: Iterable[Mapping[str, Mapping[str, str]]]) -> str:
    """Hash of all arrays of a data set from those of its experiments, by file and name, in the order of the plan."""
    digest = sha256()
    for arrays in experiments:
        digest.update(array_lines(arrays))
    return digest.hexdigest()


def hash_of_records(experiments: Iterable[Mapping[str, Any]]) -> str:
    """Hash of the arrays of all records, without the truth, from the entries of the index.

    Records do not depend on the kernels of the linear algebra. The truth does in its last digits, and its matrices A, B
    and C in their coordinates.
    """
    files = ((listed["file"], listed["arrays"]) for listed in experiments)
    return hash_of_all({file: arrays.get(file, {})} for file, arrays in files)


def array_lines(arrays: Mapping[str, Mapping[str, str]]) -> bytes:
    """Lines of an experiment's arrays in the hash of all, by file and name; experiments in the order of the plan."""
    lines: list[str] = []
    # Sorted, so that the hash does not depend on the order in which files and arrays were made.
    for file, hashes in sorted(arrays.items()):
        lines += [f"{hashes[name]}  {file}:{name}\n" for name in sorted(hashes)]
    return "".join(lines).encode()


def read_index(folder: Path) -> Any:
    """Read the index of a data set as plain dictionaries and lists; nothing is checked."""
    return json.loads((folder / INDEX).read_text(encoding="utf-8"))


def paths_of_files(folder: Path) -> list[str]:
    """Paths of all files in a folder, sorted; links count as files."""
    paths = (path for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in paths)


def write_checksums(folder: Path, sums: Mapping[str, str]) -> None:
    """Write checksums by path, as `sha256sum --check` reads them."""
    write_whole(folder / SUMS, "".join(f"{sums[path]}  {path}\n" for path in sorted(sums)), durable=True)


def seal(folder: Path) -> None:
    """Write the checksums of all files in a folder."""
    write_checksums(folder, {path: file_hash(folder / path) for path in paths_of_files(folder) if path != SUMS})
