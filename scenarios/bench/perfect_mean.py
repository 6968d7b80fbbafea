"""Where the mean of a statistic over many records lies if the estimator is perfect."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import norm, pearson3

from sysid.records.arrays import FloatArray

NORMAL = 1e-6
"""A skewness below it is none."""


def limits_of_mean(
    single: FloatArray, draws: int, false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """Limits that the mean over independent records leaves with a given probability.

    The distribution of the mean is that of Pearson's type III with the mean's first three moments, which are those of
    one record's value, scaled; it holds the skewness that a normal distribution would ignore.

    Args:
        single: Values of the statistic for many single records (M,), drawn for a perfect estimator.
        draws: Records over which the mean is taken.
        false_alarm: Probability of a mean outside, in all.
        low: Whether there is a lower limit.
        high: Whether there is an upper one; with both, each has half of the probability.

    Returns:
        Lower and upper limit, infinite where there is none.
    """
    return limits_of_pooled_mean([single], [draws], false_alarm, low=low, high=high)


def limits_of_pooled_mean(
    singles: Sequence[FloatArray], draws: Sequence[int], false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """The same for the mean over the records of several problems together.

    Args:
        singles: Of each problem, values of the statistic for many single records (M,).
        draws: Records of each.
        false_alarm: Probability of a mean outside, in all.
        low: Whether there is a lower limit.
        high: Whether there is an upper one.

    Returns:
        Lower and upper limit, infinite where there is none.
    """
    total = sum(draws)
    mean = sum(n * float(np.mean(single)) for single, n in zip(singles, draws, strict=True)) / total
    variance = sum(n * float(np.var(single)) for single, n in zip(singles, draws, strict=True)) / total**2
    third = sum(n * _third(single) for single, n in zip(singles, draws, strict=True))
    return limits_of_moments(mean, variance, third / total**3, false_alarm, low=low, high=high)


def limits_of_moments(
    mean: float, variance: float, third: float, false_alarm: float, *, low: bool = True, high: bool = True
) -> tuple[float, float]:
    """The same from mean, variance and third central moment of the mean itself."""
    if variance == 0.0:
        return (mean if low else -np.inf, mean if high else np.inf)
    deviation = float(np.sqrt(variance))
    skewness = third / deviation**3
    shape = norm(mean, deviation) if abs(skewness) < NORMAL else pearson3(skewness, mean, deviation)
    share = false_alarm / (low + high)
    return (
        float(shape.ppf(share)) if low else -np.inf,
        float(shape.isf(share)) if high else np.inf,
    )


def _third(single: FloatArray) -> float:
    """Third central moment; products, which cost a tenth of a power."""
    distance = single - np.mean(single)
    return float(np.mean(distance * distance * distance))
