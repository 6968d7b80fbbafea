"""Regularised impulse responses and regularised ARX models."""

import numpy as np
import pytest
from scipy.signal import lfilter

import sysid
from sysid import IOData
from sysid.polynomial.regressors import arx_regressors
from sysid.polynomial.regularisation import Evidence, kernel_root
from tests.refusals import refused
from tests.sysid.systems import A, B, losing, second_order

KERNELS = ("tc", "dc", "ss")
RESPONSE = lfilter(B, A, np.eye(1, 60)[0])


def kernel(name, n, c, decay, r=0.0):
    """Kernels by their definitions [ChenOhlssonLjung2012]."""
    lag = np.arange(1, n + 1)
    total, most = np.add.outer(lag, lag), np.maximum.outer(lag, lag)
    if name == "tc":
        return c * decay**most
    return c * (
        decay ** (total / 2) * r ** (2 * most - total)
        if name == "dc"
        else decay ** (total + most) / 2 - decay ** (3 * most) / 6
    )


@pytest.mark.parametrize("name", KERNELS)
def test_roots_and_gradient(name):
    eta = np.array([0.3, np.log(-np.log(0.8)), np.arctanh(-0.4)][: 3 if name == "dc" else 2])
    root, P = kernel_root(name, 30, eta), kernel(name, 30, np.exp(0.3), 0.8, -0.4)
    np.testing.assert_allclose(root @ root.T, P, atol=1e-15 * P.max(), rtol=1e-12)
    rng = np.random.default_rng(0)
    phi = rng.standard_normal((60, 30))
    y = phi @ root @ rng.standard_normal(root.shape[1]) + rng.standard_normal(60)
    evidence = Evidence(phi, y, 60, (30,), name)
    value, gradient = evidence(eta)
    S = phi @ P @ phi.T + np.eye(60)
    np.testing.assert_allclose(value, 60 * np.log(y @ np.linalg.solve(S, y)) + np.linalg.slogdet(S)[1], rtol=1e-10)
    numeric = [(evidence(eta + h)[0] - evidence(eta - h)[0]) / 2e-5 for h in 1e-5 * np.eye(len(eta))]
    np.testing.assert_allclose(gradient, numeric, atol=1e-6)


@pytest.mark.parametrize("name", KERNELS)
def test_is_the_posterior_of_gaussian_regression(name):
    data = second_order(samples=200)
    estimate = sysid.impulseest(data, 60, kernel=name)
    c, *others = estimate.diagnostics["hyper_parameters"][0]
    P, s2 = kernel(name, 60, c, *others), float(estimate.noise_variance[0, 0])
    phi = arx_regressors(data.y[:, 0], data.u, 0, [60], [0], 59)
    gain = P @ phi.T @ np.linalg.inv(phi @ P @ phi.T + s2 * np.eye(len(phi)))
    np.testing.assert_allclose(estimate.parameters, gain @ data.y[59:, 0], atol=1e-7)
    np.testing.assert_allclose(estimate.covariance, P - gain @ phi @ P, atol=1e-7)
    assert np.isclose(estimate.diagnostics["effective_parameters"], np.trace(phi @ gain))
    assert estimate.diagnostics["converged"]
    np.testing.assert_array_equal(estimate.model.impulse_response(60)[:, 0, 0], estimate.parameters)


@pytest.mark.slow
def test_exact_without_noise_and_without_prior():
    data = second_order(noise=0.0, samples=600)
    for name in (None, *KERNELS):
        tolerance = 1e-3 if name else 1e-2
        g = sysid.impulseest(data, 60, kernel=name).parameters
        np.testing.assert_allclose(g, RESPONSE, atol=tolerance)
    free, arx = sysid.impulseest(data, 20, 1, kernel=None), sysid.arx(data, 0, 20, 1)
    np.testing.assert_array_equal(free.parameters, arx.parameters)


def test_a_response_that_has_not_decayed_is_reported_and_printed():
    data = second_order(samples=400)
    with pytest.warns(sysid.SysidWarning, match="u1 has not decayed after 5 coefficients"):
        short = sysid.impulseest(data, 5)
    assert "b1  " in str(short) and "finite impulse response of 5 samples" in str(short)
    assert "(21 of 60 rows)" in str(long := sysid.impulseest(data, 60))
    assert not long.diagnostics["warnings"]


def test_beats_least_squares_on_short_records():
    data = second_order(samples=120, noise=2.0, d=[1.0])
    errors = {
        name: np.linalg.norm(sysid.impulseest(data, 50, kernel=name).parameters - RESPONSE[:50])
        for name in (None, *KERNELS)
    }
    assert max(errors[name] for name in KERNELS) < 0.5 * errors[None]
    assert len(sysid.impulseest(data, 100).parameters) > len(data) - 99  # fewer equations than unknowns


@pytest.mark.slow
def test_several_inputs_have_their_own_decay():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, 2))
    slow, fast = 0.95 ** np.arange(80), 3.0 * 0.5 ** np.arange(80)
    y = lfilter(slow, [1.0], u[:, 0]) + lfilter([0.0, *fast], [1.0], u[:, 1]) + 0.3 * rng.standard_normal(500)
    estimate = sysid.impulseest(losing(IOData(u, y, 1.0), slice(100, 103)), 80, (0, 1))
    decay = estimate.diagnostics["hyper_parameters"][:, 1]
    assert decay[0] > 0.8 > 0.6 > decay[1]
    g = estimate.model.impulse_response(80)[:, 0]
    np.testing.assert_allclose(g, np.column_stack((slow, [0.0, *fast[:-1]])), atol=0.12)
    assert sysid.plots.impulse(estimate, input=0).axes


def test_regularised_arx():
    data = second_order(samples=150)
    free, regular = (sysid.arx(data, 15, 15, 1, regularisation=kernel) for kernel in (None, "tc"))
    errors = [np.linalg.norm(e.model.impulse_response(60)[:, 0, 0] - RESPONSE) for e in (free, regular)]
    assert errors[1] < 0.8 * errors[0]
    assert regular.diagnostics["hyper_parameters"].shape == (2, 2)
    assert 0.0 < regular.diagnostics["effective_parameters"] < 30.0
    assert regular.fpe < free.fpe


def test_refusals():
    data = second_order(samples=100)
    refused("kernel must be one of tc, dc, ss, got 'rbf'", sysid.impulseest, data, 20, kernel="rbf")
    refused("n must be", sysid.impulseest, data, 0)
    refused("reach back 199 samples", sysid.impulseest, data, 200)
    refused("too many orders", sysid.impulseest, data, 60, kernel=None)
    refused("regularisation=None", sysid.arx, data, 2, 2, coloured=True, regularisation="tc")
    refused("output y1 is constant", sysid.impulseest, data.subtract(y=data.y), 20)
    refused("one output", sysid.impulseest, IOData(data.u, np.hstack((data.y, data.y**2)), 0.1), 20)
    refused("time series", sysid.impulseest, IOData(None, data.y, 0.1), 20)
