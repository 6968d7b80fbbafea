"""Pieces done by the workers of a Dask scheduler: the same as here, wherever the estimator's file lies."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from scenarios.bench import cluster_task
from scenarios.bench.cluster import Cluster, Pieces
from scenarios.bench.cluster_task import DONE, Parcel
from scenarios.bench.measurement import Measurement
from scenarios.bench.run_trials import Runner
from scenarios.bench.work import Bench, Done, Piece, pieces
from scenarios.datasets.cluster_link import LostError
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial

distributed = pytest.importorskip("distributed")
PERFECT = Contestant("perfect", "bench:perfect")
TRIALS = tuple(Trial(name, draw) for name in ("p1@300", "p3@300") for draw in range(6))
MODULE = """
import sysid

def mine(data, task):
    return sysid.arx(data, task.orders["na"], task.orders["nb"], task.orders["nk"])
"""


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    # Its worker is a thread of this process, to which everything travels over the wire all the same.
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


def plain(done: Sequence[Done]) -> list[str]:
    lines = []
    for one in done:
        line = json.loads(one.measured.to_json())
        del line["seconds"], line["ruler_seconds"], line["peak_bytes"]
        lines.append(f"{one.contestant} {json.dumps(line)}")
    return sorted(lines)


def test_a_worker_measures_what_is_measured_here(scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "alone.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    bench = Bench((PERFECT, Contestant("mine", "alone:mine", structure="arx")), Limits(), 7)
    some = pieces([TRIALS, TRIALS[:1]], [(), ()])
    with Runner(bench) as runner:
        here = [done for piece in some for done in runner.run(piece)]
    cluster = Cluster(scheduler, patience=20.0)
    with cluster.crew(bench) as crew:
        there = [*crew(some[:3]), *crew(some[3:])]
    assert plain(there) == plain(here)
    assert {one.measured.kind for one in there} == {"model"} and len(there) == 13
    assert (cluster.workers, cluster.here) == (1, False)


def test_an_estimator_of_ones_own_travels_as_text_others_have_to_be_there(tmp_path: Path):
    (tmp_path / "alone.py").write_text(MODULE)
    mine = Parcel.of(Contestant("mine", "alone:mine", home=str(tmp_path)))
    assert mine.files == {"alone.py": MODULE}
    unpacked = mine.unpacked(tmp_path / "0")
    assert unpacked.home == str(tmp_path / "0") and (tmp_path / "0" / "alone.py").read_text() == MODULE
    installed = Parcel.of(Contestant("installed", "scenarios.estimators.ours:oe"))
    assert installed.files == {} and installed.source
    assert installed.unpacked(tmp_path / "1").home == ""
    with pytest.raises(ScenarioError, match="is another file here"):
        replace(installed, source="0").unpacked(tmp_path / "2")
    program = Parcel.of(Contestant("program", "./run.sh {mat} {task} {model}", program=True, home=str(tmp_path)))
    (tmp_path / "run.sh").write_text("true\n")
    with pytest.raises(ScenarioError, match="is another file here"):
        program.unpacked(tmp_path / "3")


def test_a_worker_of_other_software_ends_the_run(scheduler: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(cluster_task, "strangeness", lambda here, there: ("numpy 0.1 there, 2.0 here",))
    bench = Bench((PERFECT,), Limits(), 0)
    cluster = Cluster(scheduler, patience=20.0)
    with pytest.raises(ScenarioError, match=r"numpy 0\.1 there"), cluster.crew(bench) as crew:
        list(crew(pieces([TRIALS], [()])))


class Sent:
    status = "finished"

    def __init__(self, draws: list[int]) -> None:
        self.draws = draws

    def add_done_callback(self, call: Callable[[Any], None]) -> None:
        call(self)

    def release(self) -> None:
        pass


class Fake:
    def __init__(self, deadly: int) -> None:
        self.lines: list[str] = []
        self.said, self.deadly = self.lines.append, deadly
        self.sent: list[list[int]] = []

    def connect(self) -> "Fake":
        return self

    def workers(self, client: "Fake") -> tuple["Fake", int]:
        return client, 1

    def submit(
        self,
        task: Any,
        parcels: list[dict],
        limits: dict,
        seed: int,
        some: list[tuple[str, int, list]],
        expected: dict[str, str],
        *,
        pure: bool,
    ) -> Sent:
        assert (limits, seed, len(parcels)) == (asdict(Limits()), 5, 1)
        self.sent.append([draw for _, draw, _ in some])
        return Sent(self.sent[-1])

    def answer(self, future: Sent) -> dict[str, Any] | None:
        if future.draws is self.sent[0]:
            raise LostError
        if self.deadly in future.draws:
            return None
        return {DONE: [(0, Measurement(Trial("p1", draw), "crash").to_json(), 0.5) for draw in future.draws]}


def test_what_is_lost_is_done_again_and_what_brings_death_is_named():
    link, counted = Fake(deadly=9), list[int]()
    some = [Piece("p1", draw, (("fit", 0),)) for draw in range(20)]
    run = Pieces(Bench((PERFECT,), Limits(), 5), some, link, counted.append)  # type: ignore[arg-type]
    done = []
    with pytest.raises(ScenarioError, match="p1, record 9: every worker that did it died"):
        for one in run.done():
            done.append(one.measured.trial.draw)
    assert counted == [1]
    assert sorted(done) == [draw for draw in range(20) if draw != 9]
    assert link.sent.count(list(range(8))) == 2
    assert len(link.lines) == 1 and "8 records from p1, record 8 on" in link.lines[0]


@pytest.mark.parametrize("address", ["", "here", "tcp://a", "tcp://a:0", "tcp://a:99999"])
def test_what_is_no_address_is_refused(address: str):
    with pytest.raises(ScenarioError, match="expected the address of a Dask scheduler"):
        Cluster(address)
