"""Covariance functions against the sum that defines them."""

import numpy as np
import pytest

from sysid.polynomial.correlation import covariance_function


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
