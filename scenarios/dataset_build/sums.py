"""Checksums of all files of a data set: the last file that is written."""

import os
from collections.abc import Iterator
from pathlib import Path

from scenarios.dataset_build.manifest import Manifest
from scenarios.dataset_build.safe_write import writing
from scenarios.datasets.hashes import file_hash
from scenarios.datasets.layout import DATA, LOCK, SUMS, TRUTH


def write_sums(folder: Path, manifest: Manifest) -> None:
    """Write the checksums, as `sha256sum --check` reads them: files of experiments in the order of the plan first.

    Args:
        folder: That of the data set.
        manifest: What is noted in it was written, or looked at, with the hash that stands there.

    Raises:
        OSError: A file cannot be read or written.
    """
    with writing(folder / SUMS) as stream:
        for line in manifest.noted():
            for place, of_file in sorted(line["files"].items()):
                stream.write(f"{of_file}  {place}\n".encode())
        noted = {place: of_file for line in manifest.pieces() for place, of_file in line["files"].items()}
        for place in sorted({*noted, *_papers(folder)}):
            stream.write(f"{noted.get(place) or file_hash(folder / place)}  {place}\n".encode())


def _papers(folder: Path) -> Iterator[str]:
    """Files that no manifest names: all but those of data and truth."""
    for parent, folders, names in os.walk(folder):
        if Path(parent) == folder:
            folders[:] = [name for name in folders if name not in (DATA, TRUTH)]
            names = [name for name in names if name not in (LOCK, SUMS, f"{SUMS}.partial")]
        for name in names:
            yield Path(parent, name).relative_to(folder).as_posix()
