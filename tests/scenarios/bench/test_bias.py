"""Bias on problems in closed loop, and of one of two inputs that share their waveform."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.bias import ALONE, PROBLEMS, Bias, directions
from scenarios.bench.measurement import Measurement
from scenarios.bench.null_distributions import bound_for
from scenarios.estimators.estimator import Estimator
from scenarios.problems.registry import problem
from tests.scenarios.bench.judging import ALARM, ANYONE, evaluated, without_model
from tests.scenarios.bench.simulated import Fault, simulated

TRIALS = Bias().trials("quick")


def measured(fault=Fault(), records=40):  # noqa: B008
    trials = [trial for trial in TRIALS if trial.draw < records and trial.problem != ALONE]
    return simulated(trials, fault, np.random.default_rng(0))


@pytest.mark.parametrize("variance", [0.5, 1.0, 1.5, 100.0])
def test_scatter_is_no_bias(variance):
    metric = evaluated(Bias(), measured(Fault(variance=variance)))
    assert metric.passed
    assert metric.value < metric.parts[0].limits[1] < 1.1
    assert metric.false_alarm == pytest.approx(ALARM * len(PROBLEMS))


@pytest.mark.parametrize("fault", [Fault(delay=1), Fault(gain=1.1), Fault(gain=1.1, variance=2.0)])
def test_bias_fails(fault):
    metric = evaluated(Bias(), measured(fault))
    assert metric.passed is False
    assert metric.interval[0] > 0.5
    assert "%" in metric.why


def test_expected_failures_are_no_surprise():
    oe = Estimator("late", ":perfect", structure="oe", method="pem")
    metric = evaluated(Bias(), measured(Fault(delay=1)), oe)
    expected = {part.label: part.theory for part in metric.parts}
    assert expected == {"feedback": False, "feedback-arx": False, "shared": True}
    assert metric.passed is False
    assert "feedback" in metric.why


def test_how_many_records_are_needed():
    assert evaluated(Bias(), measured(records=11)).passed
    assert evaluated(Bias(), measured(Fault(failing=0.1))).passed
    few = without_model(measured(), lambda m: m.trial.draw % 4)
    for data, why in ((measured(records=10), "10 of 10 records gave a model: too few, at least 11 are needed"),
                      (few, "10 of 40 records gave a model: too few, at least 20 are needed")):  # fmt: skip
        metric = evaluated(Bias(), data)
        assert {part.passed for part in metric.parts} == {None}
        assert why in metric.why


def test_bias_of_one_input_alone_is_shown_beside_the_predicted_one():
    alone = problem(ALONE)
    bound = alone.bound_without_other(None)
    responses = bound.response + alone.expected_bias() + bound.response_errors(20, np.random.default_rng(1))
    trials = [trial for trial in TRIALS if trial.problem == ALONE]
    data = [Measurement(trial, "model", response=one) for trial, one in zip(trials, responses, strict=True)]
    part = evaluated(Bias(), data).parts[-1]
    assert (part.label, part.passed, part.draws) == (ALONE, None, 20)
    assert part.value == pytest.approx(part.expected, rel=0.02)
    assert "83.1 % off; output error without noise is 83.1 % off" in part.why
    constant = [replace(m, response=bound.response) for m in data]
    assert "no scatter" in evaluated(Bias(), constant, ANYONE).parts[-1].why


@pytest.mark.parametrize("name", PROBLEMS)
def test_directions_have_unit_variance(name):
    bound = bound_for(name, None)
    axes = bound.response_directions.reshape(len(bound.response_directions), -1) @ directions(bound)
    assert axes.T @ axes == pytest.approx(np.eye(4), abs=1e-9)
