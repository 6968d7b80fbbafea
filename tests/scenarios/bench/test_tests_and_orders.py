"""Counts of rejections and of right orders."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Metric
from scenarios.bench.tests_and_orders import (
    PROBLEMS,
    SELECTED,
    ResidualTestsAndOrders,
    order_of,
    size_of_independent_estimate,
)
from scenarios.estimators.estimator import Estimator
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

ANYONE = Estimator("anyone", "bench:perfect")
SHARE = 1e-4
MAKER = ResidualTestsAndOrders()


def measured(trial: Trial, rng: np.random.Generator, structure: str | None = None) -> Measurement:
    task = problem(trial.problem).task(structure, "fit" if trial.ask == "select" else trial.ask)
    assert task is not None
    white, independent = (1e-9, 1e-9) if trial.ask == "underfit" else rng.uniform(size=2)
    return Measurement(trial, "model", order=order_of(task), whiteness_p=white, independence_p=independent)


def metric(change: Callable[[Measurement], Measurement] = lambda m: m, contestant: Estimator = ANYONE) -> Metric:
    rng = np.random.default_rng(2)
    trials = MAKER.trials("quick")
    return MAKER.evaluate([change(measured(t, rng, contestant.structure)) for t in trials], contestant, SHARE, ())


def failing(found: Metric) -> set[str]:
    return {part.label for part in found.parts if part.passed is False}


def test_right_orders_pass() -> None:
    found = metric()
    assert found.passed
    assert len(found.parts) == 3 * len(PROBLEMS) + len(SELECTED)
    assert all(part.passed for part in found.parts)


@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("whiteness_p", {f"whiteness on {name}" for name in PROBLEMS}),
        ("independence_p", {f"independence on {name}" for name in PROBLEMS}),
    ],
)
def test_residuals_that_are_rejected_too_often(name: str, labels: set[str]) -> None:

    def change(m: Measurement) -> Measurement:
        return replace(m, **{name: 1e-6}) if m.trial.ask == "fit" and m.trial.draw % 2 else m  # type: ignore[arg-type]

    found = metric(change)
    assert failing(found) == labels
    assert found.passed is False
    assert found.value == 50.0


def test_orders_that_are_not_obeyed() -> None:

    def change(m: Measurement) -> Measurement:
        return replace(m, whiteness_p=0.5, independence_p=0.5) if m.trial.ask == "underfit" else m

    assert failing(metric(change)) == {f"orders too low on {name}" for name in PROBLEMS}


def test_orders_that_are_chosen_wrongly() -> None:
    found = metric(lambda m: replace(m, order=m.order + (m.trial.ask == "select")))
    assert failing(found) == {f"choice on {name}" for name in SELECTED}


def test_what_is_refused_has_no_verdict() -> None:

    def change(m: Measurement) -> Measurement:
        return Measurement(m.trial, "refused", "it does not choose") if m.trial.ask != "fit" else m

    found = metric(change)
    assert found.passed
    assert {part.why for part in found.parts if part.passed is None} == {"it does not choose"}


def test_nothing_but_failures() -> None:
    assert metric(lambda m: Measurement(m.trial, "hang")).passed is None
    assert MAKER.evaluate([], ANYONE, SHARE, ()).passed is None


def test_a_model_without_disturbance_is_tested_by_independence_alone() -> None:
    era = Estimator("era", "bench:perfect", structure="ss")
    found = metric(lambda m: replace(m, whiteness_p=float("nan")), era)
    verdicts = {part.label: part.passed for part in found.parts}
    assert verdicts["whiteness on p3"] is None
    assert verdicts["orders too low on p3"] is True
    # two states of p4's four belong to the disturbance
    assert verdicts["orders too low on p4"] is None


def test_what_is_not_efficient_need_not_leave_white_residuals() -> None:
    for contestant in (
        Estimator("n4sid", "bench:perfect", structure="ss", method="subspace"),
        Estimator("oe", "bench:perfect", structure="oe", method="pem"),
    ):
        found = metric(lambda m: replace(m, whiteness_p=1e-9) if m.trial.problem == "p4" else m, contestant)
        assert "whiteness on p4" in failing(found)
        assert found.passed is not False
        assert "Ljung1999" in found.why or "VanOverschee1996" in found.why


@pytest.mark.parametrize(("size", "fails"), [(0.5, True), (3.0, False)])
def test_output_error_is_independent_of_past_inputs_if_its_error_is_small(size: float, fails: bool) -> None:
    bound = problem("p4").bound(None)
    assert bound is not None
    step = np.sqrt(size * len(bound.response_directions)) * bound.response_directions[0]
    response = bound.response + step[..., 0] + 1j * step[..., 1]
    oe = Estimator("oe", "bench:perfect", structure="oe", method="pem")

    def change(m: Measurement) -> Measurement:
        return replace(m, independence_p=1e-9, response=response) if m.trial.problem == "p4" else m

    found = metric(change, oe)
    assert "independence on p4" in failing(found)
    assert (found.passed is False) is fails


def test_size_of_an_estimate_that_has_nothing_to_do_with_the_record() -> None:
    assert size_of_independent_estimate(0) == pytest.approx(0.01, abs=0.001)
    sizes = [size_of_independent_estimate(count) for count in (2, 4, 8)]
    assert sizes == sorted(sizes)
    rng = np.random.default_rng(5)
    opened = np.linalg.qr(rng.standard_normal((25, 4)))[0]
    correlations = rng.standard_normal((20_000, 25)) + rng.standard_normal((20_000, 4)) @ opened.T
    rejected = np.mean(np.sum(correlations**2, axis=1) > chi2.isf(0.01, 25))
    assert sizes[1] == pytest.approx(rejected, abs=0.006)
