"""Runs: nothing is done twice, nothing is lost, and nothing but times depends on who does it."""

import json
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from scenarios.bench.progress import Cost
from scenarios.bench.result import Result
from scenarios.bench.verify import JOURNALS, BenchPlan, kinds_of_request, verify
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.outcome import EstimatorOutcome
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial
from sysid import IOData
from tests.scenarios.bench.few import PERFECT, Few, Here, child_environment

PLAN = BenchPlan((PERFECT,), effort="quick", figures=(Few(),))

KILLED = """
from pathlib import Path
import sys
from scenarios.bench.verify import verify
from scenarios.jobs.executor import LocalProcesses
from tests.scenarios.bench.test_verify import long
if __name__ == "__main__":
    verify(long(Path(sys.argv[1])), Path(sys.argv[2]), LocalProcesses(1))
"""
SOON = 8.0
"""Within which all that a killed run has started is gone, s: far less than any limit of time."""

FAULTY = """
import os, time
import numpy as np
import sysid

calls = []

def good(data, task):
    return sysid.arx(data, task.orders["na"], task.orders["nb"], task.orders["nk"])

def crashing(data, task):
    os._exit(3)

def hanging(data, task):
    time.sleep(60.0)

def stuck(data, task):
    # At its fifth record, as long as there is no file that says not to be.
    mine = os.path.dirname(__file__)
    calls.append(1)
    if len(calls) == 5 and not os.path.exists(os.path.join(mine, "go")):
        open(os.path.join(mine, "here"), "w").close()
        while True:
            pass
    return good(data, task)

def sometimes(data, task):
    if len(data) != 300:
        time.sleep(60.0)
    return good(data, task)

def refusing(data, task):
    if task.orders["na"] != 5:
        raise NotImplementedError
    return good(data, task)

def hungry(data, task):
    return np.ones(2**30)
"""


def journal_of(folder: Path) -> list[dict]:
    (path,) = (folder / JOURNALS).glob("*.sqlite")
    with closing(sqlite3.connect(path)) as database:
        rows = database.execute("SELECT payload FROM entries WHERE key != 'run' ORDER BY key").fetchall()
    times = ("ruler_seconds", "seconds", "peak_bytes")
    return [{k: v for k, v in json.loads(row).items() if k not in times} for (row,) in rows]


def plain(result: Result) -> Result:
    return replace(result, run="", seconds=0.0)


def long(folder: Path) -> BenchPlan:
    stuck = Estimator("stuck", "faulty:stuck", home=str(folder), structure="arx")
    return replace(PLAN, contestants=(stuck,), figures=(Few(draws=4),), limits=Limits(300.0))


@pytest.mark.slow
def test_what_a_killed_run_started_ends_with_it_and_another_goes_on_as_if_nobody_had_disturbed(tmp_path: Path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    (tmp_path / "killed.py").write_text(KILLED)
    command = [sys.executable, str(tmp_path / "killed.py"), str(tmp_path), str(tmp_path / "killed")]
    process = subprocess.Popen(command, env=child_environment())
    begun = time.monotonic()
    while not (tmp_path / "here").exists():
        assert process.poll() is None and time.monotonic() - begun < 60.0
        time.sleep(0.005)
    started = psutil.Process(process.pid).children(recursive=True)
    assert len(started) >= 2  # a worker and the estimator
    process.kill()
    process.wait()
    begun = time.monotonic()
    while left := [one for one in started if one.is_running()]:
        assert time.monotonic() - begun < SOON, left
        time.sleep(0.05)
    before = journal_of(tmp_path / "killed")
    assert len(before) == 4
    (tmp_path / "go").touch()
    (on,) = verify(long(tmp_path), tmp_path / "killed", Here())
    assert all(trial in journal_of(tmp_path / "killed") for trial in before)
    (undisturbed,) = verify(long(tmp_path), tmp_path / "here-too", Here())
    assert on.run != undisturbed.run
    assert repr(plain(on)) == repr(plain(undisturbed))  # NaN is not equal to itself
    assert journal_of(tmp_path / "killed") == journal_of(tmp_path / "here-too")
    assert len(journal_of(tmp_path / "here-too")) == 8
    assert repr(plain(Result.read(tmp_path / "killed" / "stuck.json"))) == repr(plain(on))


@pytest.mark.slow
def test_one_that_only_hangs_is_given_up_and_one_that_sometimes_does_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("scenarios.bench.progress.HANGS", 3)
    (tmp_path / "faulty.py").write_text(FAULTY)
    each = tuple(
        Estimator(name, f"faulty:{name}", home=str(tmp_path), structure="arx") for name in ("hanging", "sometimes")
    )
    said: list[str] = []
    figures = (Few(draws=3, problems=("p1@300", "p3@301")),)
    plan = BenchPlan(each, effort="quick", figures=figures, limits=Limits(0.2))
    hanging, sometimes = verify(plan, tmp_path, Here(), notify=said.append)
    unasked = "hang: given up after 3 hangs in a row: not asked any more"
    assert hanging.outcomes == {"hang": 6}
    assert hanging.reasons == {"hang: no answer within 0.2 s": 3, unasked: 3}
    assert sometimes.outcomes == {"hang": 3, "model": 3}
    assert said == ["hanging: given up after 3 hangs in a row: not asked any more; its other 3 trials count as hangs"]
    # A run that goes on asks nothing of it, and of what it was not wanted for before, anew.
    assert plain(verify(plan, tmp_path, Here(after=0))[0]) == plain(hanging)
    more = replace(plan, figures=(replace(figures[0], draws=4),), contestants=each[:1])
    (longer,) = verify(more, tmp_path, Here())
    assert longer.reasons == {"hang: no answer within 0.2 s": 5, unasked: 3}


def test_what_is_done_is_not_done_again(tmp_path: Path):
    with pytest.raises(KeyboardInterrupt):
        verify(PLAN, tmp_path, Here(after=3))
    rest = Here()
    (first,) = verify(PLAN, tmp_path, rest)
    assert rest.asked == 1
    again = Here(after=0)
    (second,) = verify(PLAN, tmp_path, again)
    assert first == second
    # A longer run is a continuation.
    longer = Here()
    verify(replace(PLAN, figures=(Few(draws=3),)), tmp_path, longer)
    assert longer.asked == 2
    # Of another seed nothing is known, and the journal of the first stays.
    other = Here()
    verify(replace(PLAN, seed=1), tmp_path, other)
    assert other.asked == 4
    assert len(list((tmp_path / JOURNALS).iterdir())) == 2


def test_fewer_records_are_a_part_of_all(tmp_path: Path):
    few, all_of_them = Here(), Here()
    (short,) = verify(replace(PLAN, figures=(Few(draws=3),), records=1), tmp_path, few)
    (whole,) = verify(replace(PLAN, figures=(Few(draws=3),)), tmp_path, all_of_them)
    assert 3 * few.asked == 3 * sum(short.outcomes.values()) == sum(whole.outcomes.values())
    assert few.asked + all_of_them.asked == sum(whole.outcomes.values())
    assert short.effort == f"{PLAN.effort}, at most 1 record of a problem"
    # What the journal has beyond them does not count; where its result does not stand, that can be made anew.
    (tmp_path / "perfect.json").unlink()
    (again,) = verify(replace(PLAN, figures=(Few(draws=3),), records=1), tmp_path, Here(after=0))
    assert again.figures == short.figures


@pytest.mark.parametrize(
    ("less", "says"),
    [
        ({"figures": (Few(),)}, r"figures that this run does not make \(more\)"),
        ({"records": 1}, r"records that this run does not ask \(quick; now quick, at most 1 record of a problem\)"),
        ({"figures": (Few(),), "seed": 1}, "figures that this run does not make"),
    ],
)
def test_a_lesser_run_takes_no_fuller_result_away_and_asks_nothing(tmp_path: Path, less: dict, says: str):
    plan = replace(PLAN, figures=(Few(), Few(name="more")))
    verify(plan, tmp_path, Here())
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    asked = Here(after=0)
    with pytest.raises(ScenarioError, match=says + r".*give another --out"):
        verify(replace(plan, **less), tmp_path, asked)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    # What has as much, or more, takes its place.
    verify(plan, tmp_path, asked)
    verify(replace(plan, records=2), tmp_path, asked)
    (more,) = verify(replace(plan, effort="full"), tmp_path, asked)
    assert Result.read(tmp_path / "perfect.json").effort == more.effort == "full"


@pytest.mark.parametrize("effort", [5, None, "quick, at most " + "9" * 5000 + " records of a problem"])
def test_a_result_whose_effort_is_none_is_replaced(tmp_path: Path, effort: object):
    plan = replace(PLAN, figures=(Few(),))
    verify(plan, tmp_path, Here())
    path = tmp_path / "perfect.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"effort": effort}))
    verify(replace(plan, records=1), tmp_path, Here(after=0))
    assert Result.read(path).effort == "quick, at most 1 record of a problem"


def test_a_run_that_was_interrupted_goes_on_beside_a_lesser_result(tmp_path: Path):
    verify(replace(PLAN, records=1), tmp_path, Here())
    with pytest.raises(KeyboardInterrupt):
        verify(PLAN, tmp_path, Here(after=1))
    assert Result.read(tmp_path / "perfect.json").effort == "quick, at most 1 record of a problem"
    verify(PLAN, tmp_path, Here())
    assert Result.read(tmp_path / "perfect.json").outcomes == {"model": 4}
    # A result that cannot be read keeps nobody from writing one.
    (tmp_path / "perfect.json").write_text(
        (tmp_path / "perfect.json").read_text().replace('"format": 1', '"format": 9')
    )
    verify(replace(PLAN, records=1), tmp_path, Here(after=0))


@pytest.mark.slow
def test_what_is_refused_is_counted_by_family_and_ask(tmp_path: Path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    each = (Estimator("refusing", "faulty:refusing", home=str(tmp_path), structure="arx"),)
    (result,) = verify(replace(PLAN, contestants=each, figures=(Few(problems=("p1@300", "p2@300")),)), tmp_path, Here())
    assert result.outcomes == {"model": 2, "refused": 2}
    assert result.refused == Result.read(tmp_path / "refusing.json").refused == {"p2": 2}
    kinds = kinds_of_request(
        [Trial("p2@300", 0), Trial("p2", 1), Trial("p2", 0, "select"), Trial("twin-nominal-elbow", 0)]
    )
    assert kinds == {"p2": 2, "p2, select": 1, "twin": 1}


@pytest.mark.slow
def test_whatever_estimators_do_is_counted(tmp_path: Path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    kinds = {"good": "model", "crashing": "crash", "hanging": "hang", "hungry": "memory"}
    each = tuple(Estimator(name, f"faulty:{name}", home=str(tmp_path), structure="arx") for name in kinds)
    told: list[Cost] = []
    counted: list[tuple[int, int, float | None]] = []
    plan = BenchPlan(each, effort="quick", figures=(Few(draws=1, problems=("p1@300",)),), limits=Limits(0.5, 2**28))
    results = verify(plan, tmp_path, Here(), announce=told.append, report=lambda *now: counted.append(now))
    for result, kind in zip(results, kinds.values(), strict=True):
        assert result.outcomes == {kind: 1}
        assert result.passed == (kind == "model")
    assert results[0].seconds > 0.0 and results[0].reasons == {}
    assert results[2].reasons == {"hang: no answer within 0.5 s": 1}
    assert (counted[0], counted[-1]) == ((0, 4, None), (4, 4, None))
    assert told == []  # the first record of the only problem was all


def test_what_a_run_costs_is_told_before_it_is_spent(tmp_path: Path):
    told: list[tuple[Cost, int]] = []
    executor = Here(workers=2)
    verify(PLAN, tmp_path, executor, announce=lambda cost: told.append((cost, executor.asked)))
    ((cost, asked),) = told
    assert asked == 2 and cost.requests == 2
    assert cost.wall == pytest.approx(cost.core_seconds / 2)
    assert "2 requests" in str(cost)


def test_an_estimator_that_cannot_be_loaded_ends_a_run_and_leaves_no_journal(tmp_path: Path):
    (tmp_path / "broken.py").write_text("import no_such_module\n")
    broken = Estimator("broken", "broken:good", home=str(tmp_path), structure="oe")
    with pytest.raises(ScenarioError, match="no_such_module"):
        verify(replace(PLAN, contestants=(broken,)), tmp_path, Here())
    assert list((tmp_path / JOURNALS).iterdir()) == []


@pytest.mark.slow
def test_another_estimator_of_the_same_name_takes_nothing_away(tmp_path: Path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    (tmp_path / "other.py").write_text(FAULTY)
    plan = replace(PLAN, figures=(Few(draws=1, problems=("p1@300",)),))
    good, other = (
        Estimator("good", f"{home}:good", home=str(tmp_path), structure="arx") for home in ("faulty", "other")
    )
    verify(replace(plan, contestants=(good,)), tmp_path, Here())
    before = {path: path.read_bytes() for path in tmp_path.rglob("good*")}
    assert len(before) == 2
    with pytest.raises(ScenarioError, match="result of another estimator of the name 'good', 'faulty:good'"):
        verify(replace(plan, contestants=(other,)), tmp_path, Here())
    (tmp_path / "good.json").unlink()
    verify(replace(plan, contestants=(other,)), tmp_path, Here())
    (journal,) = (path for path in before if path.suffix == ".sqlite")
    assert journal.read_bytes() == before[journal]


@pytest.mark.slow
def test_a_sandbox_that_fails_is_an_outcome_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "faulty.py").write_text(FAULTY)
    good = Estimator("good", "faulty:good", home=str(tmp_path), structure="arx")
    ask, asked = EstimatorProcess.ask, []

    def failing(self: EstimatorProcess, data: IOData, task: Task) -> EstimatorOutcome:
        asked.append(self)
        if len(asked) == 2:
            raise RuntimeError("of the bench itself")
        return ask(self, data, task)

    monkeypatch.setattr(EstimatorProcess, "ask", failing)
    (result,) = verify(replace(PLAN, contestants=(good,)), tmp_path, Here())
    assert result.outcomes == {"crash": 1, "model": 3}
    assert result.reasons == {"crash: its process failed: RuntimeError: of the bench itself": 1}
    assert len(set(map(id, asked))) == 2  # it was opened anew


def test_two_runs_do_not_write_one_journal(tmp_path: Path):
    def meanwhile(done: int, total: int, left: float | None) -> None:
        if done == 2:
            with pytest.raises(ScenarioError, match="another process is at work"):
                verify(PLAN, tmp_path, Here())
            tried.append(total)

    tried: list[int] = []
    verify(PLAN, tmp_path, Here(), report=meanwhile)
    assert tried == [4]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"effort": "long"}, "expected one of quick, full"),
        ({"seed": -1}, "expected a whole number"),
        ({"records": 0}, "0 records given, expected 1 or more"),
        ({"contestants": ()}, "no estimator given"),
        ({"contestants": (PERFECT, replace(PERFECT, structure="oe"))}, "of the same name given: perfect"),
    ],
)
def test_plans_that_cannot_be(change: dict, says: str):
    with pytest.raises(ScenarioError, match=says):
        replace(PLAN, **change)


def test_a_seed_is_drawn_for_the_files_of_the_estimators_and_kept_to_resume(tmp_path: Path):
    (tmp_path / "faulty.py").write_text(FAULTY)
    good = Estimator("good", "faulty:good", home=str(tmp_path), structure="arx")
    plan = replace(PLAN, contestants=(good,), seed=None, commands={"good": "hmtb verify faulty:good"})
    with pytest.raises(KeyboardInterrupt):
        verify(plan, tmp_path, Here(after=3))
    rest = Here()
    (first,) = verify(plan, tmp_path, rest)
    assert rest.asked == 1 and first.command == f"hmtb verify faulty:good --seed {first.seed}"
    (elsewhere,) = verify(replace(plan, seed=first.seed), tmp_path / "elsewhere", Here())
    assert repr(elsewhere.figures) == repr(first.figures)  # NaN is not equal to itself
    (tmp_path / "faulty.py").write_text(f"{FAULTY}\n")
    assert verify(plan, tmp_path, Here())[0].seed != first.seed
