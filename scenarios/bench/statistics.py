"""Statistics of response errors: their null distribution for a perfect estimator, limits of means, and intervals.

A perfect estimator errs by Gaussian steps along the directions of the Cramér-Rao bound and claims exactly their
covariance. Errors are real and imaginary part (m, nf, ny, nu, 2), covariances (nf, ny, nu, 2, 2). A part of the
response that no estimate can get wrong, such as the imaginary part at 0 Hz, is left out: `free` (nf, ny, nu, 2) marks
the others.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from scipy.stats import beta, chi2, norm, pearson3, t

from scenarios.bench.measurement import Measurements
from scenarios.problems.bound import perfect_errors, response_covariance
from scenarios.problems.problem import Bound
from scenarios.problems.registry import problem
from sysid.models.delta_method import standard_directions
from sysid.records.arrays import ComplexArray, FloatArray

Statistic = Callable[[FloatArray, FloatArray, np.ndarray], FloatArray]
"""A statistic of errors, covariance and free parts, one value per record."""

NULL_RECORDS = 20_000
CHUNK = 1000
SEED = 20_260_801

TWO_SIDED_95 = float(norm.ppf(0.975))
TAIL = 0.025
"""Probability beyond either end of a 95 % interval."""

SLACK = 1.05
"""Factor on limits of variances for what asymptotic theory leaves out."""

NEGLIGIBLE_VARIANCE = 1e-12
"""A part of the response with less than this share of the variance of both parts does not vary."""

NEGLIGIBLE_SKEWNESS = 1e-6
"""Below it Pearson's type III distribution is numerically a normal one."""

FEWEST_VALUES = 3
"""Positive values that the interval of a mean needs: from two it spans a factor of 1e30."""

EQUAL = 1e-9
"""Deviation below which shares are all the same."""


def real_and_imaginary(difference: ComplexArray) -> FloatArray:
    """Real and imaginary part of differences of responses, on a new last axis."""
    return np.stack((difference.real, difference.imag), axis=-1)


def free_parts(covariance: FloatArray) -> np.ndarray:
    """Parts that vary (nf, ny, nu, 2), booleans."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    floor = np.maximum(variances.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(variances > NEGLIGIBLE_VARIANCE * floor)


def variance_ratio_by_frequency(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """|error|^2 over its variance (m, nf, ny, nu), NaN where nothing varies; its mean is 1."""
    variances = np.where(free, np.diagonal(covariance, axis1=-2, axis2=-1), 0.0).sum(axis=-1)
    squares = np.sum(errors**2, axis=-1)
    return _ratio(squares, np.broadcast_to(np.where(free.any(axis=-1), variances, np.nan), squares.shape))


def variance_ratio(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of |error|^2 over its variance (m,); its mean is 1."""
    return np.asarray(np.nanmean(variance_ratio_by_frequency(errors, covariance, free), axis=(1, 2, 3)))


def normalised_square(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of error' covariance^-1 error over the number of its parts (m,); its mean is 1.

    A covariance that is not positive definite makes it infinite; an infinite one makes it 0.
    """
    real, imaginary = errors[..., 0], errors[..., 1]
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    determinant = a * c - b * b
    positive = (a > 0.0) & (c > 0.0) & (determinant > 0.0)
    squares = c * real**2 - 2.0 * b * real * imaginary + a * imaginary**2
    both = _ratio(squares, np.broadcast_to(np.where(positive, 2.0 * determinant, 0.0), squares.shape))
    only_real = np.where(free[..., 0], _ratio(real**2, np.broadcast_to(a, real.shape)), np.nan)
    only_imaginary = np.where(free[..., 1], _ratio(imaginary**2, np.broadcast_to(c, real.shape)), np.nan)
    values = np.where(free.all(axis=-1), both, np.where(free[..., 0], only_real, only_imaginary))
    infinite = np.isinf(covariance).any(axis=(-2, -1)) & free.any(axis=-1)
    values = np.where(infinite, 0.0, values)
    return np.asarray(np.nanmean(values, axis=(1, 2, 3)))


def covered_share(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Share of the parts of the response within their 95 % intervals (m,); its mean is 0.95."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    inside = errors**2 <= TWO_SIDED_95**2 * variances
    return np.asarray(inside[:, free].mean(axis=1))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """Quotient; infinite for a divisor of 0 or less, NaN for a divisor of NaN."""
    infinite = np.where(np.isnan(below), np.nan, np.inf)
    return np.divide(above, below, out=infinite, where=below > 0.0)


@lru_cache(maxsize=256)
def bound_for(name: str, structure: str | None) -> Bound | None:
    """The bound of a structure on a problem, or else that of the truth's own structure; None where there is none."""
    bound = problem(name).bound(structure)
    return problem(name).bound(None) if bound is None else bound


def in_variances(difference: ComplexArray, bound: Bound) -> FloatArray:
    """Mean over frequencies of |difference|^2 over the variance of the bound (n,)."""
    covariance = response_covariance(bound)
    return variance_ratio(real_and_imaginary(difference), covariance, free_parts(covariance))


def error_against_bound(good: Measurements, name: str, structure: str | None) -> FloatArray:
    """Mean over frequencies of |error|^2 over the variance of the bound, record by record (n,)."""
    bound = bound_for(name, structure)
    if bound is None or not good:
        return np.empty(0)
    return in_variances(np.stack([m.response - bound.response for m in good if m.response is not None]), bound)


@lru_cache(maxsize=1024)
def null_distribution(name: str, structure: str | None, statistic: Statistic, mean: float) -> FloatArray | None:
    """Values of a statistic for single records of the perfect estimator (M,).

    Args:
        name: Of the problem.
        structure: Of the estimator.
        statistic: The statistic.
        mean: Its exact mean, to which the values are shifted: the sampling error of their own mean would show in a mean
            over thousands of records.

    Returns:
        The values; None where the problem has no bound.
    """
    bound = bound_for(name, structure)
    if bound is None:
        return None
    values = statistic_of_perfect(bound, statistic, NULL_RECORDS, SEED)
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
            statistic(errors_of_perfect(bound, min(CHUNK, records - first), rng), covariance, free)
            for first in range(0, records, CHUNK)
        ]
    )


def errors_of_perfect(bound: Bound, records: int, rng: np.random.Generator) -> FloatArray:
    """Errors of the response of a perfect estimator (records, nf, ny, nu, 2)."""
    return real_and_imaginary(perfect_errors(bound, records, rng))


@lru_cache(maxsize=256)
def null_parameter_coverage(name: str, structure: str | None) -> FloatArray | None:
    """Share of true parameters within their 95 % intervals, for records of the perfect estimator (M,)."""
    bound = bound_for(name, structure)
    if bound is None:
        return None
    directions = standard_directions(bound.covariance)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    steps = np.random.default_rng(SEED).standard_normal((NULL_RECORDS, directions.shape[1]))
    shares = np.mean(np.abs(steps @ directions.T) <= TWO_SIDED_95, axis=1)
    return np.asarray(shares + 0.95 - np.mean(shares))


@lru_cache(maxsize=1)
def null_bandwidth_coverage() -> FloatArray:
    """Whether a 95 % interval of the bandwidth holds the truth, for records of the perfect estimator (M,).

    Of several bandwidths this is the share, as if all erred together: the widest distribution that the share can have.
    """
    return np.asarray(np.arange(NULL_RECORDS) < 0.95 * NULL_RECORDS, dtype=float)


@lru_cache(maxsize=64)
def null_chi_square(freedom: int) -> FloatArray:
    """Chi-square over its degrees of freedom at evenly spaced probabilities (M,): free of sampling error."""
    values = chi2.ppf((np.arange(NULL_RECORDS) + 0.5) / NULL_RECORDS, freedom) / freedom
    return np.asarray(values + 1.0 - np.mean(values))


def limits_of_mean(
    null: FloatArray, draws: int, false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """Limits that the mean over independent records exceeds with a given probability.

    The distribution of the mean is taken as Pearson's type III with the mean's first three moments, which follow from
    those of single records; a normal distribution would ignore the skewness.

    Args:
        null: Values of the statistic for single records of a perfect estimator (M,).
        draws: Records over which the mean is taken.
        false_alarm: Probability of a mean outside the limits, in all.
        low: Whether there is a lower limit.
        high: Whether there is an upper one; with both, each has half of the probability.

    Returns:
        Lower and upper limit, infinite where there is none.
    """
    return limits_of_pooled_mean([null], [draws], false_alarm, low=low, high=high)


def limits_of_pooled_mean(
    nulls: Sequence[FloatArray], draws: Sequence[int], false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """`limits_of_mean` for the mean over the records of several problems together."""
    total = sum(draws)
    mean = sum(n * float(np.mean(null)) for null, n in zip(nulls, draws, strict=True)) / total
    variance = sum(n * float(np.var(null)) for null, n in zip(nulls, draws, strict=True)) / total**2
    third = sum(n * _third_moment(null) for null, n in zip(nulls, draws, strict=True))
    return limits_of_moments(mean, variance, third / total**3, false_alarm, low=low, high=high)


def limits_of_moments(
    mean: float, variance: float, third: float, false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """`limits_of_mean` from mean, variance and third central moment of the mean itself."""
    if variance == 0.0:
        return (mean if low else -np.inf, mean if high else np.inf)
    deviation = float(np.sqrt(variance))
    skewness = third / deviation**3
    shape = norm(mean, deviation) if abs(skewness) < NEGLIGIBLE_SKEWNESS else pearson3(skewness, mean, deviation)
    share = false_alarm / (low + high)
    return (
        float(shape.ppf(share)) if low else -np.inf,
        float(shape.isf(share)) if high else np.inf,
    )


def _third_moment(null: FloatArray) -> float:
    """Third central moment, by products: `**3` costs ten times as much."""
    distance = null - np.mean(null)
    return float(np.mean(distance * distance * distance))


def interval_of_positive_mean(values: FloatArray) -> tuple[float, float]:
    """95 % interval of the mean of positive values, such as squares, ratios and distances.

    The mean is taken as chi-square with as many degrees of freedom as its own mean and variance say
    [Satterthwaite1946]; since the variance is that of the n values, the quantiles are those at Student's tails of n - 1
    degrees of freedom instead of the normal ones. It holds the mean in 93 to 96 % of sets of 4, 10, 20 or 200 values
    that are each chi-square with 1 to 20 degrees of freedom, over them; Student's own interval does in 82 to 95 %, and
    goes below 0.

    Args:
        values: At least 0 (n,).

    Returns:
        Both ends, at least 0; NaN of fewer than three values, and where not all are finite.
    """
    if len(values) < FEWEST_VALUES or not np.isfinite(values).all():
        return (float("nan"), float("nan"))
    size = float(np.max(values))
    if size == 0.0:
        return (0.0, 0.0)
    # scaled, because the squares of the largest floats overflow
    scaled = values / size
    n, mean, deviation = len(values), float(np.mean(scaled)), float(np.std(scaled, ddof=1))
    freedom = 2.0 * n * (mean / deviation) ** 2 if deviation > 0.0 else np.inf
    if not np.isfinite(freedom):
        return (size * mean, size * mean)
    tail = float(norm.sf(t.isf(TAIL, n - 1)))
    return (
        size * mean * (freedom / float(chi2.isf(tail, freedom))),
        size * mean * (freedom / float(chi2.ppf(tail, freedom))),
    )


def interval_of_mean_share(values: FloatArray) -> tuple[float, float]:
    """95 % interval of the mean of shares, one per record, of things that may depend on each other within the record.

    The exact binomial interval, with the number of independent draws that have the variance of these shares, reduced
    for the uncertainty of that variance [KornGraubard1998]; no fewer draws than records, as many as where all of a
    record go together, and just as many where all shares are equal, which says nothing about their variance. So it has
    a width at 0 and at 1.

    Args:
        values: From 0 to 1 (n,).

    Returns:
        Both ends, from 0 to 1; NaN of no values, and where not all are finite.
    """
    n = len(values)
    if n == 0 or not np.isfinite(values).all():
        return (float("nan"), float("nan"))
    mean = float(np.mean(values))
    draws = float(n)
    if n > 1 and (deviation := float(np.std(values, ddof=1))) > EQUAL:
        reduction = float(norm.isf(TAIL) / t.isf(TAIL, n - 1)) ** 2
        draws = max(draws, n * mean * (1.0 - mean) / deviation**2 * reduction)
    return exact_interval_of_share(draws * mean, draws)


def exact_interval_of_share(count: float, total: float) -> tuple[float, float]:
    """95 % interval of a share after Clopper and Pearson; NaN of nothing.

    Args:
        count: From 0 to `total`; not necessarily a whole number.
        total: Number of trials.
    """
    if total <= 0.0:
        return (float("nan"), float("nan"))
    low = float(beta.ppf(TAIL, count, total - count + 1.0)) if count > 0.0 else 0.0
    high = float(beta.isf(TAIL, count + 1.0, total - count)) if count < total else 1.0
    return (low, high)


def interval_of_percentage(count: int, total: int) -> tuple[float, float]:
    """`exact_interval_of_share` in percent."""
    low, high = exact_interval_of_share(count, total)
    return (100.0 * low, 100.0 * high)
