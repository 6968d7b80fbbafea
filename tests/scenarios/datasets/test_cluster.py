"""Data sets built by the workers of a Dask scheduler."""

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from scenarios.datasets import cluster_link
from scenarios.datasets.build import build
from scenarios.datasets.cluster import Chunks, Cluster
from scenarios.datasets.cluster_link import Link, LostError
from scenarios.datasets.cluster_task import MADE
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError

distributed = pytest.importorskip("distributed")
ROOT = Path(__file__).parents[3]


@contextmanager
def workers(address: str, count: int) -> Iterator[None]:
    """Worker processes without the nannies that would start them again."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-nanny", "--no-dashboard"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    started = [
        subprocess.Popen([*command, "--nthreads", "1"], env=environment, stderr=subprocess.DEVNULL)
        for _ in range(count)
    ]
    try:
        yield
    finally:
        for one in started:
            one.kill()
            one.wait()


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as cluster:
        yield cluster.scheduler_address


def test_one_thread_two_threads_and_two_workers_make_the_same_bits(
    tiny: Path, tiny_spec: DataSetSpec, tmp_path: Path, scheduler: str
):
    said: list[str] = []
    with workers(scheduler, 2):
        on_workers = build(
            tiny_spec, tmp_path / "workers", rows=1, executor=Cluster(scheduler, patience=60.0, said=said.append)
        )
    two_threads = build(tiny_spec, tmp_path / "threads", workers=2)
    expected = open_data_set(tiny).hash
    assert (two_threads.hash, on_workers.hash) == (expected, expected)
    for path in sorted(tiny.rglob("*.nc")):
        assert (on_workers.path / path.relative_to(tiny)).read_bytes() == path.read_bytes()
    # The workers are started with the build, so that it has to wait for them; the first to come is enough.
    waited = [line.partition(" at ")[0] for line in said]
    assert waited in ([], ["the scheduler"], ["the scheduler", "1 workers"], ["the scheduler", "2 workers"])


def test_a_scheduler_that_nobody_runs_is_said_within_seconds(tiny_spec: DataSetSpec, tmp_path: Path):
    with pytest.raises(ScenarioError, match=r"no Dask scheduler answers at '.*' within 0.5 s .*; expected an"):
        build(tiny_spec, tmp_path, executor=Cluster("tcp://127.0.0.1:1", patience=0.5))


@pytest.mark.parametrize(
    "address", ["", "junk", "junk:1", "http://a:1", "tcp://a", "tcp://a:0", "tcp://a:99999", "tcp://:1"]
)
def test_what_is_no_address_is_refused_before_anything_is_made(address: str):
    with pytest.raises(ScenarioError, match="expected the address of a Dask scheduler"):
        Cluster(address)


@pytest.mark.parametrize(
    ("greeting", "says"), [(b"", "timed out"), (b"HTTP/1.0 400\r\n\r\n", "is no Dask scheduler"), (None, "hangs up")]
)
def test_what_listens_but_is_no_scheduler_is_refused_within_seconds(
    monkeypatch: pytest.MonkeyPatch, greeting: bytes | None, says: str
):
    monkeypatch.setattr(cluster_link, "FIRST", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(2.0)

        def answer() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                if greeting is None:
                    connection.close()
                else:
                    connection.sendall(greeting)
                    held.append(connection)

        held: list[socket.socket] = []
        threading.Thread(target=answer, daemon=True).start()
        link = Link(f"tcp://127.0.0.1:{server.getsockname()[1]}", 0.2, lambda _: None)
        with pytest.raises(ScenarioError, match=rf"no Dask scheduler answers at .*{says}"), link:
            link.connect()
        for connection in held:
            connection.close()


def test_workers_that_never_come_end_a_build_that_can_go_on(tiny_spec: DataSetSpec, tmp_path: Path, scheduler: str):
    said: list[str] = []
    with pytest.raises(ScenarioError, match=r"has no workers; waited for 0.5 s; .*the same command goes on"):
        build(tiny_spec, tmp_path, executor=Cluster(scheduler, patience=0.5, said=said.append))
    assert len(said) == 1 and "waiting up to" in said[0]
    assert (tmp_path / "tiny-v1.unfinished" / "manifest.jsonl").is_file()


class Sent:
    """A chunk that was sent, as Dask's future of it."""

    status = "finished"

    def __init__(self, numbers: list[int]) -> None:
        self.numbers = tuple(numbers)

    def add_done_callback(self, call: Callable[[Any], None]) -> None:
        call(self)

    def release(self) -> None:
        pass


class Fake:
    """Link and client at once: loses the first answer, and brings death to all that runs one of the experiments."""

    def __init__(self, deadly: int) -> None:
        self.lines: list[str] = []
        self.said, self.deadly = self.lines.append, deadly
        self.sent: list[tuple[int, ...]] = []

    def connect(self) -> "Fake":
        return self

    def workers(self, client: "Fake") -> tuple["Fake", int]:
        return client, 1

    def submit(self, task: Any, spec: str, numbers: list[int], expected: dict[str, str], *, pure: bool) -> Sent:
        self.sent.append(tuple(numbers))
        return Sent(numbers)

    def answer(self, future: Sent) -> dict[str, Any] | None:
        if len(self.sent) <= 2 and future.numbers == self.sent[0]:
            self.sent.append(())
            raise LostError
        if self.deadly in future.numbers:
            return None
        return {MADE: [{"number": number, "about": {}} for number in future.numbers]}


def test_an_experiment_that_brings_death_is_named_and_all_others_are_made(tiny_spec: DataSetSpec):
    plan = DataSetPlan(replace(tiny_spec, records=(replace(tiny_spec.records[0], repeats=4), *tiny_spec.records[1:])))
    link = Fake(deadly=4)
    made: list[int] = []
    with pytest.raises(ScenarioError, match=rf"^{plan[4].name}: every worker that did it died"):
        for one in Chunks(plan, iter([(0, 1, 2), (3, 4, 5), (6, 7, 8)]), link).done():  # type: ignore[arg-type]
            made.append(one.number)
    assert sorted(made) == [0, 1, 2, 3, 5, 6, 7, 8]
    assert {(3,), (4,), (5,)} <= set(link.sent)
    assert len(link.lines) == 1 and "one by one" in link.lines[0]


def test_a_chunk_whose_answer_is_lost_is_sent_anew(tiny_spec: DataSetSpec):
    link = Fake(deadly=-1)
    found = [one.number for one in Chunks(DataSetPlan(tiny_spec), iter([(0,), (1, 2)]), link).done()]  # type: ignore[arg-type]
    assert sorted(found) == [0, 1, 2]
    assert link.sent.count((0,)) == 2 and link.sent.count((1, 2)) == 1
