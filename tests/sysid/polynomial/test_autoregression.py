"""Autoregressive models of a known process."""

import numpy as np
from scipy.signal import lfilter

from sysid.polynomial.correlation import autoregression


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
