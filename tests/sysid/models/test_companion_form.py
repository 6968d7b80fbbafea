"""Polynomial models are run as filters: no digit is lost where poles lie close together near one."""

import numpy as np
import pytest
import scipy
from scipy.signal import lfilter

from sysid import IOData, Polynomials, compare, oe, predict, residuals, simulate
from sysid.models import innovations_form
from sysid.models.companion_form import CompanionForm
from sysid.models.recursion import driven_output, driven_states, free_response, state_trajectory

SAMPLES = 1000
SLOW_POLES = {
    "four": [0.99, 0.98, 0.97, 0.96],
    "eight": [0.99, 0.98, 0.97, 0.96, 0.95, 0.94, 0.93, 0.92],
    "three pairs": [0.99 * np.exp(1j * w) for w in (0.02, 0.04, 0.06, -0.02, -0.04, -0.06)],
    "twelve": [0.999 * np.exp(1j * w) for w in (0.1, 0.3, 0.5, 0.7, 0.9, 1.1, -0.1, -0.3, -0.5, -0.7, -0.9, -1.1)],
}


def slow_input():
    return np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], SAMPLES // 20), 20)


@pytest.fixture(params=SLOW_POLES.values(), ids=SLOW_POLES.keys())
def denominator(request):
    return np.poly(request.param).real


def relative(error, y):
    return float(np.abs(error).max() / np.std(y))


def test_a_model_explains_its_own_data(denominator):
    numerator = np.array([0.0, denominator.sum()])
    u = slow_input()
    y = lfilter(numerator, denominator, u)
    model = innovations_form(Polynomials(B=numerator, F=denominator), 0.01)
    record = IOData(u, y, 0.01)
    assert relative(simulate(model, u)[:, 0] - y, y) <= 1e-9
    assert relative(residuals(model, record)[:, 0], y) <= 1e-9
    assert relative(predict(model, record, steps=7)[:, 0] - y, y) <= 1e-9
    assert compare(model, record)[0].simulation[0] >= 100.0 - 1e-6


@pytest.mark.parametrize("noise", ["arx", "armax", "bj", "1/A after B/F"])
def test_residuals_are_the_innovations(denominator, noise):
    """Of a noise model beside slow poles, with several inputs."""
    rng = np.random.default_rng(1)
    inputs = np.column_stack((slow_input(), rng.choice([-1.0, 1.0], SAMPLES)))
    e = 0.01 * rng.standard_normal(SAMPLES)
    one = np.ones(1)
    B = np.array([[0.0, denominator.sum()], [0.0, 0.5 * denominator.sum()]])
    A, C, D, F = {
        "arx": (denominator, one, one, np.ones((2, 1))),
        "armax": (denominator, np.poly([0.5, -0.3]), one, np.ones((2, 1))),
        "bj": (one, np.array([1.0, 0.3]), np.array([1.0, -0.9]), np.tile(denominator, (2, 1))),
        "1/A after B/F": (np.poly([0.8, 0.7]), one, one, np.tile(denominator, (2, 1))),
    }[noise]
    paths = sum(lfilter(b, f, u) for b, f, u in zip(B, F, inputs.T, strict=True))
    y = lfilter(one, A, paths) + lfilter(C, np.convolve(A, D), e)
    model = innovations_form(Polynomials(A, B, C, D, F), 0.01)
    error = residuals(model, IOData(inputs, y, 0.01), x0=np.zeros(model.order))[:, 0] - e
    assert relative(error, y) <= 1e-9


def test_the_loss_of_an_estimate_is_what_was_minimised(denominator):
    u, rng = slow_input(), np.random.default_rng(2)
    y = lfilter([0.0, denominator.sum()], denominator, u)
    record = IOData(u, y + 0.01 * np.std(y) * rng.standard_normal(SAMPLES), 0.01)
    model = oe(record, 1, len(denominator) - 1, 1)
    minimised = model.diagnostics["sum_of_squares"] / model.diagnostics["rows"]
    assert model.loss == pytest.approx(minimised, rel=1e-3)


def chained_blocks():
    """Two companion blocks, the second of which drives the first; an input into each."""
    A = np.zeros((5, 5))
    A[:2, :2] = [[1.2, 1.0], [-0.5, 0.0]]
    A[2:, 2:] = [[0.4, 1.0, 0.0], [0.3, 0.0, 1.0], [-0.2, 0.0, 0.0]]
    A[:2, 2] = [0.7, -0.1]
    return A, np.random.default_rng(3).standard_normal((5, 2))


def test_filters_agree_with_the_plain_recursion():
    A, B = chained_blocks()
    rng = np.random.default_rng(4)
    C, D = np.array([[1.0, 0.0, 0.5, 0.0, 0.0]]), np.array([[0.2, 0.0]])
    u, x = rng.standard_normal((50, 2)), rng.standard_normal(5)
    x0, states = x, []
    for row in u:
        states.append(x)
        x = A @ x + B @ row
    states = np.array(states)
    np.testing.assert_allclose(driven_states(A, B, u, x0), states, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(driven_output(A, B, C, D, u, x0), states @ C.T + u @ D.T, rtol=1e-12, atol=1e-12)
    powers = np.array([C @ np.linalg.matrix_power(A, t) for t in range(50)])
    np.testing.assert_allclose(free_response(A, C, 50), powers, rtol=1e-12, atol=1e-12)


def test_other_matrices_have_no_companion_form():
    A, _ = chained_blocks()
    loop = A.copy()
    loop[2, 0] = 0.1
    assert CompanionForm.of(A).starts == [2, 0]
    assert CompanionForm.of(loop) is None
    assert CompanionForm.of(scipy.stats.ortho_group.rvs(5, random_state=1)) is None
    # an output of an inner state is not what the filters compute
    C = np.eye(5)[1:2]
    u, x0 = np.ones((20, 1)), np.arange(5.0)
    B, D = np.ones((5, 1)), np.zeros((1, 1))
    expected = state_trajectory(A, u @ B.T, x0) @ C.T
    np.testing.assert_allclose(driven_output(A, B, C, D, u, x0), expected, rtol=1e-12, atol=1e-12)


def test_free_responses_end_where_they_have_died_out_or_overflow():
    quick = free_response(np.array([[0.5]]), np.eye(1), 10**6)
    assert len(quick) == 256
    growing = free_response(np.array([[2.0]]), np.eye(1), 1000)
    assert np.isfinite(growing).all() and growing.max() < 1e100
