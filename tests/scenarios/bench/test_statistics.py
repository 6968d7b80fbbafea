"""Statistics of errors and intervals of means against known values."""

from collections.abc import Callable

import numpy as np
import pytest

from scenarios.bench.accuracy import Acceptance
from scenarios.bench.statistics import (
    TWO_SIDED_95,
    covered_share,
    exact_interval_of_share,
    free_parts,
    interval_of_mean_share,
    interval_of_positive_mean,
    normalised_square,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)
from sysid.records.arrays import FloatArray

COVARIANCE = np.array([[[[[4.0, 1.0], [1.0, 2.0]]]], [[[[9.0, 0.0], [0.0, 0.0]]]]])


def test_real_and_imaginary_part() -> None:
    assert real_and_imaginary(np.array([[[1.0 + 2.0j]]])).tolist() == [[[[1.0, 2.0]]]]


def test_a_part_that_cannot_vary_is_left_out() -> None:
    assert free_parts(COVARIANCE).tolist() == [[[[True, True]]], [[[True, False]]]]


def test_values_by_hand() -> None:
    errors = np.array([[[[[2.0, 1.0]]], [[[6.0, 0.0]]]]])
    free = free_parts(COVARIANCE)
    assert variance_ratio_by_frequency(errors, COVARIANCE, free)[0, :, 0, 0] == pytest.approx([5.0 / 6.0, 4.0])
    assert variance_ratio(errors, COVARIANCE, free) == pytest.approx([(5.0 / 6.0 + 4.0) / 2.0])
    # [2 1] inv([[4 1] [1 2]]) [2 1]' = (2*4 - 2*2 + 4*1) / 7 of two parts, 36 / 9 of one
    assert normalised_square(errors, COVARIANCE, free) == pytest.approx([(8.0 / 7.0 / 2.0 + 4.0) / 2.0])
    # 6 is more than 1.96 times 3; the part that does not vary is not counted
    assert covered_share(errors, COVARIANCE, free) == pytest.approx([2.0 / 3.0])


def test_means_over_many_records() -> None:
    rng = np.random.default_rng(3)
    root = np.array([[2.0, 0.0], [0.5, np.sqrt(1.75)]])
    errors = np.zeros((4000, 2, 1, 1, 2))
    errors[:, 0, 0, 0] = rng.standard_normal((4000, 2)) @ root.T
    errors[:, 1, 0, 0, 0] = 3.0 * rng.standard_normal(4000)
    free = free_parts(COVARIANCE)
    for statistic, mean in ((variance_ratio, 1.0), (normalised_square, 1.0), (covered_share, 0.95)):
        values = statistic(errors, COVARIANCE, free)
        assert abs(np.mean(values) - mean) < 4.0 * np.std(values) / np.sqrt(len(values))


@pytest.mark.parametrize("claimed", [np.zeros((2, 2)), np.ones((2, 2)), np.diag([1.0, -1.0])])
def test_a_claim_that_is_no_covariance_makes_the_error_infinite(claimed: np.ndarray) -> None:
    covariance = np.broadcast_to(claimed, (2, 1, 1, 2, 2))
    errors = np.ones((1, 2, 1, 1, 2))
    free = np.ones((2, 1, 1, 2), dtype=bool)
    assert normalised_square(errors, covariance, free) == pytest.approx([np.inf])


def test_nothing_is_covered_by_intervals_of_no_width() -> None:
    errors = np.ones((1, 2, 1, 1, 2))
    free = np.ones((2, 1, 1, 2), dtype=bool)
    for variance, share in ((0.0, 0.0), (-1.0, 0.0), (1.01 / TWO_SIDED_95**2, 1.0)):
        covariance = np.broadcast_to(variance * np.eye(2), (2, 1, 1, 2, 2))
        assert covered_share(errors, covariance, free) == pytest.approx([share])


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
