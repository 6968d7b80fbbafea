"""What an estimator may send, write or leave behind that is worse than wrong."""

import errno
import json
import os
import struct
import sys
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

import numpy as np
import pytest

import sysid
from scenarios.estimators import program_sandbox, shared_memory_left
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.model_file import MOST_JSON, find_model, read_model_numbers
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.own_folder import OwnFolder
from scenarios.estimators.python_sandbox import _told
from scenarios.estimators.sandbox import open_sandbox
from scenarios.estimators.task import Task
from scenarios.estimators.wire import WireError, pack, unpack
from scenarios.files.errors import ScenarioError

REPLY = {"kind": "returned", "why": "", "seconds": 0.1, "wall": 0.1, "peak_bytes": 1}


def forged(*shapes: list[int], body: bytes = b"") -> bytes:
    head = json.dumps({"fields": {}, "arrays": [[f"x{n}", shape] for n, shape in enumerate(shapes)]}).encode()
    return struct.pack("<4sIQ", b"hmtb", len(head), len(body)) + head + body


@pytest.mark.parametrize(
    "message",
    [
        forged([0, 10**30]),
        forged([0, 2**40, 2**40]),
        forged([0, 2**20, 2**20]),
        forged([1] * 70, body=bytes(8)),
        forged([-1]),
        forged([True], body=bytes(8)),
        forged(*([0] for _ in range(65))),
    ],
)
def test_shapes_that_no_array_has_are_no_message(message: bytes) -> None:
    with pytest.raises(WireError):
        unpack(message)


def test_arrays_without_numbers_are_a_message() -> None:
    _, arrays = unpack(pack({}, {"A": np.zeros((0, 3)), "B": np.ones((1,) * 8), "C": np.zeros(())}))
    assert [arrays[name].shape for name in "ABC"] == [(0, 3), (1,) * 8, ()]


@pytest.mark.parametrize("change", [{"seconds": float("nan")}, {"seconds": -1.0}, {"wall": -1.0}, {"peak_bytes": -1}])
def test_times_that_cannot_be_are_refused(change: dict[str, float]) -> None:
    assert _told(REPLY) == REPLY
    with pytest.raises(WireError, match="negative or no numbers"):
        _told(REPLY | change)


@pytest.mark.parametrize("number", ["[" * 9 + "1" + "]" * 9, "[" * 900 + "]" * 900])
def test_texts_that_are_no_numbers_are_malformed(number: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(f'{{"dt": 0.1, "num": {number}}}')
    with pytest.raises(NoModelError) as caught:
        read_model_numbers(path)
    assert caught.value.kind == "malformed"


@pytest.mark.parametrize("number", ["1" + "0" * 400, "1" + "0" * 5000, "1e400"])
def test_numbers_beyond_all_floats_are_infinite(number: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(f'{{"dt": 0.1, "num": [0.5, {number}]}}')
    assert np.isinf(read_model_numbers(path)["num"][1])


def test_texts_that_are_too_long_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    with path.open("wb") as file:
        file.truncate(MOST_JSON + 1)
    with pytest.raises(NoModelError, match="expected a model of at most"):
        find_model(tmp_path)


def test_a_folder_that_was_taken_away_is_made_anew() -> None:
    folder = OwnFolder()
    folder.make()
    (folder.new("1") / "left").touch()
    assert not list(folder.new("1").iterdir())
    folder.remove()
    assert folder.new("2").is_dir()
    folder.remove()
    folder.path.touch()
    assert folder.new("3").is_dir()
    folder.clear("3")
    (folder.path / "3").symlink_to("/")
    assert not folder.new("3").is_symlink()
    folder.remove()
    assert not folder.path.exists()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_full_disk_ends_the_bench_in_words(
    number: int, data: sysid.IOData, task: Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(program_sandbox, "write_task", fails)
    with open_sandbox(Contestant("any", "true {csv} {model}", program=True), Limits()) as sandbox:
        if number == errno.ENOSPC:
            with pytest.raises(ScenarioError, match=r"No space left on device; expected room in"):
                sandbox.ask(data, task)
        else:
            assert sandbox.ask(data, task).kind == "error"


def test_shared_memory_that_nobody_uses_is_removed() -> None:
    memory = SharedMemory(create=True, size=4096)
    resource_tracker.unregister(memory._name, "shared_memory")
    assert memory.name in shared_memory_left.held([os.getpid()])
    shared_memory_left.remove({memory.name})
    assert memory.name in shared_memory_left.names()
    memory.close()
    shared_memory_left.remove({memory.name})
    assert memory.name not in shared_memory_left.names()


def test_memory_of_what_has_left_its_session_counts(data: sysid.IOData, task: Task) -> None:
    """Also where its parent is gone, and nothing in its environment tells where it came from."""
    eats = "import time; held = b'1' * 2**28; time.sleep(99)"
    parent = (
        "import os, subprocess, sys, time\n"
        f"subprocess.Popen([sys.executable, '-S', '-c', {eats!r}], env={{}}, start_new_session=True) if os.fork() == 0 "
        "else time.sleep(99)"
    )
    with open_sandbox(
        Contestant("eater", f"{sys.executable} -S eater.py {{csv}} {{model}}", program=True), Limits(memory_bytes=2**27)
    ) as sandbox:
        script = sandbox._folder.path / "eater.py"
        script.write_text(parent)
        sandbox._words[2] = str(script)
        got = sandbox.ask(data, task)
    assert (got.kind, got.why) == ("memory", "more than 128 MiB")
