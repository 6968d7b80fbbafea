"""Measures of an answer: right for the truth, for a known error, and for one of our own estimates."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.measurement import Measurement, dynamic_order, measure, normalised_error
from scenarios.estimators.outcome import Answer, EstimatorOutcome
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.task import Task
from scenarios.problems.problem import Bound, Problem
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid import Estimate, IOData, Polynomials, StateSpace, bj, oe
from sysid.models import innovations_form

TRIAL = Trial("p2@600", 0)


@pytest.fixture(scope="module")
def p2() -> Problem:
    return problem(TRIAL.problem)


@pytest.fixture(scope="module")
def record(p2: Problem) -> IOData:
    return p2.draw(TRIAL.seed(0))


@pytest.fixture(scope="module")
def task(p2: Problem) -> Task:
    asked = p2.task("oe")
    assert asked is not None
    return asked


@pytest.fixture(scope="module")
def bound(p2: Problem) -> Bound:
    known = p2.bound("oe")
    assert known is not None
    return known


@pytest.fixture(scope="module")
def estimate(record: IOData, task: Task) -> Estimate:
    return oe(record, task.orders["nb"], task.orders["nf"], task.orders["nk"])


def measured(
    p2: Problem, task: Task, bound: Bound | None, record: IOData, answer: Answer, ask: str = "fit"
) -> Measurement:
    return measure(
        p2, replace(TRIAL, ask=ask), task, bound, record, EstimatorOutcome("model", answer=answer, seconds=2.0)
    )


def test_one_of_our_estimates(p2: Problem, task: Task, bound: Bound, record: IOData, estimate: Estimate):
    answer = Answer(estimate.model, estimate.polynomials, estimate.covariance)
    found = measured(p2, task, bound, record, answer)
    error = estimate.parameters - bound.parameters
    assert found.normalised_error == pytest.approx(error @ np.linalg.solve(estimate.covariance, error))
    assert found.covered == (np.abs(error) < 1.96 * np.sqrt(np.diag(estimate.covariance))).sum()
    assert (found.parameters, found.order, found.seconds) == (4, 2, 2.0)
    known = estimate.frequency_response(p2.frequencies)
    assert found.response_covariance == pytest.approx(known.covariance, rel=1e-9)
    assert found.bandwidth_ci95 == pytest.approx(np.stack(estimate.bandwidth().ci95))
    assert 0.0 < found.whiteness_p < 1.0 and 0.0 < found.independence_p < 1.0
    assert str(Measurement.from_table(found.to_table()).to_table()) == str(found.to_table())


def test_what_is_claimed_itself_counts_before_what_follows(
    p2: Problem, task: Task, bound: Bound, record: IOData, estimate: Estimate
):
    own = np.zeros((len(p2.frequencies), 1, 1, 2, 2))
    ends = (np.array([[1.0]]), np.array([[2.0]]))
    found = measured(p2, task, bound, record, Answer(estimate.model, None, None, own, ends))
    assert (found.response_covariance == own).all()
    assert found.bandwidth_ci95 is not None and found.bandwidth_ci95.ravel().tolist() == [1.0, 2.0]
    assert np.isnan(found.normalised_error) and (found.parameters, found.covered) == (0, -1)


def test_the_truth_itself(p2: Problem, task: Task, bound: Bound, record: IOData):
    answer = Answer(p2.truth, bound.polynomials, bound.covariance)
    found = measured(p2, task, bound, record, answer)
    assert (found.normalised_error, found.covered) == (0.0, 4)
    assert (found.response == p2.truth.frequency_response(p2.frequencies)).all()


def test_errors_of_parameters_need_the_orders_that_were_asked(
    p2: Problem, task: Task, bound: Bound, record: IOData, estimate: Estimate
):
    answer = Answer(estimate.model, estimate.polynomials, estimate.covariance)
    for known, ask in ((None, "fit"), (bound, "select")):
        found = measured(p2, task, known, record, answer, ask)
        assert np.isnan(found.normalised_error) and (found.parameters, found.covered) == (4, -1)
    other = bj(record, 2, 1, 1, 2)
    found = measured(p2, task, bound, record, Answer(other.model, other.polynomials, other.covariance))
    assert np.isnan(found.normalised_error) and (found.parameters, found.covered) == (6, -1)


def test_without_a_model_of_the_noise_whiteness_is_not_tested(
    p2: Problem, task: Task, bound: Bound, record: IOData, estimate: Estimate
):
    bare = replace(estimate.model, K=None, innovation_covariance=None)
    found = measured(p2, task, bound, record, Answer(bare))
    assert np.isnan(found.whiteness_p) and 0.0 < found.independence_p < 1.0
    found = measured(p2, task, bound, record, Answer(bare, estimate.polynomials))
    assert 0.0 < found.whiteness_p < 1.0  # output error: white
    arx = Polynomials(A=estimate.polynomials.F, B=estimate.polynomials.B) if estimate.polynomials else None
    assert np.isnan(measured(p2, task, bound, record, Answer(bare, arx)).whiteness_p)


def test_a_claim_of_another_number_of_parameters_is_malformed(
    p2: Problem, task: Task, bound: Bound, record: IOData, estimate: Estimate
):
    found = measured(p2, task, bound, record, Answer(estimate.model, estimate.polynomials, np.eye(9)))
    assert found.kind == "malformed" and "covariance of shape (9, 9) given" in found.why


def test_no_model_has_no_numbers(p2: Problem, task: Task, bound: Bound, record: IOData):
    outcome = EstimatorOutcome("crash", "exit code 3", seconds=1.0, peak_bytes=7)
    found = measure(p2, TRIAL, task, bound, record, outcome, ruler_seconds=0.5)
    assert (found.kind, found.why, found.seconds, found.ruler_seconds) == ("crash", "exit code 3", 1.0, 0.5)
    assert (found.peak_bytes, found.order, found.response) == (7, -1, None)


def test_states_that_cancel_do_not_count():
    noise_apart = innovations_form(Polynomials(B=[0.0, 1.0], F=[1.0, -0.5], C=[1.0, 0.3], D=[1.0, -0.9]), 0.1)
    assert (noise_apart.order, dynamic_order(noise_apart)) == (2, 1)
    cancelling = innovations_form(Polynomials(B=[0.0, 1.0, -0.9], F=np.poly([0.5, 0.9])), 0.1)
    assert (cancelling.order, dynamic_order(cancelling)) == (2, 1)
    delayed = innovations_form(Polynomials(B=[0.0, 0.0, 0.0, 1.0], F=[1.0, -0.5]), 0.1)
    assert dynamic_order(delayed) == 3
    assert dynamic_order(StateSpace([[0.5]], [[0.0]], [[1.0]], [[0.0]], None, 0.1)) == 0


def test_the_normalised_error_of_parameters_of_any_size():
    covariance = np.array([[4.0, 1e-8], [1e-8, 1e-16]])
    error = np.array([2.0, 1e-8])
    assert normalised_error(error, covariance) == pytest.approx(error @ np.linalg.solve(covariance, error))
    assert normalised_error(error, np.diag([1.0, 0.0])) == np.inf
    assert normalised_error(error, np.ones((2, 2))) == np.inf


def test_the_ruler_keeps_the_shortest_time(record: IOData):
    ruler = Ruler(record)
    ruler.measure()
    first = ruler.seconds
    ruler.measure()
    assert 0.0 < ruler.seconds <= first < 10.0
