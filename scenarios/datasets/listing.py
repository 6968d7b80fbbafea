"""The files of a data set as catalogues list them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.datasets.layout import LOCK, MANIFEST, SUMS
from scenarios.files.hashes import bytes_hash, file_hash

MOST_LISTED = 1000
"""Files that a catalogue lists one by one; of more it names the folders, and SHA256SUMS has every file."""

NETCDF = "application/x-netcdf"
"""Media type of the records."""

MEDIA = {
    ".nc": NETCDF,
    ".csv": "text/csv",
    ".json": "application/json",
    ".toml": "application/toml",
    ".md": "text/markdown",
    ".cff": "application/yaml",
    ".parquet": "application/vnd.apache.parquet",
}
"""Media types by ending; other files are plain text."""


@dataclass(frozen=True)
class Listed:
    """A file.

    Attributes:
        path: Its place in the folder.
        size: In bytes.
        sha256: Its hash.
    """

    path: str
    size: int
    sha256: str

    @property
    def suffix(self) -> str:
        """Ending of its name."""
        return Path(self.path).suffix

    @property
    def media(self) -> str:
        """Its media type."""
        return MEDIA.get(self.suffix, "text/plain")


def file_paths(folder: Path, *, without: Sequence[str] = ()) -> list[str]:
    """Places of the files of a data set in order, but for its checksums, the notes of the build and those given.

    Args:
        folder: That of the data set.
        without: Places to leave out.
    """
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(p for p in found if p not in (SUMS, MANIFEST, LOCK, *without) and not p.endswith(".partial"))


def listed(folder: Path, path: str) -> Listed:
    """A file on the disk."""
    return Listed(path, (folder / path).stat().st_size, file_hash(folder / path))


def listed_text(path: str, text: str) -> Listed:
    """A file that is yet to be written."""
    content = text.encode()
    return Listed(path, len(content), bytes_hash(content))
