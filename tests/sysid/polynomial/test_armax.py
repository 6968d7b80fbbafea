"""ARMAX: exact recovery, efficiency, coverage, robustness."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sysid import IOData, SysidError, armax
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import minimise

GRID = np.linspace(0.1, 24.0, 40)


@pytest.mark.filterwarnings("ignore:the parameters are poorly determined")
@pytest.mark.parametrize("nk", range(4))
@pytest.mark.parametrize("order", range(1, 7))
def test_exact_without_noise(exact_system: Callable[[int, int], Any], order: int, nk: int) -> None:
    truth = exact_system(order, nk)
    estimate = armax(truth.data, order, order, order, nk)
    g = truth.response(GRID)
    np.testing.assert_allclose(estimate.model.frequency_response(GRID)[:, 0, 0], g, atol=1e-8 * np.abs(g).max())
    assert estimate.diagnostics["converged"]


def test_efficient_and_covered(p3: Any) -> None:
    """Normalised error of the parameters is chi-square with as many degrees of freedom, over the Cramer-Rao bound."""
    information = p3.information()
    true_hz = p3.model.bandwidth()[0, 0]
    normalised, hits, bandwidths = [], [], []
    for seed in range(150):
        estimate = armax(p3.draw(seed), 2, 2, 2, 1)
        error = estimate.parameters - p3.parameters
        normalised.append(error @ information @ error / len(error))
        hits.append(np.abs(error) <= 1.96 * np.sqrt(np.diag(estimate.covariance)))
        bandwidths.append(bool(estimate.bandwidth().covers(true_hz)[0, 0]))
        assert estimate.diagnostics["converged"]
    # three standard deviations of a mean of 150 chi-squares / 6, and of 900 correlated hits
    assert 0.85 < np.mean(normalised) < 1.15
    assert 0.92 < np.mean(hits) < 0.975
    assert np.mean(bandwidths) > 0.90


# in so short a record C sometimes wants to leave the unit circle
@pytest.mark.filterwarnings("ignore:armax did not converge", "ignore:C has a root")
def test_noise_variance_is_unbiased(p3: Any) -> None:
    found = [float(armax(p3.draw(seed)[:120], 2, 2, 2).noise_variance[0, 0]) for seed in range(60)]
    # standard deviation of one estimate is sqrt(2 / 114)
    assert np.mean(found) == pytest.approx(1.0, abs=3 * np.sqrt(2 / 114 / 60))


def test_published_yaw_model(p1: Any) -> None:
    """Single coefficients of it are hardly known; the joint error is as it should be, and so is the bandwidth."""
    information = p1.information()
    normalised = []
    for seed in range(20):
        estimate = armax(p1.draw(seed), 5, 3, 5, 2)
        error = estimate.parameters - p1.parameters
        normalised.append(error @ information @ error / len(error))
        hz = estimate.bandwidth()
        assert hz.hz[0, 0] == pytest.approx(p1.model.bandwidth()[0, 0], rel=0.15)
        assert np.all(np.abs(np.roots(estimate.polynomials.C)) < 1.0)
    assert 0.6 < np.mean(normalised) < 1.4


def test_stops_at_the_optimum_from_any_start(p3: Any) -> None:
    data = p3.draw(7)
    estimate = armax(data, 2, 2, 2, 1)
    best = minimise([data], make_orders(1, na=2, nb=2, nc=2, nk=1), p3.parameters)
    assert estimate.diagnostics["sum_of_squares"] <= best.at.cost * (1 + 1e-8)
    np.testing.assert_allclose(estimate.parameters, best.at.theta, rtol=1e-3)


def test_scaling_the_channels_scales_the_model(p3: Any) -> None:
    data = p3.draw(1)
    plain = armax(data, 2, 2, 2)
    scaled = armax(IOData(1e3 * data.u, 1e-2 * data.y, data.dt), 2, 2, 2)
    factor = np.array([1, 1, 1e-5, 1e-5, 1, 1])
    np.testing.assert_allclose(scaled.parameters, plain.parameters * factor, rtol=1e-3)
    np.testing.assert_allclose(scaled.noise_variance, 1e-4 * plain.noise_variance, rtol=1e-6)


def test_two_experiments(p3: Any) -> None:
    data = p3.draw(2)
    whole, parts = armax(data, 2, 2, 2), armax([data[:900], data[900:]], 2, 2, 2)
    # a few initial conditions are all the difference
    deviation = np.sqrt(np.diag(whole.covariance))
    assert np.all(np.abs(whole.parameters - parts.parameters) < 0.3 * deviation)
    np.testing.assert_allclose(np.sqrt(np.diag(parts.covariance)), deviation, rtol=0.05)
    swapped = armax([data[900:], data[:900]], 2, 2, 2)
    np.testing.assert_allclose(swapped.parameters, parts.parameters, atol=1e-3 * deviation.max())


def test_too_many_orders(p3: Any) -> None:
    with pytest.raises(SysidError, match="too many orders for the data"):
        armax(p3.draw(0)[:20], 8, 8, 8)
