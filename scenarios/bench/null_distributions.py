"""Null distributions of statistics of response errors: their values for a perfect estimator.

A perfect estimator errs by Gaussian steps along the directions of the Cramér-Rao bound and claims exactly their
covariance; shapes are those of `sysid.validation.response_errors`.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.stats import chi2

from scenarios.bench.measurement import Measurements
from scenarios.files.errors import ScenarioError
from scenarios.problems.registry import problem
from sysid.models.delta_method import standard_directions
from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation import CramerRaoBound
from sysid.validation.response_errors import free_parts, real_and_imaginary, variance_ratio

Statistic = Callable[[FloatArray, FloatArray, np.ndarray], FloatArray]
"""A statistic of errors, covariance and free parts, one value per record."""

NULL_RECORDS = 20_000
"""Records of the perfect estimator behind a null distribution (M)."""

SEED = 20_260_801

SLACK = 1.05
"""Factor on limits of variances for what asymptotic theory leaves out."""


@lru_cache(maxsize=256)
def bound_for(name: str, structure: str | None) -> CramerRaoBound:
    """The bound of a structure on a problem, or else that of the truth's own structure.

    Raises:
        ScenarioError: The problem has no bound.
    """
    bound = problem(name).bound(structure) or problem(name).bound(None)
    if bound is None:
        raise ScenarioError(f"problem {name} given, expected one with a Cramér-Rao bound")
    return bound


def responses(good: Measurements) -> ComplexArray:
    """Responses of records with a model (n, nf, ny, nu)."""
    return np.stack([m.response for m in good if m.response is not None])


def in_variances(difference: ComplexArray, bound: CramerRaoBound) -> FloatArray:
    """Mean over frequencies of |difference|^2 over the variance of the bound (n,)."""
    covariance = bound.response_covariance
    return variance_ratio(real_and_imaginary(difference), covariance, free_parts(covariance))


def error_against_bound(good: Measurements, name: str, structure: str | None) -> FloatArray:
    """Mean over frequencies of |error|^2 over the variance of the bound, record by record (n,)."""
    bound = bound_for(name, structure)
    return in_variances(responses(good) - bound.response, bound) if good else np.empty(0)


@lru_cache(maxsize=1024)
def null_distribution(name: str, structure: str | None, statistic: Statistic, mean: float) -> FloatArray:
    """Values of a statistic for single records of the perfect estimator (M,).

    Args:
        name: Of the problem.
        structure: Of the estimator.
        statistic: The statistic.
        mean: Its exact mean, to which the values are shifted: the sampling error of their own mean would show in a mean
            over thousands of records.
    """
    values = statistic_of_perfect(bound_for(name, structure), statistic)
    values += mean - np.mean(values)
    # Kept, and handed to many: nobody may change it.
    values.setflags(write=False)
    return values


def statistic_of_perfect(
    bound: CramerRaoBound,
    statistic: Statistic,
    *,
    covariance: FloatArray | None = None,
    records: int = NULL_RECORDS,
    seed: int | tuple[int, int] = SEED,
) -> FloatArray:
    """A statistic for records of the perfect estimator (records,).

    Args:
        bound: Of its errors.
        statistic: The statistic.
        covariance: That the errors are compared with; by default their own.
        records: A multiple of 1000: so many at a time are drawn, which bounds the memory.
        seed: Of the draws.
    """
    rng = np.random.default_rng(seed)
    covariance = bound.response_covariance if covariance is None else covariance
    free = free_parts(covariance)
    chunks = []
    for _ in range(records // 1000):
        errors = real_and_imaginary(bound.response_errors(1000, rng))
        chunks.append(statistic(errors, covariance, free))
    return np.concatenate(chunks)


@lru_cache(maxsize=256)
def null_parameter_coverage(name: str, structure: str | None) -> FloatArray:
    """Share of true parameters within their 95 % intervals, for records of the perfect estimator (M,)."""
    directions = standard_directions(bound_for(name, structure).covariance)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    # Each parameter in units of its own deviation, so that 95 % of its errors lie within 1.96.
    steps = np.random.default_rng(SEED).standard_normal((NULL_RECORDS, directions.shape[1]))
    shares = np.mean(np.abs(steps @ directions.T) <= NORMAL_95, axis=1)
    return np.asarray(shares + 0.95 - np.mean(shares))


NULL_BANDWIDTH_COVERAGE = np.asarray(np.arange(NULL_RECORDS) < 0.95 * NULL_RECORDS, dtype=float)
"""Whether a 95 % interval of the bandwidth holds the truth, for records of the perfect estimator (M,).

Of several bandwidths this is the share, as if all erred together: the widest distribution that the share can have.
"""


@lru_cache(maxsize=64)
def null_chi_square(freedom: int) -> FloatArray:
    """Chi-square over its degrees of freedom at evenly spaced probabilities (M,): free of sampling error."""
    # Midpoints of equal shares of the probability.
    values = chi2.ppf((np.arange(NULL_RECORDS) + 0.5) / NULL_RECORDS, freedom) / freedom
    return np.asarray(values + 1.0 - np.mean(values))
