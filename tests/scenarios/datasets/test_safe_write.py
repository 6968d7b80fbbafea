"""A file is written whole or not at all, and an error names it."""

import errno
import os
from pathlib import Path

import pytest

from scenarios.files import durable_write as safe_write
from scenarios.files.durable_write import remove_partial, sync_folder, write_files, write_text, writing


def test_a_file_that_fails_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "a.txt"
    write_text(path, "µ\n")
    assert path.read_bytes() == "µ\n".encode()
    with pytest.raises(OSError, match="full") as found, writing(path) as stream:
        stream.write(b"new")
        raise OSError(errno.ENOSPC, "full")
    assert found.value.filename == str(path)
    assert path.read_bytes() == "µ\n".encode()
    assert [entry.name for entry in path.parent.iterdir()] == ["a.txt"]


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[str, list[str]]] = []

    def watched(descriptor: int) -> None:
        name = Path(os.readlink(f"/proc/self/fd/{descriptor}")).name
        seen.append((name, sorted(path.name for path in tmp_path.iterdir())))

    if not Path("/proc/self/fd").is_dir():
        pytest.skip("this system does not tell the names of open files")
    monkeypatch.setattr(safe_write.os, "fsync", watched)
    write_files(tmp_path, {"a": b"1", "b": b"2"})
    assert seen == [("a.partial", ["a.partial"]), ("b.partial", ["a", "b.partial"]), (tmp_path.name, ["a", "b"])]


def test_half_files_are_removed_and_others_are_not(tmp_path: Path) -> None:
    write_files(tmp_path, {"a/b/c.nc": b"1"})
    for place in ("x.partial", "a/y.partial", "a/b/c.nc.partial"):
        (tmp_path / place).write_bytes(b"half")
    remove_partial(tmp_path)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["c.nc"]


def test_a_file_system_that_cannot_sync_folders_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(descriptor: int) -> None:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(safe_write.os, "fsync", refused)
    code = errno.EINVAL
    sync_folder(tmp_path)
    code = errno.EIO
    with pytest.raises(OSError, match=os.strerror(errno.EIO)):
        sync_folder(tmp_path)
