"""What functions may return."""

import control
import numpy as np
import pytest

import sysid
from scenarios.estimators.answer import Answer
from scenarios.estimators.model_numbers import answer_of
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import Task

POLYNOMIALS = sysid.Polynomials(B=[0.0, 0.0, 0.2], F=[1.0, -0.8])
MODEL = sysid.models.innovations_form(POLYNOMIALS, 0.02)
SPREAD = np.tile(1e-4 * np.eye(2), (3, 1, 1))[:, None, None]
COVARIANCE = np.diag([1e-4, 2e-4])
ENDS = (np.array([[1.0]]), np.array([[2.0]]))


def answer(value: object, data: sysid.IOData, task: Task) -> Answer:
    return answer_of(numbers_of(value, data, task), data, task)


@pytest.mark.parametrize(
    "value",
    [
        MODEL,
        POLYNOMIALS,
        Answer(MODEL),
        Answer(MODEL, POLYNOMIALS, COVARIANCE),
        control.tf([0.2], [1.0, -0.8, 0.0], 0.02),
        control.tf([0.4, 0.0], [2.0, -1.6, 0.0, 0.0], 0.02),
        MODEL.to_control(),
        (POLYNOMIALS, COVARIANCE),
        (POLYNOMIALS, COVARIANCE, ENDS),
        (MODEL, SPREAD),
        (MODEL, None, ENDS),
        (control.tf([0.2], [1.0, -0.8, 0.0], 0.02), np.diag([1e-4, 2e-4, 0.0])),
    ],
    ids=str,
)
def test_all_forms_are_the_same_model(value: object, data: sysid.IOData, task: Task) -> None:
    got = answer(value, data, task)
    expected = MODEL.frequency_response(task.frequencies)
    np.testing.assert_allclose(got.model.frequency_response(task.frequencies), expected, rtol=1e-12)


def test_claims_go_along(data: sysid.IOData, task: Task) -> None:
    got = answer(Answer(MODEL, POLYNOMIALS, COVARIANCE, SPREAD, ENDS), data, task)
    np.testing.assert_array_equal(got.covariance, COVARIANCE)
    np.testing.assert_array_equal(got.response_covariance, SPREAD)
    np.testing.assert_array_equal(got.bandwidth_ci95, ENDS)
    np.testing.assert_array_equal(got.polynomials.B, POLYNOMIALS.B)
    assert answer((MODEL, SPREAD), data, task).covariance is None


@pytest.mark.parametrize("method", ["n4sid", "pem_ss", "okid"])
def test_estimates_claim_what_they_know(method: str, data: sysid.IOData, task: Task) -> None:
    """`n4sid` knows no covariance; others' covariance of matrices is none of polynomials."""
    start = sysid.n4sid(data, 1)
    estimate = {
        "n4sid": lambda: start,
        "pem_ss": lambda: sysid.pem_ss(data, start),
        "okid": lambda: sysid.okid(data, 1, p=3),
    }
    got = answer(estimate[method](), data, task)
    assert got.covariance is None and got.polynomials is None
    assert (got.response_covariance is None) == (method == "n4sid")
    assert (got.bandwidth_ci95 is None) == (method == "n4sid")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (None, "NoneType given, expected Answer, sysid.Estimate"),
        (np.eye(2), "ndarray given, expected Answer"),
        ((MODEL,), "a tuple of 1 given"),
        ((None, None), "NoneType given"),
        (control.tf([1.0], [1.0, 1.0]), "dt = 0 given"),
        (control.tf([1.0], [1.0, 0.5], True), "a system with dt = True given"),
        (control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), "dt = 0 given"),
        ((MODEL, "much"), "covariance of type <U4 given"),
        ((MODEL, [[1.0], [1.0, 2.0]]), "covariance of type list given"),
        ((MODEL, 1j * SPREAD), "covariance of type complex128 given"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_anything_else_is_no_model(value: object, why: str, data: sysid.IOData, task: Task) -> None:
    with pytest.raises(NoModelError) as caught:
        answer(value, data, task)
    assert caught.value.kind == "malformed" and why in str(caught.value), str(caught.value)


def test_a_fraction_of_several_channels(data: sysid.IOData, task: Task) -> None:
    system = control.tf([[[0.2], [1.0, 0.5]]], [[[1.0, -0.8], [1.0, 0.0, 0.0]]], 0.02)
    record = sysid.IOData(np.random.default_rng(0).standard_normal((50, 2)), np.zeros(50) + 1.0, 0.02)
    got = answer(system, record, task)
    expected = system(np.exp(2j * np.pi * 0.02 * task.frequencies))
    np.testing.assert_allclose(got.model.frequency_response(task.frequencies), np.moveaxis(expected, -1, 0), rtol=1e-12)
