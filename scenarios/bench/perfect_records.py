"""What single records of a perfect estimator give: the null hypothesis of every verdict on accuracy.

It errs by Gaussian steps along the directions of the Cramér-Rao bound and claims exactly their covariance. Where no
model of the contestant's structure is the truth, it is measured against the bound of the truth's own.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from scenarios.bench.response_statistics import TWO_SIDED_95, free_parts, parts_of
from scenarios.problems.bound import perfect_errors, response_covariance
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from sysid.models.delta_method import standard_directions
from sysid.records.arrays import FloatArray

Statistic = Callable[[FloatArray, FloatArray, np.ndarray], FloatArray]
"""Of errors, covariance and free parts; see `response_statistics`."""

SINGLES = 20_000
CHUNK = 1000
SEED = 20_260_801


@lru_cache(maxsize=256)
def bound_for(name: str, structure: str | None) -> Bound | None:
    """The bound of a structure on a problem, or else that of the truth's own; None where there is none."""
    found = problem(name).bound(structure)
    return problem(name).bound(None) if found is None else found


@lru_cache(maxsize=1024)
def single_records(name: str, structure: str | None, statistic: Statistic, mean: float) -> FloatArray | None:
    """Values of a statistic for single records of the perfect estimator (M,).

    Args:
        name: Of the problem.
        structure: Of the contestant.
        statistic: Which.
        mean: Its exact mean, to which the values are shifted: what is left of chance in their own would show in a mean
            over thousands of records.

    Returns:
        The values; None where the problem has no bound.
    """
    bound = bound_for(name, structure)
    if bound is None:
        return None
    values = statistic_of_perfect(bound, statistic, SINGLES, SEED)
    values += mean - np.mean(values)
    values.setflags(write=False)
    return values


def statistic_of_perfect(bound: Bound, statistic: Statistic, records: int, seed: int) -> FloatArray:
    """A statistic for records of the perfect estimator (records,)."""
    rng = np.random.default_rng(seed)
    covariance = response_covariance(bound)
    free = free_parts(covariance)
    return np.concatenate(
        [
            statistic(parts_of_perfect(bound, min(CHUNK, records - first), rng), covariance, free)
            for first in range(0, records, CHUNK)
        ]
    )


def parts_of_perfect(bound: Bound, records: int, rng: np.random.Generator) -> FloatArray:
    """Errors of the response of a perfect estimator, real and imaginary part (records, nf, ny, nu, 2)."""
    return parts_of(perfect_errors(bound, records, rng))


@lru_cache(maxsize=256)
def parameters_covered(name: str, structure: str | None) -> FloatArray | None:
    """Share of true parameters within their 95 % intervals, for records of the perfect estimator (M,)."""
    bound = bound_for(name, structure)
    if bound is None:
        return None
    directions = standard_directions(bound.covariance)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    steps = np.random.default_rng(SEED).standard_normal((SINGLES, directions.shape[1]))
    shares = np.mean(np.abs(steps @ directions.T) <= TWO_SIDED_95, axis=1)
    return np.asarray(shares + 0.95 - np.mean(shares))


@lru_cache(maxsize=1)
def bandwidth_covered() -> FloatArray:
    """Whether a 95 % interval holds, for records of the perfect estimator (M,).

    With several bandwidths their share, as if they erred all together: the widest that it can spread.
    """
    return np.asarray(np.arange(SINGLES) < 0.95 * SINGLES, dtype=float)
