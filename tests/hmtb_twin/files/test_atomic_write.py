"""A file is written whole or not at all, and errors name it."""

import errno
import os
import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from hmtb_twin.files import atomic_write
from hmtb_twin.files.atomic_write import check_place, remove_partial, replacing, sync, write_files, write_whole
from scenarios.report.figures import save_figure
from tests.refusals import refused


@pytest.mark.parametrize("durable", [False, True])
def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path, durable):
    path = tmp_path / "report.html"
    write_whole(path, "µ\n", durable=durable)
    with pytest.raises(UnicodeEncodeError):
        write_whole(path, "second \udc80", durable=durable)
    with pytest.raises(OSError, match="full") as refusal, replacing(path, durable=durable) as partial:
        partial.write_bytes(b"new")
        raise OSError(errno.ENOSPC, "full")
    assert refusal.value.filename == str(path)
    assert path.read_bytes() == "µ\n".encode()
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_in_the_place_of_a_file_is_refused(tmp_path):
    path, message = tmp_path / "report.html", r"cannot write \S+report\.html: it is a folder"
    path.mkdir()
    refused(message, check_place, path)
    refused(message, write_whole, path, "")
    refused(message, write_files, tmp_path, {path.name: b""})


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="this system does not tell the names of open files")
def test_durable_files_are_on_the_disk_before_they_have_their_name(tmp_path, monkeypatch):
    seen = []

    def plain(name):
        return re.sub(r"\.[0-9a-f]{8}\.partial$", ".partial", name)

    def watched(descriptor):
        name = Path(os.readlink(f"/proc/self/fd/{descriptor}")).name
        seen.append((plain(name), sorted(plain(path.name) for path in tmp_path.iterdir())))

    monkeypatch.setattr(atomic_write.os, "fsync", watched)
    write_files(tmp_path, {"a": b"1", "b": b"2"})
    assert seen == [("a.partial", ["a.partial"]), ("b.partial", ["a", "b.partial"]), (tmp_path.name, ["a", "b"])]
    seen.clear()
    write_whole(tmp_path / "c", "3", durable=True)
    assert seen == [("c.partial", ["a", "b", "c.partial"]), (tmp_path.name, ["a", "b", "c"])]


def test_several_that_write_one_file_do_not_disturb_each_other(tmp_path):
    path = tmp_path / "log.nc"
    with atomic_write.replacing(path) as first, atomic_write.replacing(path) as second:
        first.write_bytes(b"first")
        second.write_bytes(b"second")
    assert path.read_bytes() == b"first"  # the last rename
    assert [one.name for one in tmp_path.iterdir()] == ["log.nc"]


def test_a_planted_link_is_not_written_through(tmp_path, monkeypatch):
    monkeypatch.setattr(atomic_write.secrets, "token_hex", lambda _: "00000000")
    secret = tmp_path / "secret"
    secret.write_bytes(b"before")
    (tmp_path / "log.nc.00000000.partial").symlink_to(secret)
    with pytest.raises(FileExistsError):
        write_whole(tmp_path / "log.nc", "x")
    assert secret.read_bytes() == b"before"


def test_partial_files_are_removed_and_others_are_not(tmp_path):
    write_files(tmp_path, {"a/b/c.nc": b"1"})
    for place in ("x.partial", "a/y.partial", "a/b/c.nc.partial"):
        (tmp_path / place).write_bytes(b"half")
    remove_partial(tmp_path)
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["c.nc"]


def test_a_file_system_that_cannot_flush_folders_is_no_obstacle(tmp_path, monkeypatch):
    def failing(descriptor):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(atomic_write.os, "fsync", failing)
    code = errno.EINVAL
    sync(tmp_path)
    code = errno.EIO
    with pytest.raises(OSError, match=os.strerror(errno.EIO)):
        sync(tmp_path)


@pytest.mark.parametrize(("name", "begins"), [("a.svg", b"<?xml"), ("a.png", b"\x89PNG"), ("a.PDF", b"%PDF")])
def test_figures_too_are_whole_or_as_they_were(tmp_path, name, begins):
    class Torn(Figure):
        def savefig(self, fname, **settings):
            super().savefig(fname, **settings)
            raise OSError("disk full")

    path = tmp_path / name
    save_figure(Figure((1, 1)), path)
    first = path.read_bytes()
    assert first.startswith(begins)
    with pytest.raises(OSError, match="disk full"):
        save_figure(Torn((2, 2)), path)
    assert path.read_bytes() == first
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
