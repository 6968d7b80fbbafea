"""Write files of a data set so that neither a kill nor a power cut leaves half of one under its name."""

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

PARTIAL = ".partial"
"""Ending of a file that is being written; what has it counts for nothing."""


@contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """Write a file through a stream: on the disk under a temporary name first, then renamed.

    Args:
        path: The file; folders that are missing are made.

    Yields:
        A stream of bytes; if the work inside fails, nothing of it stays and a file that was there does.

    Raises:
        OSError: The file cannot be written; the error names it.
    """
    with naming(path):
        make_folder(path.parent)
        yield from _replaced(path)
        sync_folder(path.parent)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8 with line feeds, whole or not at all; see `writing`."""
    with writing(path) as stream:
        stream.write(text.encode())


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files, each whole or not at all; all are on the disk when this returns.

    Args:
        folder: That of the data set.
        files: Contents by place in the folder.

    Raises:
        OSError: A file cannot be written; the error names it.
    """
    touched: dict[Path, None] = {}
    for place, content in files.items():
        path = folder / place
        with naming(path):
            make_folder(path.parent)
            for stream in _replaced(path):
                stream.write(content)
        touched[path.parent] = None
    for parent in touched:
        sync_folder(parent)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, and see their names on the disk."""
    if path.is_dir():
        return
    make_folder(path.parent)
    path.mkdir(exist_ok=True)
    sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """See the names in a folder on the disk: a rename is safe only then."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network file systems cannot do it for folders.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


def remove_partial(folder: Path) -> None:
    """Remove what a kill left half written, in a folder and all below."""
    for parent, _, names in os.walk(folder):
        for name in names:
            if name.endswith(PARTIAL):
                Path(parent, name).unlink()


def _replaced(path: Path) -> Iterator[BinaryIO]:
    partial = path.with_name(path.name + PARTIAL)
    if path.is_dir():
        # Named here: the renaming would name the temporary file.
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    try:
        with partial.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Give an error of the system the file's name; writing to a stream gives it none."""
    try:
        yield
    except OSError as error:
        if error.filename is None:
            error.filename = str(path)
        raise
