"""Statistics of one record's error have the means that they say."""

import numpy as np
import pytest

from scenarios.bench.statistics import (
    TWO_SIDED_95,
    covered_share,
    free_parts,
    normalised_square,
    real_and_imaginary,
    variance_ratio,
    variance_ratio_by_frequency,
)

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
