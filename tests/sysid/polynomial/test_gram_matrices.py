"""Sums over lagged signals against the products of all rows."""

import numpy as np
import pytest

from sysid.polynomial.gram_matrices import hankel_moments, lagged_sums


def rows_of(z, blocks):
    return np.array([z[t : t + blocks].ravel() for t in range(len(z) - blocks + 1)])


@pytest.mark.parametrize(
    ("samples", "channels", "blocks"), [(1, 2, 1), (9, 1, 9), (40, 3, 20), (41, 3, 20), (500, 2, 7)]
)
def test_moments_are_those_of_all_rows(samples, channels, blocks):
    rng = np.random.default_rng(samples)
    signals = [rng.standard_normal((samples, channels)), rng.standard_normal((samples + 13, channels))]
    rows = np.vstack([rows_of(z, blocks) for z in signals])
    moments = hankel_moments(signals, blocks)
    np.testing.assert_allclose(moments, rows.T @ rows / len(rows), atol=1e-13)
    np.testing.assert_array_equal(moments, moments.T)


def test_sums_at_all_lags():
    rng = np.random.default_rng(0)
    s, z = rng.standard_normal((100, 2)), rng.standard_normal((100, 3))
    expected = [s[:91].T @ z[lag : lag + 91] for lag in range(10)]
    np.testing.assert_allclose(lagged_sums(s, z, 10), expected, atol=1e-12)
