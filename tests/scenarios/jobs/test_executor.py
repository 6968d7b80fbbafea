"""Executors lose no batch: dead workers are replaced, and items that kill them are named when all else is done."""

import subprocess
import sys
from time import monotonic, sleep

import psutil
import pytest

from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import DeadWorkerError, Executor, LocalProcesses, LostError
from tests.benchmarks.tables import environment
from tests.refusals import refused
from tests.scenarios.jobs import tasks


class Fake(Executor[int]):
    """Loses the first batch, and its workers die of one of the items."""

    def __init__(self, deadly, report):
        super().__init__(report)
        self.deadly, self.sent = deadly, []

    def _room(self):
        return 2

    def _submit(self, task, shared, batch):
        self.sent.append(batch)
        return len(self.sent) - 1

    def _finished(self, running):
        return [next(iter(running))]

    def _results(self, handle):
        if handle == 0:
            raise LostError
        if self.deadly in self.sent[handle]:
            raise DeadWorkerError
        return tasks.double(1, self.sent[handle])

    def _close(self):
        pass


def test_lost_batches_run_again_and_deadly_ones_are_split():
    lines, results = [], []
    with Fake(4, lines.append) as fake, pytest.raises(ScenarioError) as refusal:
        results += fake.run(tasks.double, 1, [(0,)])
        assert fake.sent == [(0,), (0,)]
        for result in fake.run(tasks.double, 1, [(0, 1, 2), (3, 4, 5), (6,)], name="record {}".format, items="records"):
            results.append(result)
    assert sorted(results) == [0, 0, 1, 2, 3, 5, 6]
    message = str(refusal.value)
    assert message.startswith("record 4: every worker that ran it died; its memory may be too small. All other")
    assert "run the command again to resume" in message
    assert lines == ["3 records from record 3 on killed their workers; they run one by one"]
    assert fake.sent.count((4,)) == 2


def test_a_batch_whose_process_died_runs_again_and_a_deadly_item_is_named(tmp_path):
    with LocalProcesses(2) as executor:
        done = sorted(executor.run(tasks.mortal, str(tmp_path), [("a",), ("once", "b"), ("c",)]))
        assert done == ["a", "b", "c", "once"]
        with pytest.raises(ScenarioError, match=r"^always: every worker that ran it died"):
            list(executor.run(tasks.mortal, str(tmp_path), [("d", "always"), ("e",)]))
        with pytest.raises(ValueError, match="of the worker, f"):
            list(executor.run(tasks.wrong, None, [("f",)]))
        assert list(executor.run(tasks.double, 3, [(1, 2)])) == [3, 6]


def test_processes_stay_and_close_what_they_have_opened(tmp_path):
    with LocalProcesses(1) as executor:
        first, second = (list(executor.run(tasks.opened, str(tmp_path), [batch])) for batch in (("a", "b"), ("c",)))
    assert len({*first, *second}) == 1
    assert sorted(path.name.partition("-")[0] for path in tmp_path.iterdir()) == ["closed", "opened"]


def test_an_interrupted_run_ends_its_workers(tmp_path):
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


def test_workers_end_with_their_parent(tmp_path):
    (tmp_path / "main.py").write_text(ORPHANED)
    words = [sys.executable, tmp_path / "main.py", tmp_path]
    parent = subprocess.Popen(words, env=environment(), stderr=subprocess.DEVNULL)
    end = monotonic() + 60.0
    for mark in ("opened-*", "closed-*"):
        while not list(tmp_path.glob(mark)) and monotonic() < end:
            sleep(0.05)
        parent.kill()
        parent.wait()
    assert len(list(tmp_path.glob("closed-*"))) == 1


@pytest.mark.parametrize("workers", [0, 10**9])
def test_no_workers_and_absurdly_many_are_refused(workers):
    refused(f"workers must be 1 to 1024, given {workers}", LocalProcesses, workers)
