"""Prediction-error estimates reach the Cramer-Rao bound, and their intervals cover."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, armax, bj, oe
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import minimise
from tests.sysid.systems import near


@pytest.mark.slow
@pytest.mark.parametrize(
    ("identify", "c", "d", "noise"),
    [
        (lambda e: oe(e, [1, 2], [1, 2], [1, 2]), [1.0], [1.0], []),
        (lambda e: bj(e, [1, 2], 1, 1, [1, 2], [1, 2]), [1, 0.5], [1, -0.8], [0.5, -0.8]),
    ],
    ids=["oe", "bj"],
)
def test_two_inputs_two_experiments(identify, c, d, noise):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((3000, 2))
    y = lfilter([0, 1.0], [1, -0.9], u[:, 0]) + lfilter([0, 0, 0.5, 0.2], [1, -0.5, 0.3], u[:, 1])
    data = IOData(u, y + lfilter(c, d, 0.3 * rng.standard_normal(3000)), 0.1)
    estimate = identify([data[100:1500], data[1500:]])
    truth = np.array([1.0, 0.5, 0.2, *noise, -0.9, -0.5, 0.3])
    names = ("b1[1]", "b1[2]", "b2[2]", *(("c1", "d1") if noise else ()), "f1[1]", "f1[2]", "f2[2]")
    assert estimate.parameter_names == names
    assert near(estimate, truth)
    assert estimate.noise_variance[0, 0] == pytest.approx(0.09, rel=0.12)


# in so short a record C sometimes wants to leave the unit circle
@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:armax did not converge", "ignore:C has a root")
def test_noise_variance_is_unbiased(p3):
    variances = [float(armax(p3.draw(seed)[:120], 2, 2, 2).noise_variance[0, 0]) for seed in range(60)]
    # standard deviation of one estimate is sqrt(2 / 114)
    assert np.mean(variances) == pytest.approx(1.0, abs=3 * np.sqrt(2 / 114 / 60))


@pytest.mark.thorough
def test_published_yaw_model(p1):
    """Single coefficients of it are hardly known; the joint error is as it should be, and so is the bandwidth."""
    information = np.linalg.inv(p1.bound.covariance)
    normalised = []
    for seed in range(20):
        estimate = armax(p1.draw(seed), 5, 3, 5, 2)
        error = estimate.parameters - p1.bound.parameters
        normalised.append(error @ information @ error / len(error))
        hz = estimate.bandwidth()
        assert hz.hz[0, 0] == pytest.approx(p1.truth.bandwidth()[0, 0], rel=0.15)
        assert np.all(np.abs(np.roots(estimate.polynomials.C)) < 1.0)
    assert 0.6 < np.mean(normalised) < 1.4


def test_stops_at_the_optimum_from_any_start(p3):
    data = p3.draw(7)
    estimate = armax(data, 2, 2, 2, 1)
    best = minimise([data], make_orders(1, na=2, nb=2, nc=2, nk=1), p3.bound.parameters)
    assert estimate.diagnostics["sum_of_squares"] <= best.at.cost * (1 + 1e-8)
    np.testing.assert_allclose(estimate.parameters, best.at.theta, rtol=1e-3)
