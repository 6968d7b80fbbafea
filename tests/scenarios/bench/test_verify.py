"""Runs: nothing is done twice, nothing is lost, and nothing but times depends on who does it."""

import json
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace

import psutil
import pytest

from scenarios.bench.claimed_accuracy import NormalisedError
from scenarios.bench.consistency import NoiseFreeRecovery
from scenarios.bench.metrics import Reliability, Speed
from scenarios.bench.result import Result
from scenarios.bench.verify import JOURNALS, BenchPlan, kinds_of_request, verify
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.runner import EstimatorProcess
from scenarios.files.errors import ScenarioError
from scenarios.problems.trial import Trial
from tests.benchmarks.faulty_estimators import FAULTY
from tests.benchmarks.planted_faults import PLANTED_FAULTS
from tests.benchmarks.tables import environment
from tests.scenarios.bench.few import PERFECT, Few, Here

PLAN = BenchPlan((PERFECT,), effort="quick", metrics=(Few(),))
SINGLE = replace(PLAN, metrics=(Few(draws=1, problems=("p1@300",)),))

KILLED = """
from pathlib import Path
import sys
from scenarios.bench.verify import verify
from scenarios.jobs.executor import LocalProcesses
from tests.scenarios.bench.test_verify import long
if __name__ == "__main__":
    verify(long(Path(sys.argv[1])), Path(sys.argv[2]), LocalProcesses(1))
"""
SOURCE = """
import os, time
import sysid

calls = []

def good(data, task):
    return sysid.arx(data, task.orders["na"], task.orders["nb"], task.orders["nk"])

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
"""


def journal_of(folder):
    (path,) = (folder / JOURNALS).glob("*.sqlite")
    with closing(sqlite3.connect(path)) as database:
        rows = database.execute("SELECT payload FROM entries WHERE key != 'run' ORDER BY key").fetchall()
    times = ("ruler_seconds", "seconds", "peak_bytes")
    return [{k: v for k, v in json.loads(row).items() if k not in times} for (row,) in rows]


def plain(result):
    return repr(replace(result, run="", seconds=0.0))  # NaN is not equal to itself


def long(folder):
    stuck = Estimator("stuck", "faulty:stuck", home=str(folder), structure="arx")
    return replace(PLAN, estimators=(stuck,), metrics=(Few(draws=4),), limits=Limits(300.0))


@pytest.fixture
def faulty(tmp_path):
    """Writes estimators of every kind, and makes one of them."""
    (tmp_path / "faulty.py").write_text(SOURCE)
    return lambda name: Estimator(name, f"faulty:{name}", home=str(tmp_path), structure="arx")


@pytest.mark.reliability
def test_what_a_killed_run_started_ends_with_it_and_another_goes_on_as_if_nobody_had_disturbed(tmp_path):
    (tmp_path / "faulty.py").write_text(SOURCE)
    (tmp_path / "killed.py").write_text(KILLED)
    command = [sys.executable, str(tmp_path / "killed.py"), str(tmp_path), str(tmp_path / "killed")]
    process = subprocess.Popen(command, env=environment())
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
        assert time.monotonic() - begun < 8.0, left  # far less than any limit of time
        time.sleep(0.05)
    before = journal_of(tmp_path / "killed")
    assert len(before) == 4
    (tmp_path / "go").touch()
    (on,) = verify(long(tmp_path), tmp_path / "killed", Here())
    assert all(trial in journal_of(tmp_path / "killed") for trial in before)
    (undisturbed,) = verify(long(tmp_path), tmp_path / "here-too", Here())
    assert on.run != undisturbed.run
    assert plain(on) == plain(undisturbed)
    assert journal_of(tmp_path / "killed") == journal_of(tmp_path / "here-too")
    assert len(journal_of(tmp_path / "here-too")) == 8
    assert plain(Result.read(tmp_path / "killed" / "stuck.json")) == plain(on)


@pytest.mark.reliability
def test_one_that_only_hangs_is_given_up_and_one_that_sometimes_does_is_not(tmp_path, faulty, monkeypatch):
    monkeypatch.setattr("scenarios.bench.run_progress.HANGS", 2)
    notes = []
    few = Few(draws=2, problems=("p1@300", "p3@301"))
    plan = replace(PLAN, estimators=(faulty("hanging"), faulty("sometimes")), metrics=(few,), limits=Limits(0.2))
    hanging, sometimes = verify(plan, tmp_path, Here(), notify=notes.append)
    unasked = "hang: given up after 2 hangs in a row: not asked any more"
    assert hanging.outcomes == {"hang": 4}
    assert hanging.reasons == {"hang: no answer within 0.2 s": 2, unasked: 2}
    assert sometimes.outcomes == {"hang": 2, "model": 2}
    words = "hanging: given up after 2 hangs in a row: not asked any more; its other 2 trials count as hangs"
    assert [note for note in notes if "still to do" not in note] == [words]
    # A run that goes on asks nothing of it, and of what it was not wanted for before, anew.
    assert plain(verify(plan, tmp_path, Here(after=0))[0]) == plain(hanging)
    more = replace(plan, metrics=(replace(few, draws=3),), estimators=plan.estimators[:1])
    (longer,) = verify(more, tmp_path, Here())
    assert longer.reasons == {"hang: no answer within 0.2 s": 4, unasked: 2}


def test_what_is_done_is_not_done_again(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        verify(PLAN, tmp_path, Here(after=3))
    longer = replace(PLAN, metrics=(Few(draws=3),))
    results = []
    # The rest; nothing; what a longer run has more; all of another seed, beside which the journal of the first stays.
    for plan, asked in ((PLAN, 1), (PLAN, 0), (longer, 2), (replace(longer, seed=1), 6)):
        executor = Here()
        results += verify(plan, tmp_path, executor)
        assert executor.asked == asked
    assert results[0] == results[1]
    assert len(list((tmp_path / JOURNALS).iterdir())) == 2


def test_fewer_records_are_a_part_of_all(tmp_path):
    few, every = Here(), Here()
    plan = replace(PLAN, metrics=(Few(draws=3),))
    (short,) = verify(replace(plan, records=1), tmp_path, few)
    assert short.effort == f"{PLAN.effort}, at most 1 record of a problem"
    with pytest.raises(KeyboardInterrupt):
        verify(plan, tmp_path, Here(after=1))
    assert Result.read(tmp_path / "perfect.json").effort == short.effort
    (whole,) = verify(plan, tmp_path, every)
    assert 3 * few.asked == 3 * sum(short.outcomes.values()) == sum(whole.outcomes.values())
    assert few.asked + 1 + every.asked == sum(whole.outcomes.values())
    assert Result.read(tmp_path / "perfect.json").outcomes == whole.outcomes
    # What the journal has beyond them does not count; where its result does not stand, that can be made anew.
    (tmp_path / "perfect.json").unlink()
    (again,) = verify(replace(plan, records=1), tmp_path, Here(after=0))
    assert again.metrics == short.metrics


@pytest.mark.parametrize(
    ("less", "message"),
    [
        ({"metrics": (Few(),)}, r"figures that this run does not make \(more\)"),
        ({"records": 1}, r"records that this run does not ask \(quick; now quick, at most 1 record of a problem\)"),
        ({"metrics": (Few(),), "seed": 1}, "figures that this run does not make"),
    ],
)
def test_a_lesser_run_takes_no_fuller_result_away_and_asks_nothing(tmp_path, less, message):
    plan = replace(PLAN, metrics=(Few(), Few(name="more")))
    verify(plan, tmp_path, Here())
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    asked = Here(after=0)
    with pytest.raises(ScenarioError, match=message + r".*give another --out"):
        verify(replace(plan, **less), tmp_path, asked)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    # What has as much, or more, takes its place.
    verify(plan, tmp_path, asked)
    verify(replace(plan, records=2), tmp_path, asked)
    (more,) = verify(replace(plan, effort="full"), tmp_path, asked)
    assert Result.read(tmp_path / "perfect.json").effort == more.effort == "full"


@pytest.mark.parametrize("change", [{"effort": 5}, {"effort": None}, {"format": 9}])
def test_a_damaged_result_is_replaced(tmp_path, change):
    verify(PLAN, tmp_path, Here())
    path = tmp_path / "perfect.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    verify(replace(PLAN, records=1), tmp_path, Here(after=0))
    assert Result.read(path).effort == "quick, at most 1 record of a problem"


@pytest.mark.slow
def test_what_is_refused_is_counted_by_family_and_ask(tmp_path, faulty):
    (result,) = verify(replace(PLAN, estimators=(faulty("refusing"),)), tmp_path, Here())
    assert result.outcomes == {"model": 2, "refused": 2}
    assert result.refused == Result.read(tmp_path / "refusing.json").refused == {"p2": 2}
    trials = Trial("p2@300", 0), Trial("p2", 1), Trial("p2", 0, "select"), Trial("twin-nominal-elbow", 0)
    assert kinds_of_request(trials) == {"p2": 2, "p2, select": 1, "twin": 1}


@pytest.mark.reliability
def test_whatever_estimators_do_is_counted(tmp_path):
    kinds = {"arx": "model", "dies": "crash", "hangs": "hang", "asks_for_much": "memory"}
    estimators = (Estimator(name, f"tests.scenarios.estimators.estimators:{name}", structure="arx") for name in kinds)
    notes, progress = [], []
    plan = replace(SINGLE, estimators=tuple(estimators), limits=Limits(0.5, 2**28))
    results = verify(plan, tmp_path, Here(), notify=notes.append, report=progress.append)
    for result, kind in zip(results, kinds.values(), strict=True):
        assert result.outcomes == {kind: 1}
        assert result.passed == (kind == "model")
    assert results[0].seconds > 0.0 and results[0].reasons == {}
    assert results[2].reasons == {"hang: no answer within 0.5 s": 1}
    first, last = ((one.done, one.total, one.note) for one in (progress[0], progress[-1]))
    assert (first, last) == ((0, 4, "the first of each kind"), (4, 4, ""))
    assert notes == []  # the first record of the only problem was all


def test_what_a_run_costs_is_told_before_it_is_spent(tmp_path):
    notes = []
    executor = Here(workers=2)
    verify(PLAN, tmp_path, executor, notify=lambda line: notes.append((line, executor.asked)))
    ((note, asked),) = notes
    assert asked == 2 and note.startswith("hmtb verify: still to do, of 4 requests: 2 requests, ")


@pytest.mark.slow
def test_an_estimator_that_cannot_be_loaded_ends_a_run_and_leaves_no_journal(tmp_path):
    (tmp_path / "broken.py").write_text("import no_such_module\n")
    broken = Estimator("broken", "broken:good", home=str(tmp_path), structure="oe")
    with pytest.raises(ScenarioError, match="no_such_module"):
        verify(replace(PLAN, estimators=(broken,)), tmp_path, Here())
    assert list((tmp_path / JOURNALS).iterdir()) == []


@pytest.mark.slow
def test_another_estimator_of_the_same_name_takes_nothing_away(tmp_path, faulty):
    (tmp_path / "other.py").write_text(SOURCE)
    good = faulty("good")
    verify(replace(SINGLE, estimators=(good,)), tmp_path, Here())
    (journal,) = (tmp_path / JOURNALS).glob("good*.sqlite")
    before = journal.read_bytes()
    other = replace(SINGLE, estimators=(replace(good, target="other:good"),))
    with pytest.raises(ScenarioError, match="result of another estimator of the name 'good', 'faulty:good'"):
        verify(other, tmp_path, Here())
    (tmp_path / "good.json").unlink()
    verify(other, tmp_path, Here())
    assert journal.read_bytes() == before


@pytest.mark.reliability
def test_a_sandbox_that_fails_is_an_outcome_too(tmp_path, faulty, monkeypatch):
    ask, asked = EstimatorProcess.ask, []

    def failing(self, data, task):
        asked.append(self)
        if len(asked) == 2:
            raise RuntimeError("of the bench itself")
        return ask(self, data, task)

    monkeypatch.setattr(EstimatorProcess, "ask", failing)
    (result,) = verify(replace(PLAN, estimators=(faulty("good"),)), tmp_path, Here())
    assert result.outcomes == {"crash": 1, "model": 3}
    assert result.reasons == {"crash: its process failed: RuntimeError: of the bench itself": 1}
    assert len(set(map(id, asked))) == 2  # it was opened anew


def test_two_runs_do_not_write_one_journal(tmp_path):
    def meanwhile(progress):
        if progress.done == 2:
            with pytest.raises(ScenarioError, match="another process is at work"):
                verify(PLAN, tmp_path, Here())
            tried.append(progress.total)

    tried = []
    verify(PLAN, tmp_path, Here(), report=meanwhile)
    assert tried == [4]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"effort": "long"}, "expected one of quick, full"),
        ({"seed": -1}, "expected a whole number"),
        ({"records": 0}, "0 records given, expected 1 or more"),
        ({"estimators": ()}, "no estimator given"),
        ({"estimators": (PERFECT, replace(PERFECT, structure="oe"))}, "of the same name given: perfect"),
    ],
)
def test_plans_that_cannot_be(change, message):
    with pytest.raises(ScenarioError, match=message):
        replace(PLAN, **change)


@pytest.mark.reliability
def test_a_seed_is_drawn_for_the_files_of_the_estimators_and_kept_to_resume(tmp_path, faulty):
    plan = replace(PLAN, estimators=(faulty("good"),), seed=None, commands={"good": "hmtb verify faulty:good"})
    with pytest.raises(KeyboardInterrupt):
        verify(plan, tmp_path, Here(after=3))
    rest = Here()
    (first,) = verify(plan, tmp_path, rest)
    assert rest.asked == 1 and first.command == f"hmtb verify faulty:good --seed {first.seed}"
    (elsewhere,) = verify(replace(plan, seed=first.seed), tmp_path / "elsewhere", Here())
    assert repr(elsewhere.metrics) == repr(first.metrics)  # NaN is not equal to itself
    (tmp_path / "faulty.py").write_text(f"{SOURCE}\n")
    assert verify(plan, tmp_path, Here())[0].seed != first.seed


def some(definition, problems, records):
    """A metric on some of its trials."""
    trials = tuple(t for t in definition.trials("quick") if t.problem in problems and t.draw < records)
    return type("Some", (type(definition),), {"trials": lambda self, effort: trials})()


@pytest.mark.thorough
def test_each_fault_fails_the_metrics_that_should_see_it_and_no_other(tmp_path):
    few = (some(NoiseFreeRecovery(), ("quiet-1-1", "quiet-1-2"), 1), some(NormalisedError(), ("p5",), 30))
    metrics = (*few, Reliability(few), Speed(few))
    plan = replace(PLAN, estimators=(FAULTY["delayed"], FAULTY["overconfident"]), metrics=metrics)
    for result in verify(plan, tmp_path, Here()):
        failing = {name for name, metric in result.metrics.items() if metric.passed is False}
        assert failing == set(PLANTED_FAULTS[result.estimator.name]) & {metric.name for metric in metrics}
        assert None not in {metric.passed for metric in result.metrics.values()}
