"""Covariance functions against their definition, and autoregressive models of known processes."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sysid.polynomial.correlation import autoregression, covariance_function


@pytest.mark.parametrize("samples", [7, 30])
def test_definition(samples: int) -> None:
    rng = np.random.default_rng(0)
    x, z = rng.standard_normal((samples, 2)), rng.standard_normal((samples, 3))
    found = covariance_function([x], [z], 5)
    for k, lag in enumerate(range(-5, 6)):
        total = sum(np.outer(x[t + lag], z[t]) for t in range(samples) if 0 <= t + lag < samples)
        np.testing.assert_allclose(found[k], total / samples, atol=1e-13)


def test_experiments_are_added_not_joined() -> None:
    x = np.random.default_rng(1).standard_normal((40, 1))
    parts = [x[:15], x[15:]]
    found = covariance_function(parts, parts, 4)
    expected = (
        15 * covariance_function(parts[:1], parts[:1], 4) + 25 * covariance_function(parts[1:], parts[1:], 4)
    ) / 40
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_known_process() -> None:
    e = lfilter([1.0], [1, -1.2, 0.5], np.random.default_rng(0).standard_normal(50_000))
    whitener, correlations = autoregression(e - e.mean(), 4)
    np.testing.assert_allclose(whitener, [1, -1.2, 0.5, 0, 0], atol=0.03)
    # Yule-Walker: r1 = 1.2 / 1.5, r2 = 1.2 r1 - 0.5
    np.testing.assert_allclose(correlations[:3], [1, 0.8, 0.46], atol=0.02)


def test_a_pure_tone_is_no_accident() -> None:
    whitener, correlations = autoregression(np.sin(0.3 * np.arange(3000)), 10)
    assert np.isfinite(whitener).all()
    assert abs(correlations).max() <= 1.0 + 1e-9
