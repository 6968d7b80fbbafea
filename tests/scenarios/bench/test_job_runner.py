"""Jobs on the workers of an executor give the measurements of this process; the perfect estimator."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from scenarios.bench.estimator_files import EstimatorFiles
from scenarios.bench.job_runner import BenchSetup, Runner, interleaved, perfect, remaining_jobs, run_jobs
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.outcome import MODEL
from scenarios.files.errors import ScenarioError
from scenarios.jobs.cluster import Cluster
from scenarios.jobs.executor import LocalProcesses
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid import armax
from sysid.polynomial.structures import layout
from tests.scenarios.bench.few import PERFECT

TRIALS = tuple(Trial(name, draw) for name in ("p1@300", "p3@300") for draw in range(6))
MODULE = """
import sysid

def mine(data, task):
    return sysid.arx(data, task.orders["na"], task.orders["nb"], task.orders["nk"])
"""


def plain(results):
    times = ("seconds", "ruler_seconds", "peak_bytes")
    tables = [(result.estimator, result.measurement.to_table()) for result in results]
    return sorted(repr((number, {k: v for k, v in table.items() if k not in times})) for number, table in tables)


@pytest.mark.reliability
def test_workers_measure_what_is_measured_here(scheduler, tmp_path, monkeypatch):
    (tmp_path / "alone.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    setup = BenchSetup((PERFECT, Estimator("mine", "alone:mine", structure="arx")), Limits(), 7)
    jobs = remaining_jobs([TRIALS, TRIALS[:1]], [(), ()])
    with closing(Runner(setup)) as runner:
        here = [result for job in jobs for result in runner.run(job)]
    assert {result.measurement.kind for result in here} == {"model"} and len(here) == 13
    with LocalProcesses(2) as processes:
        assert plain([*processes.run(run_jobs, setup, [(job,) for job in jobs])]) == plain(here)
    remote = replace(setup, files=tuple(map(EstimatorFiles.of, setup.estimators)))
    with Cluster(scheduler, patience=20.0) as cluster:
        assert plain([*cluster.run(run_jobs, remote, [jobs[:3], jobs[3:]])]) == plain(here)
        other = replace(remote, files=(remote.files[0], replace(remote.files[1], source="0")))
        with pytest.raises(ScenarioError, match="is another file here"):
            list(cluster.run(run_jobs, other, [jobs]))


def test_own_files_travel_and_others_must_be_there(tmp_path):
    (tmp_path / "alone.py").write_text(MODULE)
    mine = Estimator("mine", "alone:mine", home=str(tmp_path))
    files = EstimatorFiles.of(mine)
    assert files.own == (("alone.py", MODULE.encode()),)
    assert files.unpacked(mine, tmp_path / "0").home == str(tmp_path / "0")
    assert (tmp_path / "0" / "alone.py").read_text() == MODULE
    installed = Estimator("installed", "scenarios.estimators.ours:oe")
    files = EstimatorFiles.of(installed)
    assert files.own == () and files.source and files.unpacked(installed, tmp_path / "1") == installed
    program = Estimator("program", "./run.sh {mat} {task} {model}", program=True, home=str(tmp_path))
    files = EstimatorFiles.of(program)
    (tmp_path / "run.sh").write_text("true\n")
    with pytest.raises(ScenarioError, match="is another file here"):
        files.unpacked(program, tmp_path / "3")


def test_families_of_problems_take_turns():
    trials = [Trial("quiet-1-1", k) for k in range(4)] + [Trial("p2", 0), Trial("p2@300", 1)]
    jobs = interleaved(remaining_jobs([trials], [{Trial("quiet-1-1", 3).key}]))
    assert [job.problem for job in jobs] == ["quiet-1-1", "p2", "quiet-1-1", "p2@300", "quiet-1-1"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["p3", "feedback", "p4@500"])
def test_error_is_that_of_the_bound(name):
    one = problem(name)
    bound, task = one.bound(None), one.task(None)
    errors = np.array([one.efficient(task.structure, seed) for seed in range(200)]) - bound.parameters
    sizes = np.einsum("np,pq,nq->n", errors, np.linalg.inv(bound.covariance), errors)
    assert kstest(sizes, chi2(len(bound.parameters)).cdf).pvalue > 1e-3
    for seed in range(3):
        outcome = perfect(one, task, seed)
        answer = outcome.answer
        assert outcome.kind == MODEL
        moved = layout(task.structure, task.orders).parameters(answer.polynomials)
        assert moved == pytest.approx(bound.parameters + errors[seed], abs=1e-14)
        assert np.array_equal(answer.covariance, bound.covariance)
        low, high = answer.bandwidth_ci95
        assert np.sqrt(low * high) == pytest.approx(answer.model.bandwidth())
        assert np.log(high / low) / 2.0 / 1.96 == pytest.approx(bound.bandwidth_deviation, rel=1e-3)


def test_error_belongs_to_the_record():
    one = problem("p3")
    deviation = np.sqrt(np.diag(one.bound(None).covariance))
    for seed in range(3):
        real = armax(one.draw(seed), **one.task(None).orders).parameters
        assert np.abs(real - one.efficient("armax", seed)).max() < 0.5 * deviation.max()
        assert np.linalg.norm((real - one.efficient("armax", seed)) / deviation) < 1.0


def test_without_noise_it_is_the_truth():
    quiet = problem("quiet-4-2")
    assert perfect(quiet, quiet.task("armax"), 0).answer.model is quiet.truth


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["armax", "bj", "oe", "arx", "ss", None])
def test_orders_too_low_and_of_its_own_choice(structure):
    one = problem("p3")
    answer = perfect(one, one.task(structure, "underfit" if structure else "select"), 1).answer
    assert answer.model.input_path().minimal(1e-6).order == (1 if structure else 2)
    assert structure is None or answer.covariance is None
