"""The perfect estimator errs as the bound says and claims exactly that."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from scenarios.bench.runner import perfect
from scenarios.estimators.claims import parameters
from scenarios.estimators.outcome import MODEL
from scenarios.problems.embedding import layout
from scenarios.problems.registry import problem
from sysid import armax

DRAWS = 200


@pytest.mark.parametrize("name", ["p3", "feedback", "p4@500"])
def test_error_is_that_of_the_bound(name: str) -> None:
    found = problem(name)
    bound, task = found.bound(None), found.task(None)
    assert bound is not None and task is not None
    errors = np.array([found.efficient(task.structure, seed) for seed in range(DRAWS)]) - bound.parameters
    sizes = np.einsum("np,pq,nq->n", errors, np.linalg.inv(bound.covariance), errors)
    assert kstest(sizes, chi2(len(bound.parameters)).cdf).pvalue > 1e-3
    for seed in range(3):
        outcome = perfect(found, task, seed)
        assert outcome.kind == MODEL and outcome.answer is not None
        answer = outcome.answer
        assert answer.polynomials is not None and answer.bandwidth_ci95 is not None
        moved = parameters(answer.polynomials, layout(task.structure, task.orders))
        assert moved == pytest.approx(bound.parameters + errors[seed], abs=1e-14)
        assert np.array_equal(answer.covariance, bound.covariance)
        low, high = answer.bandwidth_ci95
        assert np.sqrt(low * high) == pytest.approx(answer.model.bandwidth())
        assert np.log(high / low) / 2.0 / 1.96 == pytest.approx(bound.bandwidth_deviation, rel=1e-3)


def test_error_belongs_to_the_record() -> None:
    found = problem("p3")
    bound, task = found.bound(None), found.task(None)
    assert bound is not None and task is not None
    deviation = np.sqrt(np.diag(bound.covariance))
    for seed in range(3):
        real = armax(found.draw(seed), **task.orders).parameters
        assert np.abs(real - found.efficient("armax", seed)).max() < 0.5 * deviation.max()
        assert np.linalg.norm((real - found.efficient("armax", seed)) / deviation) < 1.0


def test_without_noise_it_is_the_truth() -> None:
    found = problem("quiet-4-2")
    task = found.task("armax")
    assert task is not None
    outcome = perfect(found, task, 0)
    assert outcome.answer is not None and outcome.answer.model is found.truth


@pytest.mark.parametrize(("structure", "order"), [("armax", 1), ("bj", 1), ("oe", 1), ("arx", 1), ("ss", 1)])
def test_orders_too_low(structure: str, order: int) -> None:
    found = problem("p3")
    task = found.task(structure, "underfit")
    assert task is not None
    answer = perfect(found, task, 1).answer
    assert answer is not None and answer.covariance is None
    assert answer.model.input_path().minimal(1e-6).order == order


def test_orders_of_its_own_choice() -> None:
    found = problem("p3")
    task = found.task(None, "select")
    assert task is not None
    answer = perfect(found, task, 1).answer
    assert answer is not None and answer.model.input_path().minimal(1e-6).order == 2
