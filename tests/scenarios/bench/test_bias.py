"""Bias is told from scatter, however large that is."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.bias import ALONE, PROBLEMS, Bias, directions
from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure
from scenarios.bench.perfect_records import bound_for
from scenarios.bench.simulated_estimators import Fault, simulated
from scenarios.estimators.contestant import Contestant
from scenarios.problems.common_waveform import SharedAlone
from scenarios.problems.registry import problem

ANYONE = Contestant("simulated", "bench:perfect")
SHARE = 1e-4


def figure(fault: Fault, seed: int = 0, contestant: Contestant = ANYONE) -> Figure:
    """Of an estimator with a fault, by the quick effort."""
    trials = [trial for trial in Bias().trials("quick") if trial.problem != ALONE]
    measured = simulated(trials, fault, np.random.default_rng(seed))
    return Bias().figure(measured, contestant, SHARE, ())


@pytest.mark.parametrize("variance", [0.5, 1.0, 1.5, 100.0])
def test_scatter_is_no_bias(variance: float) -> None:
    """The perfect estimator passes, and one whose errors are ten times as large."""
    found = figure(Fault(variance=variance))
    assert found.passed
    assert found.value < found.parts[0].limits[1] < 1.1
    assert found.false_alarm == pytest.approx(SHARE * len(PROBLEMS))


@pytest.mark.parametrize("fault", [Fault(delay=1), Fault(gain=1.1), Fault(gain=1.1, variance=2.0)])
def test_bias_is_found(fault: Fault) -> None:
    """A sample too late, or a tenth too large."""
    found = figure(fault)
    assert found.passed is False
    assert found.interval[0] > 0.5
    assert "%" in found.why


def test_what_theory_expects_to_fail_fails_and_is_no_surprise() -> None:
    """Output error under feedback; with both inputs given it must pass."""
    oe = Contestant("late", "bench:perfect", structure="oe", method="pem")
    found = figure(Fault(delay=1), contestant=oe)
    expected = {part.label: part.theory for part in found.parts}
    assert expected == {"feedback": False, "feedback-arx": False, "shared": True}
    assert found.passed is False
    assert "feedback" in found.why


def test_failures_leave_no_verdict() -> None:
    """All failed, refused, or without any trial."""
    for kind in ("crash", "refused"):
        measured = [Measured(trial, kind) for trial in Bias().trials("quick")]
        found = Bias().figure(measured, ANYONE, SHARE, ())
        assert found.passed is None
        assert np.isnan(found.value)
    assert Bias().figure([], ANYONE, SHARE, ()).passed is None


def test_how_many_records_are_needed_is_said() -> None:
    """Of ten nothing is told, and why; of eleven it is."""
    for records, judged in ((10, False), (11, True)):
        trials = [trial for trial in Bias().trials("quick") if trial.draw < records and trial.problem != ALONE]
        found = Bias().figure(simulated(trials, Fault(), np.random.default_rng(0)), ANYONE, SHARE, ())
        assert {part.passed for part in found.parts} == {True if judged else None}
        assert judged or "10 of 10 records gave a model: too few, at least 11 are needed" in found.why
    few = [replace(m, kind="crash") if m.trial.draw % 4 else m for m in simulated_all()]
    why = Bias().figure(few, ANYONE, SHARE, ()).why
    assert "10 of 40 records gave a model: too few, at least 20 are needed" in why


def simulated_all() -> list[Measured]:
    """Of the perfect estimator, by the quick effort."""
    trials = [trial for trial in Bias().trials("quick") if trial.problem != ALONE]
    return simulated(trials, Fault(), np.random.default_rng(0))


def test_a_few_failures_do_not_matter() -> None:
    """They show elsewhere."""
    assert figure(Fault(failing=0.1)).passed


def test_what_one_input_alone_shows_is_told_beside_what_it_must_show() -> None:
    """The other path, in deviations and in percent; no verdict on it."""
    alone = problem(ALONE)
    assert isinstance(alone, SharedAlone)
    bound = alone.first.bound(None)
    assert bound is not None
    rng = np.random.default_rng(1)
    steps = rng.standard_normal((20, len(bound.response_directions)))
    parts = np.tensordot(steps, bound.response_directions, axes=1)
    found = bound.response + alone.expected_bias() + parts[..., 0] + 1j * parts[..., 1]
    trials = [trial for trial in Bias().trials("quick") if trial.problem == ALONE]
    measured = [Measured(trial, "model", response=one) for trial, one in zip(trials, found, strict=True)]
    part = Bias().figure(measured, ANYONE, SHARE, ()).parts[-1]
    assert (part.label, part.passed, part.draws) == (ALONE, None, 20)
    assert part.value == pytest.approx(part.expected, rel=0.02)
    assert "83 % off; output error without noise is 83.1 % off" in part.why
    constant = [replace(m, response=bound.response) for m in measured]
    assert "no scatter" in Bias().figure(constant, ANYONE, SHARE, ()).parts[-1].why


def test_directions_have_unit_variance() -> None:
    """For a perfect estimator, and nothing in common."""
    for name in PROBLEMS:
        bound = bound_for(name, None)
        assert bound is not None
        flat = bound.response_directions.reshape(len(bound.response_directions), -1)
        axes = flat @ directions(bound)
        assert axes.T @ axes == pytest.approx(np.eye(4), abs=1e-9)
