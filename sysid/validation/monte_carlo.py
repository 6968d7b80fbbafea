"""Means over the independent records of a Monte Carlo study: limits that chance keeps to, and 95 % intervals."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.validation.response_errors import free_parts

TAIL = 0.025  # probability beyond either end of a 95 % interval


def limits_of_mean(
    nulls: Sequence[FloatArray], draws: Sequence[int], false_alarm: float, *, low: bool = True
) -> tuple[float, float]:
    """Limits that the mean over independent records of one or several problems exceeds with a given probability.

    The distribution of the mean is taken as Pearson's type III with the mean's first three moments, which follow from
    those of single records; a normal distribution would ignore the skewness.

    Args:
        nulls: Values of the statistic for single records of a perfect estimator, of each problem (M,).
        draws: Records of each problem over which the mean is taken.
        false_alarm: Probability of a mean outside the limits, in all.
        low: Whether there is a lower limit; with both, each has half of the probability.

    Returns:
        Lower and upper limit, infinite where there is none.
    """
    total = sum(draws)
    # cumulants of a sum of independent values add
    means, variances, thirds = [], [], []
    for null, count in zip(nulls, draws, strict=True):
        deviation = null - np.mean(null)
        means.append(count * float(np.mean(null)))
        variances.append(count * float(np.var(null)))
        # the cube by products: `**3` costs ten times as much
        thirds.append(count * float(np.mean(deviation * deviation * deviation)))
    mean, variance, third = sum(means) / total, sum(variances) / total**2, sum(thirds) / total**3
    return limits_of_moments(mean, variance, third, false_alarm, low=low)


def limits_of_moments(
    mean: float, variance: float, third: float, false_alarm: float, *, low: bool = True
) -> tuple[float, float]:
    """`limits_of_mean` from the moments of the mean itself: its mean, variance and third central moment."""
    if variance == 0.0:
        lower = mean if low else -np.inf
        return lower, mean
    deviation = float(np.sqrt(variance))
    skewness = third / deviation**3
    # without skewness Pearson's distribution is a normal one, which it is not numerically
    if abs(skewness) < 1e-6:
        distribution = scipy.stats.norm(mean, deviation)
    else:
        distribution = scipy.stats.pearson3(skewness, mean, deviation)
    share = false_alarm / (1 + low)
    lower = float(distribution.ppf(share)) if low else -np.inf
    return lower, float(distribution.isf(share))


def limits_of_response_squares(covariance: FloatArray, draws: int, false_alarm: float) -> tuple[FloatArray, FloatArray]:
    """Limits of the mean over records of |error|^2 over its variance, at each frequency.

    Args:
        covariance: Of the response of a single record (nf, ny, nu, 2, 2).
        draws: Records.
        false_alarm: Greatest probability that the mean lies outside at any frequency.

    Returns:
        Lower and upper limits (nf, ny, nu), NaN where the response cannot be wrong.
    """
    free = free_parts(covariance)
    low, high = np.full(free.shape[:-1], np.nan), np.full(free.shape[:-1], np.nan)
    indices = [tuple(index) for index in np.argwhere(free.any(axis=-1))]
    for index in indices:
        kept = covariance[index] * np.outer(free[index], free[index])
        # |error|^2 is a sum of squares of independent Gaussian variables with these shares of its mean
        shares = np.linalg.eigvalsh(kept) / np.trace(kept)
        variance, third = 2.0 * float(np.sum(shares**2)), 8.0 * float(np.sum(shares**3))
        # Bonferroni's bound: each response has its part of the probability
        each_alarm = false_alarm / len(indices)
        low[index], high[index] = limits_of_moments(1.0, variance / draws, third / draws**2, each_alarm)
    return low, high


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
    # from two values the interval spans a factor of 1e30
    if len(values) < 3 or not np.isfinite(values).all():
        return (float("nan"), float("nan"))
    # scaled, because the squares of the largest floats overflow
    size = float(np.max(values)) or 1.0
    scaled = values / size
    n, mean, deviation = len(values), float(np.mean(scaled)), float(np.std(scaled, ddof=1))
    freedom = 2.0 * n * (mean / deviation) ** 2 if deviation > 0.0 else np.inf
    if not np.isfinite(freedom):
        return (size * mean, size * mean)
    tail = float(scipy.stats.norm.sf(scipy.stats.t.isf(TAIL, n - 1)))
    low = size * mean * (freedom / float(scipy.stats.chi2.isf(tail, freedom)))
    high = size * mean * (freedom / float(scipy.stats.chi2.ppf(tail, freedom)))
    return low, high


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
    # 1e-9: a deviation that is rounding
    if n > 1 and (deviation := float(np.std(values, ddof=1))) > 1e-9:
        reduction = float(scipy.stats.norm.isf(TAIL) / scipy.stats.t.isf(TAIL, n - 1)) ** 2
        draws = max(draws, n * mean * (1.0 - mean) / deviation**2 * reduction)
    return exact_interval_of_share(draws * mean, draws)


def exact_interval_of_share(count: float, total: float, whole: float = 1.0) -> tuple[float, float]:
    """95 % interval of a share after Clopper and Pearson; NaN of nothing.

    `count` of `total` trials need not be a whole number, as in SciPy's interval; `whole` is 100 for percent.
    """
    if total <= 0.0:
        return (float("nan"), float("nan"))
    low = float(scipy.stats.beta.ppf(TAIL, count, total - count + 1.0)) if count > 0.0 else 0.0
    high = float(scipy.stats.beta.isf(TAIL, count + 1.0, total - count)) if count < total else 1.0
    return (whole * low, whole * high)
