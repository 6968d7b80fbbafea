"""Write files whole or not at all, and with `durable` on the disk before they have their name."""

import errno
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from hmtb_twin.files.errors import TwinError

PARTIAL = ".partial"
"""Ending of a file that is being written."""


def check_place(path: Path) -> None:
    """Refuse a path where no file can be written, before the work for it begins.

    Raises:
        TwinError: There is a folder of that name.
    """
    if path.is_dir():
        raise TwinError(f"cannot write {path}: it is a folder; expected a file or nothing there")


@contextmanager
def replacing(path: Path, *, durable: bool = False) -> Iterator[Path]:
    """Write under a temporary name, then rename: readers find the old file or the new one, never half of one.

    Args:
        path: The file.
        durable: Flush file and folder to the disk, so that a power cut leaves no empty file under the name.

    Yields:
        The temporary name. If the work inside fails, the temporary file is removed and the old file stays.

    Raises:
        TwinError: There is a folder of that name.
        OSError: The file cannot be written; the error names it.
    """
    check_place(path)
    partial = path.with_name(f"{path.name[:200]}.{secrets.token_hex(4)}{PARTIAL}")
    try:
        # a name of its own, and no link: several programs may write this file, and anybody may have put a link here
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield partial
        if durable:
            sync(partial)
        partial.replace(path)
        if durable:
            sync(path.parent)
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(partial)):
            error.filename = str(path)
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes, *, durable: bool = False) -> None:
    """Write a text as UTF-8, or bytes, whole or not at all; see `replacing`."""
    encoded = content.encode() if isinstance(content, str) else content
    with replacing(path, durable=durable) as partial:
        partial.write_bytes(encoded)


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files durably, each whole or not at all; each folder is flushed once for all its files.

    Args:
        folder: Where the paths start; folders that are missing are made.
        files: Contents by path in the folder.

    Raises:
        TwinError: There is a folder in the place of a file.
        OSError: A file cannot be written; the error names it.
    """
    touched: dict[Path, None] = {}
    for place, content in files.items():
        path = folder / place
        make_folder(path.parent)
        with replacing(path) as partial:
            partial.write_bytes(content)
            sync(partial)
        touched[path.parent] = None
    for parent in touched:
        sync(parent)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, durably."""
    if path.is_dir():
        return
    make_folder(path.parent)
    path.mkdir(exist_ok=True)
    sync(path.parent)


def remove_partial(folder: Path) -> None:
    """Remove files that a killed process left half written, in a folder and all below."""
    for partial in folder.rglob(f"*{PARTIAL}"):
        partial.unlink()


def sync(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk: a rename survives a power cut only then."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # Some network file systems cannot flush folders.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP) or not path.is_dir():
            error.filename = str(path)
            raise
    finally:
        os.close(descriptor)


@contextmanager
def result_folder(path: Path) -> Iterator[None]:
    """Make a folder for results; on errors remove it, and parents that were made for it, where they are empty."""
    new = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        with suppress(OSError):  # another program may have written there meanwhile
            for folder in new:  # innermost first
                folder.rmdir()
        raise


@contextmanager
def working_folder(out: Path) -> Iterator[Path]:
    """Make a temporary folder inside a `result_folder`, on the disk of the results, and remove it at the end."""
    with result_folder(out), TemporaryDirectory(prefix=".export-", dir=out) as place:
        yield Path(place)
