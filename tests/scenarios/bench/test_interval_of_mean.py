"""Intervals of means hold the truth as often as they say, lie where the mean can, and have a width."""

from collections.abc import Callable

import numpy as np
import pytest

from scenarios.bench.accuracy import Acceptance
from scenarios.bench.statistics import (
    exact_interval_of_share,
    interval_of_mean_share,
    interval_of_positive_mean,
)
from sysid.records.arrays import FloatArray

SETS = 800


def held(interval: Callable[[FloatArray], tuple[float, float]], sets: FloatArray, true: float) -> float:
    ends = np.array([interval(values) for values in sets])
    return float(np.mean((ends[:, 0] <= true) & (true <= ends[:, 1])))


@pytest.mark.parametrize("records", [4, 20, 200])
@pytest.mark.parametrize("freedom", [2, 4, 8])
def test_positive_means_are_held(records: int, freedom: int) -> None:
    rng = np.random.default_rng(5)
    values = np.asarray(rng.chisquare(freedom, (SETS, records)) / freedom)
    assert 0.93 <= held(interval_of_positive_mean, values, 1.0) <= 0.97


def test_positive_means_are_held_from_above_and_below() -> None:
    low, high = interval_of_positive_mean(np.array([0.8, 1.2, 0.5, 100.0, 0.9]))
    assert 0.0 < low < 20.68 < 100.0 < high
    assert interval_of_positive_mean(np.full(5, 2.0)) == (2.0, 2.0)
    assert interval_of_positive_mean(np.zeros(5)) == (0.0, 0.0)
    # hardly any scatter: as the normal distribution has it
    low, high = interval_of_positive_mean(np.linspace(1.0, 1.0 + 199e-9, 200))
    assert high - low == pytest.approx(2.0 * 1.972 * 1e-9 * np.std(np.arange(200), ddof=1) / 200**0.5, rel=0.01)


@pytest.mark.parametrize("values", [np.array([1.0, 2.0]), np.array([1.0, 2.0, np.inf]), np.array([1.0, np.nan, 2.0])])
def test_of_too_few_or_infinite_values_no_interval_is_told(values: FloatArray) -> None:
    assert np.isnan(interval_of_positive_mean(values)).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-300, 1e200, 1e300])
def test_positive_means_of_any_size_are_alike(size: float) -> None:
    values = np.array([1.0, 2.0, 6.0])
    assert np.array(interval_of_positive_mean(size * values)) / size == pytest.approx(interval_of_positive_mean(values))
    assert interval_of_positive_mean(np.zeros(5)) == (0.0, 0.0)


def test_shares_have_a_width_at_both_ends() -> None:
    least = 0.025 ** (1.0 / 8.0)
    assert interval_of_mean_share(np.ones(8)) == (pytest.approx(least), 1.0)
    assert interval_of_mean_share(np.zeros(8)) == (0.0, pytest.approx(1.0 - least))
    assert Acceptance(expected=0.95, shares=True).interval(np.ones(8)) == (pytest.approx(least), 1.0)
    assert interval_of_mean_share(np.ones(1)) == (pytest.approx(0.025), 1.0)
    assert np.isnan(interval_of_mean_share(np.empty(0))).all()
    assert np.isnan(interval_of_mean_share(np.array([0.5, np.nan]))).all()


def test_shares_of_one_each_have_the_exact_interval() -> None:
    yes_and_no = np.repeat([1.0, 0.0], [18, 2])
    assert interval_of_mean_share(yes_and_no) == pytest.approx(exact_interval_of_share(18, 20))
    many = np.full(20, 0.9) + 0.05 * np.resize([1.0, -1.0], 20)
    low, high = interval_of_mean_share(many)
    assert 0.0 < high - low < 0.08
    assert low < 0.9 < high


@pytest.mark.parametrize("records", [4, 20, 200])
@pytest.mark.parametrize("together", [1, 5, 40])
def test_shares_are_held(records: int, together: int) -> None:
    rng = np.random.default_rng(6)
    # things of a record go together: its own share is between 0 and 1, 0.9 in the mean
    own = rng.beta(0.9 * together, 0.1 * together, (SETS, records))
    values = rng.binomial(together, own) / together
    assert held(interval_of_mean_share, values, 0.9) >= 0.93
