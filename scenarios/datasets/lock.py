"""One builder in a folder at a time."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenarios.datasets.layout import LOCK
from scenarios.files.errors import ScenarioError


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Be the only builder in a folder.

    Args:
        folder: An existing folder.

    Raises:
        ScenarioError: Another builder is in it.
        OSError: The file cannot be made, or the file system has no locks.
    """
    path = folder / LOCK
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ScenarioError(f"{folder}: another build is at work in this folder; wait for it, or stop it") from None
        except OSError as error:
            error.filename = str(path)
            raise
        if not path.exists() or os.stat(path).st_ino != os.fstat(descriptor).st_ino:
            # The one before has just come to its end and taken the file along.
            raise ScenarioError(f"{folder}: another build has just ended in this folder; give the command again")
        yield
    finally:
        os.close(descriptor)


def unlock_file(folder: Path) -> None:
    """Remove the file of a lock that is held; nobody looks for it any more."""
    (folder / LOCK).unlink(missing_ok=True)
