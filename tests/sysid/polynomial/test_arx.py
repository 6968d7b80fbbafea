import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, arx
from sysid.polynomial.regressors import arx_regressors
from tests.refusals import refused
from tests.sysid.systems import second_order


def test_is_the_normal_equations():
    data = second_order()
    estimate = arx(data, 2, 2, 1)
    phi = arx_regressors(data.y[:, 0], data.u, 2, [2], [1], 2)
    theta = np.linalg.solve(phi.T @ phi, phi.T @ data.y[2:, 0])
    errors = data.y[2:, 0] - phi @ theta
    variance = errors @ errors / (398 - 4)
    np.testing.assert_allclose(estimate.parameters, theta, rtol=1e-10)
    np.testing.assert_allclose(estimate.noise_variance, [[variance]], rtol=1e-10)
    np.testing.assert_allclose(estimate.covariance, variance * np.linalg.inv(phi.T @ phi), rtol=1e-8)
    np.testing.assert_allclose(estimate.residuals[2:, 0], errors, atol=1e-10)
    assert estimate.parameter_names == ("a1", "a2", "b1", "b2")
    assert estimate.orders == {"na": 2, "nb": 2, "nk": 1}


def test_two_inputs_with_their_own_delays():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, 2))
    y = lfilter([0, 2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, -0.8], u[:, 1])
    estimate = arx(IOData(u, y, 0.1), 1, [1, 2], [1, 3])
    np.testing.assert_allclose(estimate.parameters, [-0.8, 2.0, 1.0, -0.5], atol=1e-10)
    np.testing.assert_allclose(estimate.polynomials.B, [[0, 2, 0, 0, 0], [0, 0, 0, 1, -0.5]], atol=1e-10)
    assert estimate.parameter_names == ("a1", "b1[1]", "b1[2]", "b2[2]")


def test_experiments_are_never_joined():
    """Offsets in the past of each part would spoil a fit that reached over the seam."""
    data = second_order(1)
    parts = [data[:150], data[150:]]
    theta = arx(parts, 2, 2).parameters
    rows = [arx_regressors(part.y[:, 0], part.u, 2, [2], [1], 2) for part in parts]
    target = np.concatenate([part.y[2:, 0] for part in parts])
    np.testing.assert_allclose(theta, np.linalg.lstsq(np.vstack(rows), target, rcond=None)[0], rtol=1e-9)
    shuffled = arx(parts[::-1], 2, 2)
    np.testing.assert_allclose(shuffled.parameters, theta, rtol=1e-9)
    assert shuffled.data.samples == (250, 150)
    assert shuffled.residuals.shape == (400, 1)


@pytest.mark.parametrize(
    ("orders", "message"),
    [
        ((-1, 1, 1), "na must be"),
        ((1, 0, 1), "nb must be"),
        ((1, 1, -1), "nk must be"),
        ((1, [1, 1], 1), "one per input"),
        ((200, 200, 1), "too many orders"),
    ],
)
def test_bad_orders(orders, message):
    refused(message, arx, second_order(), *orders)
    refused("one output, got 2", arx, IOData(np.arange(9.0), np.ones((9, 2)), 0.1), 1, 1)


def test_dependent_regressors_are_reported():
    """One factor common to A and B is free: one dimension of five."""
    u = np.random.default_rng(0).standard_normal(200)
    with pytest.warns(SysidWarning, match="rank 4 for 5 parameters"):
        estimate = arx(IOData(u, lfilter([0, 1.0], [1, -0.5], u), 0.1)[20:], 3, 2)
    assert estimate.diagnostics["rank"] == 4
    # what can be known is still right
    np.testing.assert_allclose(estimate.model.dc_gain(), [[2.0]], rtol=1e-8)
