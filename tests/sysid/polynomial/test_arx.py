"""ARX: exact recovery, the textbook formula, refusals."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid import IOData, SysidWarning, arx
from sysid.polynomial.regressors import arx_regressors
from tests.sysid.refusals import refused

GRID = np.linspace(0.1, 24.0, 40)


def noisy(seed: int = 0, samples: int = 400) -> IOData:
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((2, samples))
    return IOData(u, lfilter([0, 1.0, 0.5], [1, -1.5, 0.7], u) + lfilter([1.0], [1, -1.5, 0.7], e), 0.1)


def test_is_the_normal_equations() -> None:
    data = noisy()
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


def test_intervals_cover() -> None:
    truth = np.array([-1.5, 0.7, 1.0, 0.5])
    hits = []
    for seed in range(300):
        estimate = arx(noisy(seed), 2, 2)
        hits.append(np.abs(estimate.parameters - truth) <= 1.96 * np.sqrt(np.diag(estimate.covariance)))
    # 1200 correlated trials at 95 %
    assert 0.93 < np.mean(hits) < 0.97


def test_two_inputs_with_their_own_delays() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, 2))
    y = lfilter([0, 2.0], [1, -0.8], u[:, 0]) + lfilter([0, 0, 0, 1.0, -0.5], [1, -0.8], u[:, 1])
    estimate = arx(IOData(u, y, 0.1), 1, [1, 2], [1, 3])
    np.testing.assert_allclose(estimate.parameters, [-0.8, 2.0, 1.0, -0.5], atol=1e-10)
    np.testing.assert_allclose(estimate.polynomials.B, [[0, 2, 0, 0, 0], [0, 0, 0, 1, -0.5]], atol=1e-10)
    assert estimate.parameter_names == ("a1", "b1[1]", "b1[2]", "b2[2]")


def test_experiments_are_never_joined() -> None:
    """Offsets in the past of each part would spoil a fit that reached over the seam."""
    data = noisy(1)
    parts = [data[:150], data[150:]]
    theta = arx(parts, 2, 2).parameters
    rows = [arx_regressors(part.y[:, 0], part.u, 2, [2], [1], 2) for part in parts]
    target = np.concatenate([part.y[2:, 0] for part in parts])
    np.testing.assert_allclose(theta, np.linalg.lstsq(np.vstack(rows), target, rcond=None)[0], rtol=1e-9)
    shuffled = arx(parts[::-1], 2, 2)
    np.testing.assert_allclose(shuffled.parameters, theta, rtol=1e-9)
    assert shuffled.data.samples == (250, 150)
    assert shuffled.residuals.shape == (400, 1)


def test_the_window_enters_no_row() -> None:
    data = noisy(2)
    spoilt = data.y.copy()
    spoilt[:40] += 100.0
    window = IOData(data.u, spoilt, data.dt, window=42)
    np.testing.assert_allclose(arx(window, 2, 2).parameters, arx(data[40:], 2, 2).parameters, rtol=1e-9)


@pytest.mark.parametrize(
    ("orders", "message"),
    [
        ((-1, 1, 1), "na must be"),
        ((1, 0, 1), "nb must be"),
        ((1, 1, -1), "nk must be"),
        ((1.5, 1, 1), "na must be"),
        ((True, 1, 1), "na must be"),
        ((1, [1, 1], 1), "one per input"),
        ((200, 200, 1), "too many orders"),
    ],
)
def test_bad_orders(orders: tuple[Any, Any, Any], message: str) -> None:
    refused(message, lambda: arx(noisy(), *orders))


def test_several_outputs_are_refused() -> None:
    refused("one output, got 2", lambda: arx(IOData(np.arange(9.0), np.ones((9, 2)), 0.1), 1, 1))


def test_dependent_regressors_are_said() -> None:
    """One factor common to A and B is free: one dimension of five."""
    u = np.random.default_rng(0).standard_normal(200)
    with pytest.warns(SysidWarning, match="rank 4 for 5 parameters"):
        estimate = arx(IOData(u, lfilter([0, 1.0], [1, -0.5], u), 0.1)[20:], 3, 2)
    assert estimate.diagnostics["rank"] == 4
    # what can be known is still right
    np.testing.assert_allclose(estimate.model.dc_gain(), [[2.0]], rtol=1e-8)
