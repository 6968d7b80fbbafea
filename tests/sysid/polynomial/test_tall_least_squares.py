"""Least squares of many columns: the same as by pivots, dependent columns too."""

import numpy as np
import pytest
from scipy.linalg import lstsq

from sysid.polynomial.least_squares import tall_least_squares


@pytest.mark.parametrize("dependent", [False, True])
def test_it_is_least_squares(dependent: bool) -> None:
    rng = np.random.default_rng(0)
    columns, target = rng.standard_normal((200, 20)), rng.standard_normal(200)
    if dependent:
        columns[:, 7] = columns[:, 3] - columns[:, 5]
    expected = lstsq(columns, target, cond=1e-12)[0]
    before = columns.copy(), target.copy()
    np.testing.assert_allclose(tall_least_squares(columns, target, cond=1e-12), expected, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(columns, before[0])
    np.testing.assert_array_equal(target, before[1])
