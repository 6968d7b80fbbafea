"""One delay convention for every method."""

from collections.abc import Callable

import numpy as np
import pytest

import sysid
from sysid.polynomial.regressors import arx_regressors, first_row, lagged

METHODS: dict[str, Callable[[sysid.IOData, int], sysid.StateSpace]] = {
    "arx": lambda data, nk: sysid.arx(data, 1, 1, nk).model,
    "armax": lambda data, nk: sysid.armax(data, 1, 1, 1, nk).model,
    "oe": lambda data, nk: sysid.oe(data, 1, 1, nk).model,
    "okid": lambda data, nk: sysid.okid(data, max(nk, 1), p=nk + 2).model,
}


# without noise, OKID's regressors are always dependent once p exceeds the order
@pytest.mark.filterwarnings("ignore:the regressors have rank")
@pytest.mark.parametrize("nk", [0, 1, 2, 3])
@pytest.mark.parametrize("method", METHODS)
def test_the_first_response_comes_after_nk_samples(method: str, nk: int) -> None:
    """y(t) = 0.6 y(t-1) + 2 u(t-nk), whose pulse response is nk zeros, then 2, 1.2, ..."""
    u = np.random.default_rng(nk).standard_normal(300)
    y = np.zeros(300)
    for t in range(300):
        y[t] = (0.6 * y[t - 1] if t else 0.0) + (2.0 * u[t - nk] if t >= nk else 0.0)
    model = METHODS[method](sysid.IOData(u, y, 0.1)[20:], nk)
    expected = np.concatenate((np.zeros(nk), 2.0 * 0.6 ** np.arange(4)))
    np.testing.assert_allclose(model.markov(nk + 4)[:, 0, 0], expected, atol=1e-10)


@pytest.mark.parametrize("nk", [0, 1, 3])
def test_b_carries_its_leading_zeros(nk: int) -> None:
    u = np.random.default_rng(1).standard_normal(200)
    y = np.roll(u, nk) + 0.1 * np.random.default_rng(2).standard_normal(200)
    data = sysid.IOData(u, y, 0.1)
    for estimate in (sysid.arx(data, 1, 2, nk), sysid.armax(data, 1, 2, 1, nk), sysid.oe(data, 2, 1, nk)):
        assert estimate.polynomials is not None
        np.testing.assert_array_equal(estimate.polynomials.B[:nk], np.zeros(nk))
        assert estimate.polynomials.B[nk] == pytest.approx(1.0, abs=0.1)


def test_rows_by_hand() -> None:
    y, u = np.arange(10.0, 16.0), np.arange(6.0)
    start = first_row(2, [2], [1])
    assert start == 2
    phi = arx_regressors(y, u[:, None], 2, [2], [1], start)
    np.testing.assert_array_equal(phi[0], [-11, -10, 1, 0])
    np.testing.assert_array_equal(phi[-1], [-14, -13, 4, 3])
    np.testing.assert_array_equal(lagged(u, range(1), 0)[:, 0], u)
    assert first_row(1, [3], [0], window=9) == 9
