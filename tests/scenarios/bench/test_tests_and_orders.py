"""Counts of rejections and of right orders."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from scenarios.bench.measurement import Measurement
from scenarios.bench.tests_and_orders import (
    PROBLEMS,
    SELECTED,
    ResidualTestsAndOrders,
    size_of_independent_estimate,
)
from scenarios.estimators.estimator import Estimator
from scenarios.problems.registry import problem
from tests.scenarios.bench.judging import ANYONE, evaluated, failing, parts_of, residuals

PEM_OE = Estimator("oe", ":perfect", structure="oe", method="pem")


def metric(change=lambda m: {}, estimator=ANYONE):
    """Of a perfect estimator, whose measurements are changed."""
    rng, definition = np.random.default_rng(2), ResidualTestsAndOrders()
    trials = definition.trials("quick")
    data = [Measurement(trial, "model", **residuals(trial, rng, estimator.structure)) for trial in trials]
    return evaluated(definition, [replace(m, **change(m)) for m in data], estimator)


def test_right_orders_pass():
    perfect = metric()
    assert len(perfect.parts) == 3 * len(PROBLEMS) + len(SELECTED)
    assert all(part.passed for part in perfect.parts)


def every_other(m, key):
    return {key: 1e-6} if m.trial.ask == "fit" and m.trial.draw % 2 else {}


@pytest.mark.parametrize(
    ("change", "label", "problems", "value"),
    [
        (lambda m: every_other(m, "whiteness_p"), "whiteness", PROBLEMS, 50.0),
        (lambda m: every_other(m, "independence_p"), "independence", PROBLEMS, 50.0),
        (
            lambda m: {"whiteness_p": 0.5, "independence_p": 0.5} if m.trial.ask == "underfit" else {},
            "orders too low",
            PROBLEMS,
            0.0,
        ),
        (lambda m: {"order": m.order + (m.trial.ask == "select")}, "choice", SELECTED, 0.0),
    ],
)
def test_faults_fail_their_own_parts(change, label, problems, value):
    faulty = metric(change)
    assert faulty.passed is False
    assert failing(faulty) == {f"{label} on {name}" for name in problems}
    assert faulty.value == value


def test_refusals_have_no_verdict():
    refused = {"kind": "refused", "why": "it does not choose"}
    some = metric(lambda m: refused if m.trial.ask != "fit" else {})
    assert some.passed
    assert {part.why for part in some.parts if part.passed is None} == {"it does not choose"}


def test_a_model_without_disturbance_is_tested_by_independence_alone():
    era = Estimator("era", ":perfect", structure="ss")
    parts = parts_of(metric(lambda m: {"whiteness_p": float("nan")}, era))
    assert parts["whiteness on p3"].passed is None
    assert parts["orders too low on p3"].passed is True
    # two states of p4's four belong to the disturbance
    assert parts["orders too low on p4"].passed is None


@pytest.mark.parametrize(
    "estimator", [Estimator("n4sid", ":perfect", structure="ss", method="subspace"), PEM_OE], ids=lambda e: e.name
)
def test_inefficient_estimates_need_not_leave_white_residuals(estimator):
    coloured = metric(lambda m: {"whiteness_p": 1e-9} if m.trial.problem == "p4" else {}, estimator)
    assert "whiteness on p4" in failing(coloured) and coloured.passed is not False
    assert "Ljung1999" in coloured.why or "VanOverschee1996" in coloured.why


@pytest.mark.parametrize(("size", "fails"), [(0.5, True), (3.0, False)])
def test_output_error_is_independent_of_past_inputs_if_its_error_is_small(size, fails):
    bound = problem("p4").bound(None)
    step = np.sqrt(size * len(bound.response_directions)) * bound.response_directions[0]
    dependent = {"independence_p": 1e-9, "response": bound.response + step[..., 0] + 1j * step[..., 1]}
    judged = metric(lambda m: dependent if m.trial.problem == "p4" else {}, PEM_OE)
    assert "independence on p4" in failing(judged)
    assert (judged.passed is False) is fails


def test_size_of_an_estimate_independent_of_the_record():
    assert size_of_independent_estimate(0) == pytest.approx(0.01, abs=0.001)
    sizes = [size_of_independent_estimate(count) for count in (2, 4, 8)]
    assert sizes == sorted(sizes)
    rng = np.random.default_rng(5)
    opened = np.linalg.qr(rng.standard_normal((25, 4)))[0]
    correlations = rng.standard_normal((20_000, 25)) + rng.standard_normal((20_000, 4)) @ opened.T
    rejected = np.mean(np.sum(correlations**2, axis=1) > chi2.isf(0.01, 25))
    assert sizes[1] == pytest.approx(rejected, abs=0.006)
