"""Files from elsewhere are read in another process, which damage, size and time end."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from sysid import IOData, SysidError, arx, read_netcdf, write_model
from sysid.records import foreign_files, reading_process
from sysid.records.foreign_files import hdf5_contents, hdf5_listing, is_hdf5
from sysid.records.reading_process import UnreadableError, read_apart
from tests.refusals import refused

VALUES = {
    "numbers": np.arange(6.0).reshape(2, 3),
    "single": np.float32(0.1),
    "swapped": np.arange(3, dtype=">i2"),
    "empty": np.empty((0, 3)),
    "texts": np.array(["a", "bcd"]),
    "bytes": np.array([b"a", b"bcd"]),
}


def own_answer(path):
    cells = np.empty((1, 2), object)
    cells[0, 0], cells[0, 1] = VALUES["texts"], 1.0
    return {**VALUES, "columns": np.asfortranarray(VALUES["numbers"]), "cells": cells}


def crash(path):
    os.abort()


def sleep(path):
    threading.Event().wait()


def tell_id_and_sleep(path):
    Path(f"{path}.partial").write_text(str(os.getpid()))
    os.rename(f"{path}.partial", f"{path}.id")
    threading.Event().wait()


def fill(path):
    return np.ones(2**29)


def need(path):
    import no_such_package.inside  # noqa: F401


def object_of(path):
    return np.zeros(2, [("real", "f8"), ("imag", "f8")])


def id_of(path):
    return os.getpid()


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.nc"
    with h5py.File(path, "w") as stored:
        stored["u"] = np.arange(3.0)
    return path


def test_what_is_handed_over_is_the_same_to_the_last_bit(file):
    answer = read_apart(own_answer, file)
    for name, value in VALUES.items():
        assert answer[name].dtype == value.dtype
        np.testing.assert_array_equal(answer[name], value)
    assert isinstance(answer["single"], np.float32)
    assert answer["columns"].flags.f_contiguous
    assert answer["cells"].shape == (1, 2)
    np.testing.assert_array_equal(answer["cells"][0, 0], VALUES["texts"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "says"),
    [
        (crash, "reading it crashed"),
        (sleep, r"reading it did not end within 0\.2 s"),
        (fill, "it takes more than 3 GiB of memory"),
        (object_of, "an array of type .*, expected numbers or texts"),
    ],
)
def test_reading_that_fails_is_an_error_and_the_next_file_is_read(function, says, file, monkeypatch):
    assert len(read_apart(hdf5_listing, file, [], False)) == 1
    with monkeypatch.context() as patch, pytest.raises(UnreadableError, match=says):
        patch.setattr(reading_process, "PATIENCE", 0.2 if function is sleep else 60.0)
        read_apart(function, file)
    (content,) = read_apart(hdf5_contents, file, ["u"], None, False)
    np.testing.assert_array_equal(content["values"], [0.0, 1.0, 2.0])


def test_a_package_that_is_missing_is_named(file):
    message = r"a.nc: reading it needs the package no_such_package: pip install './sysid\[files\]'"
    refused(message, read_apart, need, file)


def test_a_packed_chunk_that_takes_all_memory_is_refused(tmp_path):
    with h5py.File(tmp_path / "packed.nc", "w") as file:
        file.create_dataset("u", 2**27, float, chunks=(2**27,), compression="gzip")
        file["y"] = np.zeros(3)
    refused("packed.nc: .*it takes more than 3 GiB of memory", read_netcdf, tmp_path / "packed.nc")


@pytest.mark.slow
def test_a_process_reads_many_files_and_every_thread_and_fork_has_its_own(file):
    first = read_apart(id_of, file)
    assert read_apart(id_of, file) == first != os.getpid()
    others = []
    thread = threading.Thread(target=lambda: others.append(read_apart(id_of, file)))
    thread.start()
    thread.join()
    assert others != [first]
    script = (
        "import os, sys; from pathlib import Path; from tests.sysid.records.test_reading_process import *\n"
        f"file = Path({str(file)!r}); first = read_apart(id_of, file); pid = os.fork()\n"
        "if not pid:\n    os._exit(read_apart(id_of, file) == first)\n"
        "assert os.wait()[1] == 0; assert read_apart(id_of, file) == first"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_it_ends_with_the_process_that_started_it(file):
    script = (
        "import os, signal; from pathlib import Path; from tests.sysid.records.test_reading_process import *\n"
        f"print(read_apart(id_of, Path({str(file)!r})), flush=True); os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    with pytest.raises(ProcessLookupError):
        for _ in range(100):
            os.kill(int(done.stdout), 0)
            threading.Event().wait(0.1)


def _wait_until(condition):
    for _ in range(100):
        if condition():
            return True
        threading.Event().wait(0.1)
    return False


def _runs(process_id):
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell a process of its parent's end")
@pytest.mark.parametrize("within_a_thread", [False, True])
def test_it_ends_with_the_process_that_started_it_while_it_reads(within_a_thread, file):
    script = (
        "import threading; from pathlib import Path; from tests.sysid.records.test_reading_process import *\n"
        f"read = lambda: read_apart(tell_id_and_sleep, Path({str(file)!r}))\n"
    )
    script += "threading.Thread(target=read).start()" if within_a_thread else "read()"
    told = Path(f"{file}.id")
    with subprocess.Popen([sys.executable, "-c", script]) as starter:
        assert _wait_until(told.exists)
        starter.kill()
    reader = int(told.read_text())
    assert _wait_until(lambda: not _runs(reader))


def test_a_reading_process_outlives_the_end_of_another_thread(file):
    first = read_apart(id_of, file)
    thread = threading.Thread(target=lambda: read_apart(id_of, file))
    thread.start()
    thread.join()
    assert read_apart(id_of, file) == first


def test_interrupted_reading_leaves_no_answer_to_the_next_file(file, monkeypatch):
    decoded = reading_process.decoded

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(reading_process, "decoded", interrupted)
    with pytest.raises(KeyboardInterrupt):
        read_apart(own_answer, file)
    monkeypatch.setattr(reading_process, "decoded", decoded)
    assert [item["name"] for item in read_apart(hdf5_listing, file, [], False)] == ["u"]


def test_files_that_are_missing_or_locked_are_the_systems_matter(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_apart(hdf5_listing, tmp_path / "absent.nc", [], False)


@pytest.mark.parametrize(("before", "expected"), [(0, True), (512, True), (2048, True), (8, False), (1536, False)])
def test_hdf5_is_known_by_its_signature(before, expected, tmp_path):
    (tmp_path / "a").write_bytes(bytes(before) + foreign_files.HDF5_SIGNATURE + bytes(9))
    assert is_hdf5(tmp_path / "a") is expected


@pytest.mark.slow
def test_sysid_reads_without_the_packages_of_other_formats(tmp_path, monkeypatch):
    """MATLAB files of version 5 need SciPy alone."""
    script = (
        "import sys; sys.modules.update(h5py=None, pandas=None, xarray=None)\n"
        "import numpy as np, scipy.io, sysid\n"
        "scipy.io.savemat('a.mat', {'u': np.ones((9, 1)), 'y': np.ones((9, 1)), 'Ts': 0.1})\n"
        "print(len(sysid.read_mat('a.mat').u))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True, stdout=subprocess.PIPE, text=True)
    assert done.stdout == "9\n"


def test_errors_are_sysid_errors(tmp_path):
    (tmp_path / "a.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(900))
    with pytest.raises(SysidError, match=r"^a\.nc: not a NetCDF4 file, or a damaged one \("):
        read_netcdf(tmp_path / "a.nc")


def test_a_working_folder_that_was_deleted_does_not_matter_to_files_elsewhere(file, tmp_path, monkeypatch):
    deleted = tmp_path / "deleted"
    deleted.mkdir()
    monkeypatch.chdir(deleted)
    deleted.rmdir()
    assert [item["name"] for item in read_apart(hdf5_listing, file, [], False)] == ["u"]
    refused("no data file 'a.nc'", read_netcdf, "a.nc")
    model = arx(IOData(np.tile([0.0, 0.0, 1.0, 1.0, 0.0, 1.0], 9), np.arange(54.0), 0.1), 0, 1)
    refused("cannot write a.json: its folder no longer exists", write_model, model, "a.json")
