"""Measures of an answer: right for the truth, for a known error, and for one of our own estimates."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.bench.measurement import Measurement, dynamic_order, measure
from scenarios.estimators import model_numbers
from scenarios.estimators.outcome import Answer, EstimatorOutcome
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.returned import numbers_of
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial
from sysid import Polynomials, StateSpace, bj, oe
from sysid.models import innovations_form

TRIAL = Trial("p2@600", 0)
P2 = problem(TRIAL.problem)
TASK, BOUND = P2.task("oe"), P2.bound("oe")


@pytest.fixture(scope="module")
def record():
    return P2.draw(TRIAL.seed(0))


@pytest.fixture(scope="module")
def estimate(record):
    return oe(record, TASK.orders["nb"], TASK.orders["nf"], TASK.orders["nk"])


def measured(record, answer, ask="fit"):
    outcome = EstimatorOutcome("model", answer=answer, seconds=2.0)
    return measure(P2, replace(TRIAL, ask=ask), TASK, record, outcome)


def answer_of(estimate):
    data = P2.draw(TRIAL.seed(0))
    return model_numbers.answer_of(numbers_of(estimate, data, TASK), data, TASK)


def test_one_of_our_estimates(record, estimate):
    one = measured(record, answer_of(estimate))
    error = estimate.parameters - BOUND.parameters
    assert one.normalised_error == pytest.approx(error @ np.linalg.solve(estimate.covariance, error))
    assert one.covered == (np.abs(error) < 1.96 * np.sqrt(np.diag(estimate.covariance))).sum()
    assert (one.parameters, one.order, one.seconds) == (4, 2, 2.0)
    known = estimate.frequency_response(P2.frequencies)
    assert one.response_covariance == pytest.approx(known.covariance, rel=1e-9)
    assert one.bandwidth_ci95 == pytest.approx(np.stack(estimate.bandwidth().ci95))
    assert 0.0 < one.whiteness_p < 1.0 and 0.0 < one.independence_p < 1.0
    assert str(Measurement.from_table(one.to_table()).to_table()) == str(one.to_table())


def test_claims_of_its_own_count_before_those_derived(record, estimate):
    own = np.zeros((len(P2.frequencies), 1, 1, 2, 2))
    ends = (np.array([[1.0]]), np.array([[2.0]]))
    one = measured(record, Answer(estimate.model, None, None, own, ends))
    assert (one.response_covariance == own).all()
    assert one.bandwidth_ci95.ravel().tolist() == [1.0, 2.0]
    assert np.isnan(one.normalised_error) and (one.parameters, one.covered) == (0, -1)


def test_the_truth_itself(record):
    one = measured(record, Answer(P2.truth, BOUND.polynomials, BOUND.covariance))
    assert (one.normalised_error, one.covered) == (0.0, 4)
    assert (one.response == P2.truth.frequency_response(P2.frequencies)).all()


def test_errors_of_parameters_need_the_orders_of_the_task(record, estimate, monkeypatch):
    chosen, other = measured(record, answer_of(estimate), "select"), measured(record, answer_of(bj(record, 2, 1, 1, 2)))
    monkeypatch.setattr(type(P2), "bound", lambda self, structure: None)
    for one, parameters in ((measured(record, answer_of(estimate)), 4), (chosen, 4), (other, 6)):
        assert np.isnan(one.normalised_error) and (one.parameters, one.covered) == (parameters, -1)


def test_without_a_model_of_the_noise_whiteness_is_not_tested(record, estimate):
    bare = replace(estimate.model, K=None, innovation_covariance=None)
    one = measured(record, Answer(bare))
    assert np.isnan(one.whiteness_p) and 0.0 < one.independence_p < 1.0
    # output error: white
    assert 0.0 < measured(record, Answer(bare, estimate.polynomials)).whiteness_p < 1.0
    arx = Polynomials(A=estimate.polynomials.F, B=estimate.polynomials.B)
    assert np.isnan(measured(record, Answer(bare, arx)).whiteness_p)


def test_answers_without_numbers(record, estimate):
    one = measured(record, Answer(estimate.model, estimate.polynomials, np.eye(9)))
    assert one.kind == "malformed" and "covariance of shape (9, 9) given" in one.why
    outcome = EstimatorOutcome("crash", "exit code 3", seconds=1.0, peak_bytes=7)
    one = measure(P2, TRIAL, TASK, record, outcome, ruler_seconds=0.5)
    assert (one.kind, one.why, one.seconds, one.ruler_seconds) == ("crash", "exit code 3", 1.0, 0.5)
    assert (one.peak_bytes, one.order, one.response) == (7, -1, None)


@pytest.mark.parametrize(
    ("polynomials", "states", "order"),
    [
        # poles of the noise alone, and those that cancel, do not count; a delay does
        (Polynomials(B=[0.0, 1.0], F=[1.0, -0.5], C=[1.0, 0.3], D=[1.0, -0.9]), 2, 1),
        (Polynomials(B=[0.0, 1.0, -0.9], F=np.poly([0.5, 0.9])), 2, 1),
        (Polynomials(B=[0.0, 0.0, 0.0, 1.0], F=[1.0, -0.5]), 3, 3),
    ],
)
def test_states_that_cancel_do_not_count(polynomials, states, order):
    model = innovations_form(polynomials, 0.1)
    assert (model.order, dynamic_order(model)) == (states, order)
    assert dynamic_order(StateSpace([[0.5]], [[0.0]], [[1.0]], [[0.0]], None, 0.1)) == 0


def test_the_reference_time_is_the_shortest(record):
    ruler = Ruler(record)
    ruler.measure()
    first = ruler.seconds
    ruler.measure()
    assert 0.0 < ruler.seconds <= first < 10.0
