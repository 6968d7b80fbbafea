"""ARMAX: exact recovery, efficiency, coverage, robustness."""

from typing import Any

import numpy as np
import pytest

from sysid import armax
from sysid.polynomial.orders import make_orders
from sysid.polynomial.prediction_error import minimise
from tests.sysid.refusals import refused

GRID = np.linspace(0.1, 24.0, 40)


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


def test_too_many_orders(p3: Any) -> None:
    refused("too many orders for the data", lambda: armax(p3.draw(0)[:20], 8, 8, 8))
