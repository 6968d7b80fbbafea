"""The index of a data set: every experiment and its one hash."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from scenarios.datasets.layout import INDEX, MANIFEST
from scenarios.datasets.manifest import Manifest, entry_of
from scenarios.files.atomic_write import replacing


@dataclass(frozen=True)
class Summary:
    """What an index says of the whole.

    Attributes:
        experiments: How many experiments have a record.
        failed: Why others have none, and what else could not be made, by name.
        hash: Of all arrays together.
    """

    experiments: int
    failed: Mapping[str, str]
    hash: str


def write_index(folder: Path, label: str, manifest: Manifest) -> Summary:
    """Write the index from the manifest, entry by entry.

    Args:
        folder: That of the data set.
        label: Name and version of the data set.
        manifest: All experiments are noted in it.

    Raises:
        OSError: The file cannot be written.
    """
    digest, failed, kept = sha256(), dict[str, str](), 0
    with replacing(folder / INDEX, durable=True) as partial, partial.open("wb") as stream:
        stream.write(f'{{\n "data_set": {json.dumps(label)},\n "experiments": ['.encode())
        for number, line in enumerate(manifest.noted()):
            arrays = line.get("arrays", {})
            for file in sorted(arrays):
                for name in sorted(arrays[file]):
                    digest.update(array_line(file, name, arrays[file][name]))
            entry = {**line["about"], "arrays": arrays, "failed": line.get("failed")}
            stream.write(f"{',' if number else ''}\n  {json.dumps(entry, allow_nan=False)}".encode())
            failed |= failures(line)
            kept += "failed" not in line
        stream.write(f'\n ],\n "hash": "{digest.hexdigest()}"\n}}\n'.encode())
    return Summary(kept, failed, digest.hexdigest())


def array_line(file: str, name: str, array_hash: str) -> bytes:
    """What one array adds to the hash of the whole; arrays in the order of the plan, then of files, then of names."""
    return f"{array_hash}  {file}:{name}\n".encode()


def failures(line: Mapping[str, Any]) -> dict[str, str]:
    """What an entry of the manifest says could not be made, and why."""
    name = line["about"]["name"] if "about" in line else f"{line['stage']}: {line['piece']}"
    return {**({name: line["failed"]} if "failed" in line else {}), **line.get("missing", {})}


def read_index(folder: Path) -> Any:
    """The index of a data set, as `json` has it."""
    return json.loads((folder / INDEX).read_text(encoding="utf-8"))


def summary(folder: Path) -> Summary:
    """What was said of a data set at the end of its build.

    Args:
        folder: That of the finished data set.
    """
    failed, kept = dict[str, str](), 0
    with (folder / MANIFEST).open("rb") as stream:
        for line in filter(None, map(entry_of, stream)):
            failed |= failures(line)
            kept += "number" in line and "failed" not in line
    return Summary(kept, failed, read_index(folder)["hash"])
