from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import InitialConditions, IOData, Polynomials, StateSpace, armax, bj, oe, pem_ss, simulate
from sysid.models import innovations_form
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import linearise
from tests.refusals import refused
from tests.sysid.systems import CORRELATED_OUTPUTS, A, B, covered, joint_normal, losing, near, second_order

C, D = [1.0, -0.6, 0.2], [1.0, -0.9]
record = partial(second_order, samples=600, c=C, settle=100, lost=0.25)


CASES = [
    (make_orders(1, na=2, nb=2, nc=2, nk=1), [-1.45, 0.65, 1.0, 0.4, -0.5, 0.1]),
    (make_orders(1, nb=2, nf=2, nk=1), [1.0, 0.4, -1.45, 0.65]),
    (make_orders(1, nb=2, nc=1, nd=2, nf=2, nk=1), [1.0, 0.4, -0.5, -1.4, 0.6, -1.45, 0.65]),
    (make_orders(1, na=3, nb=2, nc=1, nk=1), [-1.45, 0.65, 0.1, 1.0, 0.4, -0.5]),
]


@pytest.mark.parametrize(("orders", "theta"), CASES)
def test_criterion_is_the_likelihood_of_what_is_known(orders, theta):
    """Sum of squares and determinant of the joint normal distribution of the known outputs, begun at rest."""
    data = record(1, samples=150)
    at = linearise([data], orders, np.array(theta), InitialConditions.ZERO)
    model = innovations_form(orders.polynomials(np.array(theta)), data.dt, 1.0)
    mean, covariance = joint_normal(model, data, np.zeros(model.order))
    known = data.known[:, 0]
    root = np.linalg.cholesky(covariance[np.ix_(known, known)])
    white = np.linalg.solve(root, (data.y[:, 0] - mean)[known])
    assert at.errors == known.sum()
    assert at.sum_of_squares == pytest.approx(white @ white, rel=1e-9)
    assert np.log(at.inflation) * at.errors == pytest.approx(2.0 * np.log(np.diag(root)).sum(), rel=1e-9, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("initial_conditions", [InitialConditions.ESTIMATED, InitialConditions.ZERO])
@pytest.mark.parametrize(("orders", "theta"), CASES)
@pytest.mark.parametrize("lead", [0, 1, 5])
def test_gradient_is_exact(orders, theta, initial_conditions, lead):
    first = replace(losing(record(2, samples=150), slice(lead)), window=3 if lead == 1 else 0)
    data = [first, record(3, samples=90)]
    at = linearise(data, orders, np.array(theta), initial_conditions)
    steps = 1e-5 * np.eye(len(theta))
    ends = [[linearise(data, orders, theta + s * step, initial_conditions).cost for s in (1, -1)] for step in steps]
    expected = np.array([(up - down) / 2e-5 for up, down in ends])
    gradient = 2.0 * at.scale * (at.triangle.T @ at.target)
    np.testing.assert_allclose(gradient, expected, atol=1e-6 * np.abs(expected).max())


FITS = [
    (lambda data: armax(data, 2, 2, 2), {}, [*A[1:], *B[1:], *C[1:]]),
    (lambda data: oe(data, 2, 2), {"c": [1.0], "d": [1.0]}, [*B[1:], *A[1:]]),
    (lambda data: bj(data, 2, 1, 1, 2), {"c": [1.0, 0.5], "d": D}, [*B[1:], 0.5, *D[1:], *A[1:]]),
]


@pytest.mark.thorough
@pytest.mark.parametrize("bursts", [False, True])
@pytest.mark.parametrize("case", range(3))
def test_errors_are_as_large_as_their_covariance(case, bursts):
    fit, options, truth = FITS[case]
    squares, variances = [], []
    for seed in range(20):
        estimate = fit(record(seed, bursts=bursts, **options))
        error = estimate.parameters - truth
        squares.append(error @ np.linalg.solve(estimate.covariance, error) / len(truth))
        variances.append(estimate.noise_variance[0, 0])
    # 20 times at least four chi-squares: a standard error of at most 0.16
    assert np.mean(squares) == pytest.approx(1.0, abs=0.45)
    assert np.mean(variances) == pytest.approx(1.0, abs=0.06)


def test_nothing_missing_is_the_complete_record():
    data = record(4)
    y = np.nan_to_num(data.y)
    for fit, _, _ in FITS:
        opened, whole = (fit(IOData(data.u, y, 0.1, missing=missing)).parameters for missing in (True, False))
        np.testing.assert_array_equal(opened, whole)


def test_several_records_a_window_and_residuals():
    first, second = record(5), record(6)
    windowed = IOData(first.u, first.y, 0.1, missing=True, window=50)
    estimate = armax([windowed, second], 2, 2, 2)
    np.testing.assert_allclose(estimate.parameters, [*A[1:], *B[1:], *C[1:]], atol=0.2)
    np.testing.assert_array_equal(np.isnan(estimate.residuals), np.isnan(np.vstack((first.y, second.y))))
    assert estimate.diagnostics["rows"] == int(first.known[50:].sum() + second.known.sum())
    exact = IOData(first.u, np.where(first.known[:, 0], lfilter(B, A, first.u[:, 0]), np.nan), 0.1, missing=True)
    np.testing.assert_allclose(armax(exact, 2, 2, 0).parameters, [*A[1:], *B[1:]], atol=1e-8)
    np.testing.assert_allclose(oe(exact, 2, 2).parameters, [*B[1:], *A[1:]], atol=1e-8)


def test_backcasting_over_gaps_is_refused():
    backcast = partial(armax, initial_conditions=InitialConditions.BACKCAST)
    refused(r"BACKCAST needs complete outputs.*complete_parts", backcast, record(0), 2, 2, 2)


def test_state_space_agrees_with_armax_and_its_covariance():
    data = record(9, samples=1000)
    polynomials = armax(data, 2, 2, 2)
    refined = pem_ss(data, polynomials, direct=False)
    f = np.array([0.1, 0.5, 1.0, 3.0])
    a, b = (estimate.frequency_response(f) for estimate in (polynomials, refined))
    np.testing.assert_allclose(b.response, a.response, rtol=0.01)
    np.testing.assert_allclose(b.covariance, a.covariance, rtol=0.1, atol=1e-3 * np.abs(a.covariance).max())
    np.testing.assert_allclose(refined.noise_variance, polynomials.noise_variance, rtol=0.01)


@pytest.mark.slow
def test_two_outputs_that_miss_different_samples():
    f, model = np.array([0.1, 0.5, 1.0, 2.0, 4.0]), CORRELATED_OUTPUTS
    disturbance = StateSpace(model.A, model.gain, model.C, np.eye(2), None, model.dt)
    hits, variances = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        e = rng.multivariate_normal([0.0, 0.0], model.innovation_covariance, 500)
        u = rng.standard_normal((500, 1))
        data = losing(IOData(u, simulate(model, u) + simulate(disturbance, e), 0.1), rng.random((500, 2)) < 0.25)
        estimate = pem_ss(data, model)
        truth = np.abs(model.frequency_response(f))
        hits.append(covered(estimate.frequency_response(f).magnitude_ci95(), truth))
        variances.append(estimate.noise_variance)
    assert np.mean(hits) > 0.8
    np.testing.assert_allclose(np.mean(variances, axis=0), [[1.0, 0.5], [0.5, 1.0]], atol=0.1)
    assert estimate.residuals.shape == (500, 2)
    np.testing.assert_array_equal(np.isnan(estimate.residuals), np.isnan(data.y))


def test_regressions_leave_out_what_touches_a_gap():
    data = record(10, samples=3000)
    estimate = sysid.iv4(data, 2, 2)
    assert near(estimate, [*A[1:], *B[1:]], 3.5)
    f = np.array([0.1, 0.5, 1.0, 3.0])
    truth = innovations_form(Polynomials(A, B, C, [1.0], [1.0]), 0.1).frequency_response(f)
    np.testing.assert_allclose(sysid.okid(data, 2, p=5).model.frequency_response(f), truth, rtol=0.4)
    refused(r"too many missing samples.*pem_ss", lambda: sysid.okid(data, 2, p=60))
    refused("too many missing samples", lambda: sysid.iv4(record(0, samples=40), 4, 4))
