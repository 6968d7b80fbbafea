"""Eigensystem realisation, plain and with data correlations."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from sysid import StateSpace, SysidWarning, era, era_dc
from sysid.subspace import Realisation
from tests.sysid.refusals import refused

METHODS: dict[str, Callable[..., Realisation]] = {
    "era": era,
    "era_dc": era_dc,
    "era_dc, four lags": partial(era_dc, lags=4),
}
GRID = np.linspace(0.0, 25.0, 30)


def multivariable() -> StateSpace:
    rng = np.random.default_rng(0)
    A = np.diag([0.9, 0.7, -0.4, 0.1])
    A[0, 1], A[1, 0] = 0.3, -0.3
    return StateSpace(
        A, rng.standard_normal((4, 2)), rng.standard_normal((3, 4)), rng.standard_normal((3, 2)), None, 0.02
    )


@pytest.mark.parametrize("method", METHODS)
def test_exact_from_exact_markov_parameters(method: str) -> None:
    truth = multivariable()
    found = METHODS[method](truth.markov(41), 4, dt=0.02)
    np.testing.assert_allclose(
        found.model.frequency_response(GRID), truth.frequency_response(GRID), rtol=1e-8, atol=1e-9
    )
    np.testing.assert_allclose(np.sort_complex(found.model.poles()), np.sort_complex(truth.poles()), atol=1e-8)
    assert found.percent_described == pytest.approx(100.0, abs=1e-10)


def test_one_lag_is_era_in_other_words() -> None:
    noisy = multivariable().markov(41) + 0.01 * np.random.default_rng(1).standard_normal((41, 3, 2))
    one = era_dc(noisy, 4, lags=1, block_rows=20, block_columns=20)
    np.testing.assert_allclose(
        one.model.markov(30), era(noisy, 4, block_rows=20, block_columns=20).model.markov(30), atol=1e-9
    )


def test_singular_values_of_a_known_system() -> None:
    """One pole: H is b c [l^i l^j], of rank one, with singular value b c sum l^2i."""
    pole, gain = 0.8, 3.0
    found = era([0.0, *(gain * pole ** np.arange(20))], 1, block_rows=10, block_columns=10)
    expected = gain * np.sum(pole ** (2 * np.arange(10)))
    assert found.hankel_singular_values[0] == pytest.approx(expected, rel=1e-12)
    assert found.modal_singular_values[0] == pytest.approx(np.sqrt(gain / (1 - pole)), rel=1e-10)
    assert found.model.poles()[0] == pytest.approx(pole, rel=1e-12)


def test_percent_described_uses_squares_and_says_so() -> None:
    found = era(multivariable().markov(41), 2)
    xi = found.hankel_singular_values
    assert found.percent_described == pytest.approx(100 * np.sum(xi[:2] ** 2) / np.sum(xi**2))
    assert found.percent_described_unsquared == pytest.approx(100 * np.sum(xi[:2]) / np.sum(xi))
    assert found.percent_described > found.percent_described_unsquared


def test_orders_beyond_the_rank_are_reduced_and_said() -> None:
    with pytest.warns(SysidWarning, match="numerical rank 4: the model has order 4 instead of 6"):
        assert era(multivariable().markov(41), 6).model.order == 4


def test_refusals() -> None:
    y = multivariable().markov(11)
    refused("block_rows", lambda: era(y, 2, block_rows=8, block_columns=8))
    refused("order must be", lambda: era(y, 0))
    refused("order must be", lambda: era(y, 500))
    refused("all zero", lambda: era([1.0, 0.0, 0.0, 0.0], 1))
    refused("at least 3", lambda: era([1.0, 2.0], 1))
    refused("lags", lambda: era_dc(y, 2, lags=0))
    refused("block_rows", lambda: era_dc(y, 2, lags=9))
