"""The folder of a sandbox for the time that it is open, whatever what runs in it does to it."""

import contextlib
import errno
import shutil
import tempfile
from pathlib import Path

from scenarios.files.errors import ScenarioError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
"""What says that nothing can be written any more, by anyone."""


class OwnFolder:
    """A folder, with folders of its own for one request or process each.

    Attributes:
        path: Where it is, once it is made.
    """

    def __init__(self) -> None:
        self.path = Path()

    def make(self) -> None:
        """Make it.

        Raises:
            ScenarioError: It cannot be made.
        """
        try:
            self.path = Path(tempfile.mkdtemp(prefix="hmtb-estimator-"))
        except OSError as error:
            raise ScenarioError(f"no folder for an estimator can be made: {error}") from error

    def new(self, name: str) -> Path:
        """A folder in it, empty; what stands in its place is removed.

        Args:
            name: Its name.

        Raises:
            ScenarioError: What stands there cannot be removed.
        """
        folder = self.path / name
        try:
            if not self.path.is_dir() or self.path.is_symlink():
                _remove(self.path)
            _remove(folder)
            folder.mkdir(parents=True)
        except OSError as error:
            raise ScenarioError(f"a new folder {folder} cannot be made: {error.strerror}") from error
        return folder

    def clear(self, name: str) -> None:
        """Remove a folder in it, as far as that can be done."""
        with contextlib.suppress(OSError):
            _remove(self.path / name)

    def remove(self) -> None:
        """Remove it, as far as that can be done."""
        if self.path != Path():
            with contextlib.suppress(OSError):
                _remove(self.path)


def check_room(error: OSError) -> None:
    """End the bench where an error says that the disk is full: no other request would fare better.

    Raises:
        ScenarioError: It does.
    """
    if error.errno in FULL:
        raise ScenarioError(
            f"the files of a record cannot be written: {error.strerror}; expected room in {tempfile.gettempdir()}, or "
            "in the folder that the variable TMPDIR names"
        ) from error


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
