"""The test of mean errors: its size, its allowance, its interval."""

import numpy as np
import pytest

from scenarios.bench.bias import mean_error, significance

RUNS = 200


def sizes(records: int, directions: int, shift: float, allowed: float, seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    mixing = rng.standard_normal((directions, directions)) + 3.0 * np.eye(directions)
    beyond = inside = 0
    for _ in range(RUNS):
        errors = rng.standard_normal((records, directions))
        errors[:, 0] += shift
        found = mean_error(errors @ mixing, 0.05, allowed)
        beyond += found.size > found.limit
        inside += found.interval[0] <= shift <= found.interval[1]
    return beyond / RUNS, inside / RUNS


@pytest.mark.parametrize(("records", "directions", "shift"), [(40, 4, 0.0), (15, 2, 0.0), (40, 3, 0.5)])
def test_a_mean_as_large_as_allowed_is_beyond_the_limit_as_often_as_asked(
    records: int, directions: int, shift: float
) -> None:
    beyond, inside = sizes(records, directions, shift, shift, 7)
    assert beyond == pytest.approx(0.05, abs=0.046)
    assert inside >= 0.904


@pytest.mark.parametrize(("shift", "least", "most"), [(1.2, 0.99, 1.0), (0.2, 0.0, 0.1), (0.0, 0.0, 0.05)])
def test_what_is_larger_is_found_and_what_is_smaller_is_not(shift: float, least: float, most: float) -> None:
    rng = np.random.default_rng(8)
    given = [rng.standard_normal((40, 4)) + np.array([shift, 0.0, 0.0, 0.0]) for _ in range(RUNS)]
    assert least <= np.mean([significance(errors, 0.2) < 0.05 for errors in given]) <= most


def test_the_size_is_that_of_the_mean() -> None:
    rng = np.random.default_rng(3)
    errors = rng.standard_normal((4000, 3)) * (1.0, 10.0, 0.1) + (2.0, 0.0, 0.0)
    found = mean_error(errors, 1e-4)
    assert found.size == pytest.approx(2.0, abs=0.1)
    assert found.interval[0] < 2.0 < found.interval[1]
    assert found.p < 1e-100
    assert found.p == significance(errors)


def test_errors_without_scatter() -> None:
    assert mean_error(np.zeros((10, 2)), 1e-3).size == 0.0
    assert mean_error(np.full((10, 2), 3.0), 1e-3).size == np.inf
    mixed = np.column_stack((np.full(10, 3.0), np.arange(10.0) - 4.5))
    assert mean_error(mixed, 1e-3).size == np.inf
    unused = np.column_stack((np.zeros(10), np.arange(10.0) - 4.5))
    assert mean_error(unused, 1e-3).size == 0.0
