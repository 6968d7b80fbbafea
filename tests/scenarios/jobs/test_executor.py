"""Executors lose no batch: dead workers are replaced, and items that kill them are named when all else is done."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import psutil
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import DeadWorkerError, Executor, LocalProcesses, LostError
from tests.scenarios.jobs import tasks

ROOT = Path(__file__).parents[3]


class Fake(Executor[int]):
    """Loses the first batch, and its workers die of one of the items."""

    def __init__(self, deadly: int, report: Callable[[str], None]) -> None:
        super().__init__(report)
        self.deadly, self.sent = deadly, list[tuple[int, ...]]()

    def _room(self) -> int:
        return 2

    def _submit(self, task: Callable[..., Any], shared: Any, batch: tuple[int, ...]) -> int:
        self.sent.append(batch)
        return len(self.sent) - 1

    def _finished(self, running: Collection[int]) -> Collection[int]:
        return [next(iter(running))]

    def _results(self, handle: int) -> Iterable[int]:
        if handle == 0:
            raise LostError
        if self.deadly in self.sent[handle]:
            raise DeadWorkerError
        return tasks.double(1, self.sent[handle])

    def _close(self) -> None:
        pass


def test_lost_batches_run_again_and_deadly_ones_are_split() -> None:
    lines, results = list[str](), list[int]()
    with Fake(4, lines.append) as fake, pytest.raises(ScenarioError) as refusal:
        results += fake.run(tasks.double, 1, [(0,)])
        assert fake.sent == [(0,), (0,)]
        for result in fake.run(tasks.double, 1, [(0, 1, 2), (3, 4, 5), (6,)], name="record {}".format, items="records"):
            results.append(result)
    assert sorted(results) == [0, 0, 1, 2, 3, 5, 6]
    assert str(refusal.value).startswith(
        "record 4: every worker that ran it died; its memory may be too small. All oth"
    )
    assert "run the command again to resume" in str(refusal.value)
    assert (
        lines == ["3 records from record 3 on killed their workers; they run one by one"] and fake.sent.count((4,)) == 2
    )


def test_a_batch_whose_process_died_runs_again_and_a_deadly_item_is_named(tmp_path: Path) -> None:
    results: list[str] = []
    with LocalProcesses(2) as executor:
        assert sorted(executor.run(tasks.mortal, str(tmp_path), [("a",), ("once", "b"), ("c",)])) == [
            "a",
            "b",
            "c",
            "once",
        ]
        with pytest.raises(ScenarioError, match=r"^always: every worker that ran it died"):
            results.extend(executor.run(tasks.mortal, str(tmp_path), [("d", "always"), ("e",)]))
        with pytest.raises(ValueError, match="of the worker, f"):
            list(executor.run(tasks.wrong, None, [("f",)]))
        assert list(executor.run(tasks.double, 3, [(1, 2)])) == [3, 6]


def test_processes_stay_and_close_what_they_have_opened(tmp_path: Path) -> None:
    with LocalProcesses(1) as executor:
        pids = {
            *executor.run(tasks.opened, str(tmp_path), [("a", "b")]),
            *executor.run(tasks.opened, str(tmp_path), [("c",)]),
        }
    assert len(pids) == 1
    assert sorted(path.name.partition("-")[0] for path in tmp_path.iterdir()) == ["closed", "opened"]


def test_an_interrupted_run_ends_its_workers(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), LocalProcesses(2) as executor:
        for _ in executor.run(tasks.opened, str(tmp_path), [("a",), ("hang",)]):
            while len(list(tmp_path.glob("opened-*"))) < 2:
                sleep(0.01)
            raise KeyboardInterrupt
    assert len(list(tmp_path.glob("closed-*"))) == 2
    assert not any(psutil.pid_exists(int(path.name.partition("-")[2])) for path in tmp_path.iterdir())


ORPHANED = """
import sys
from scenarios.jobs.executor import LocalProcesses
from tests.scenarios.jobs import tasks

if __name__ == "__main__":
    with LocalProcesses(1) as executor:
        list(executor.run(tasks.opened, sys.argv[1], [("hang",)]))
"""


def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    (tmp_path / "main.py").write_text(ORPHANED)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "main.py", tmp_path], env=environment, stderr=subprocess.DEVNULL
    )
    end = monotonic() + 60.0
    while not list(tmp_path.glob("opened-*")) and monotonic() < end:
        sleep(0.05)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    while not list(tmp_path.glob("closed-*")) and monotonic() < end:
        sleep(0.05)
    assert len(list(tmp_path.glob("closed-*"))) == 1


def test_no_workers_are_refused() -> None:
    with pytest.raises(ScenarioError, match="workers must be 1 or more, given 0"):
        LocalProcesses(0)
