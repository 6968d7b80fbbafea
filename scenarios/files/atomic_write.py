"""Write a file whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scenarios.files.errors import ScenarioError


def check_place(path: Path) -> None:
    """Refuse a place where no file can stand, before the work for it begins.

    Raises:
        ScenarioError: There is a folder of that name.
    """
    if path.is_dir():
        raise ScenarioError(f"cannot write {path}: it is a folder; expected a file or nothing there")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write under a temporary name, then rename: whoever looks finds the old file or the new one.

    Args:
        path: The file.

    Yields:
        The temporary name; if the work inside fails, nothing of it stays and the old file does.

    Raises:
        ScenarioError: There is a folder of that name.
        OSError: The file cannot be written.
    """
    check_place(path)
    partial = path.with_name(path.name + ".partial")
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, text: str) -> None:
    """Write a text; whoever looks finds the old file or the new one.

    Args:
        path: The file.
        text: Its content, written as UTF-8.

    Raises:
        ScenarioError: There is a folder of that name.
        OSError: The file cannot be written.
    """
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
