"""The test of mean errors, and bias on problems in closed loop."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.bias import ALONE, PROBLEMS, Bias, directions, mean_error
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Metric
from scenarios.bench.statistics import bound_for
from scenarios.estimators.estimator import Estimator
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.registry import problem
from tests.benchmarks.simulated_estimators import Fault, simulated

ANYONE = Estimator("simulated", "bench:perfect")
SHARE = 1e-4


def metric(fault: Fault, seed: int = 0, contestant: Estimator = ANYONE) -> Metric:
    trials = [trial for trial in Bias().trials("quick") if trial.problem != ALONE]
    measured = simulated(trials, fault, np.random.default_rng(seed))
    return Bias().evaluate(measured, contestant, SHARE, ())


@pytest.mark.parametrize("variance", [0.5, 1.0, 1.5, 100.0])
def test_scatter_is_no_bias(variance: float) -> None:
    found = metric(Fault(variance=variance))
    assert found.passed
    assert found.value < found.parts[0].limits[1] < 1.1
    assert found.false_alarm == pytest.approx(SHARE * len(PROBLEMS))


@pytest.mark.parametrize("fault", [Fault(delay=1), Fault(gain=1.1), Fault(gain=1.1, variance=2.0)])
def test_bias_is_found(fault: Fault) -> None:
    found = metric(fault)
    assert found.passed is False
    assert found.interval[0] > 0.5
    assert "%" in found.why


def test_what_theory_expects_to_fail_fails_and_is_no_surprise() -> None:
    oe = Estimator("late", "bench:perfect", structure="oe", method="pem")
    found = metric(Fault(delay=1), contestant=oe)
    expected = {part.label: part.theory for part in found.parts}
    assert expected == {"feedback": False, "feedback-arx": False, "shared": True}
    assert found.passed is False
    assert "feedback" in found.why


def test_failures_leave_no_verdict() -> None:
    for kind in ("crash", "refused"):
        measured = [Measurement(trial, kind) for trial in Bias().trials("quick")]
        found = Bias().evaluate(measured, ANYONE, SHARE, ())
        assert found.passed is None
        assert np.isnan(found.value)
    assert Bias().evaluate([], ANYONE, SHARE, ()).passed is None


def test_how_many_records_are_needed_is_said() -> None:
    for records, judged in ((10, False), (11, True)):
        trials = [trial for trial in Bias().trials("quick") if trial.draw < records and trial.problem != ALONE]
        found = Bias().evaluate(simulated(trials, Fault(), np.random.default_rng(0)), ANYONE, SHARE, ())
        assert {part.passed for part in found.parts} == {True if judged else None}
        assert judged or "10 of 10 records gave a model: too few, at least 11 are needed" in found.why
    few = [replace(m, kind="crash") if m.trial.draw % 4 else m for m in simulated_all()]
    why = Bias().evaluate(few, ANYONE, SHARE, ()).why
    assert "10 of 40 records gave a model: too few, at least 20 are needed" in why


def simulated_all() -> list[Measurement]:
    trials = [trial for trial in Bias().trials("quick") if trial.problem != ALONE]
    return simulated(trials, Fault(), np.random.default_rng(0))


def test_a_few_failures_do_not_matter() -> None:
    assert metric(Fault(failing=0.1)).passed


def test_what_one_input_alone_shows_is_told_beside_what_it_must_show() -> None:
    alone = problem(ALONE)
    assert isinstance(alone, SharedAlone)
    bound = alone.bound_without_other(None)
    assert bound is not None
    rng = np.random.default_rng(1)
    steps = rng.standard_normal((20, len(bound.response_directions)))
    parts = np.tensordot(steps, bound.response_directions, axes=1)
    found = bound.response + alone.expected_bias() + parts[..., 0] + 1j * parts[..., 1]
    trials = [trial for trial in Bias().trials("quick") if trial.problem == ALONE]
    measured = [Measurement(trial, "model", response=one) for trial, one in zip(trials, found, strict=True)]
    part = Bias().evaluate(measured, ANYONE, SHARE, ()).parts[-1]
    assert (part.label, part.passed, part.draws) == (ALONE, None, 20)
    assert part.value == pytest.approx(part.expected, rel=0.02)
    assert "83 % off; output error without noise is 83.1 % off" in part.why
    constant = [replace(m, response=bound.response) for m in measured]
    assert "no scatter" in Bias().evaluate(constant, ANYONE, SHARE, ()).parts[-1].why


def test_directions_have_unit_variance() -> None:
    for name in PROBLEMS:
        bound = bound_for(name, None)
        assert bound is not None
        flat = bound.response_directions.reshape(len(bound.response_directions), -1)
        axes = flat @ directions(bound)
        assert axes.T @ axes == pytest.approx(np.eye(4), abs=1e-9)


RUNS = 200


def sizes(records: int, directions: int, shift: float, allowed: float, seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    mixing = rng.standard_normal((directions, directions)) + 3.0 * np.eye(directions)
    beyond = inside = 0
    for _ in range(RUNS):
        errors = rng.standard_normal((records, directions))
        errors[:, 0] += shift
        found = mean_error(errors @ mixing, 0.05, allowed)
        beyond += found.size > found.limit
        inside += found.interval[0] <= shift <= found.interval[1]
    return beyond / RUNS, inside / RUNS


@pytest.mark.parametrize(("records", "directions", "shift"), [(40, 4, 0.0), (15, 2, 0.0), (40, 3, 0.5)])
def test_a_mean_as_large_as_allowed_is_beyond_the_limit_as_often_as_asked(
    records: int, directions: int, shift: float
) -> None:
    beyond, inside = sizes(records, directions, shift, shift, 7)
    assert beyond == pytest.approx(0.05, abs=0.046)
    assert inside >= 0.904


@pytest.mark.parametrize(("shift", "least", "most"), [(1.2, 0.99, 1.0), (0.2, 0.0, 0.1), (0.0, 0.0, 0.05)])
def test_what_is_larger_is_found_and_what_is_smaller_is_not(shift: float, least: float, most: float) -> None:
    rng = np.random.default_rng(8)
    given = [rng.standard_normal((40, 4)) + np.array([shift, 0.0, 0.0, 0.0]) for _ in range(RUNS)]
    judged = [mean_error(errors, 0.05, 0.2) for errors in given]
    assert least <= np.mean([one.size > one.limit for one in judged]) <= most


def test_the_size_is_that_of_the_mean() -> None:
    rng = np.random.default_rng(3)
    errors = rng.standard_normal((4000, 3)) * (1.0, 10.0, 0.1) + (2.0, 0.0, 0.0)
    found = mean_error(errors, 1e-4)
    assert found.size == pytest.approx(2.0, abs=0.1)
    assert found.interval[0] < 2.0 < found.interval[1]
    assert found.limit < 0.2


def test_errors_without_scatter() -> None:
    assert mean_error(np.zeros((10, 2)), 1e-3).size == 0.0
    assert mean_error(np.full((10, 2), 3.0), 1e-3).size == np.inf
    mixed = np.column_stack((np.full(10, 3.0), np.arange(10.0) - 4.5))
    assert mean_error(mixed, 1e-3).size == np.inf
    unused = np.column_stack((np.zeros(10), np.arange(10.0) - 4.5))
    assert mean_error(unused, 1e-3).size == 0.0
