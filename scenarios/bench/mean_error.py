"""Is the mean of repeated errors zero, judged by their own scatter?"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import f as f_distribution
from scipy.stats import ncf

from sysid.records.arrays import FloatArray

NAN = float("nan")


@dataclass(frozen=True)
class MeanError:
    """Size of a mean error in standard deviations of one record's error, the scatter's own metric.

    Attributes:
        size: Estimate free of the part that scatter alone has, 0 where that part is larger.
        interval: 95 % interval of the size.
        limit: Which `size` exceeds with the given probability where the mean is as large as what is allowed.
        p: Probability of a size as large as this one where the mean is as large as what is allowed.
    """

    size: float
    interval: tuple[float, float]
    limit: float
    p: float


def mean_error(errors: FloatArray, false_alarm: float, allowed: float = 0.0) -> MeanError:
    """Hotelling's test with an allowance [Anderson2003, sec. 5.2].

    T^2 = K m' S^-1 m of the mean m and the sample covariance S of K records; (K - q) / (q (K - 1)) T^2 has the
    F distribution with q and K - q degrees of freedom and noncentrality K d^2, exactly for Gaussian errors, where d is
    the size of the true mean.

    Args:
        errors: One row per record, one column per direction (K, q), K of at least q + 3.
        false_alarm: Probability of a size beyond the limit.
        allowed: Size that is no fault.

    Returns:
        The size and its limit; both infinite where the errors are all equal and not zero.
    """
    records, q = errors.shape
    rest = records - q
    limit = _size(_tail(false_alarm, q, rest, records * allowed**2), records, q)
    statistic = _statistic(errors)
    if not np.isfinite(statistic):
        return MeanError(np.inf, (np.inf, np.inf), limit, 0.0)
    low, high = (_noncentrality(statistic, q, rest, share) for share in (0.025, 0.975))
    return MeanError(
        _size(statistic, records, q),
        (float(np.sqrt(low / records)), float(np.sqrt(high / records))),
        limit,
        _above(statistic, q, rest, records * allowed**2),
    )


def significance(errors: FloatArray, allowed: float = 0.0) -> float:
    """`MeanError.p` alone, which takes a hundredth of the time."""
    records, q = errors.shape
    return _above(_statistic(errors), q, records - q, records * allowed**2)


def _statistic(errors: FloatArray) -> float:
    """That has the F distribution; 0 where there are no errors, infinite where a part of them does not scatter."""
    records, q = errors.shape
    mean = errors.mean(axis=0)
    length = np.sqrt(np.mean(errors**2, axis=0))
    used = length > 0.0
    if not used.any():
        return 0.0
    _, values, right = np.linalg.svd((errors - mean)[:, used] / length[used], full_matrices=False)
    if values[-1] <= 1e-12 * np.sqrt(records):
        # the same error in every record, in some direction: that has no scatter to be judged by
        return float("inf")
    whitened = (right @ (mean[used] / length[used])) / values
    return float(whitened @ whitened) * records * (records - q) / q


def _size(statistic: float, records: int, q: int) -> float:
    """E T^2 = (K - 1) (q + K d^2) / (K - q - 2), solved for d."""
    squared = statistic * q * (records - 1.0) / (records - q)
    return float(np.sqrt(max(squared * (records - q - 2.0) / (records - 1.0) - q, 0.0) / records))


def _above(statistic: float, q: int, rest: int, noncentrality: float) -> float:
    """Probability of a larger one."""
    if noncentrality == 0.0:
        return float(f_distribution.sf(statistic, q, rest))
    return float(ncf.sf(statistic, q, rest, noncentrality))


def _tail(probability: float, q: int, rest: int, noncentrality: float) -> float:
    if noncentrality == 0.0:
        return float(f_distribution.isf(probability, q, rest))
    return float(ncf.isf(probability, q, rest, noncentrality))


def _noncentrality(statistic: float, q: int, rest: int, above: float) -> float:
    """Which makes a larger statistic as probable as this; 0 where even that is too much."""
    if float(f_distribution.sf(statistic, q, rest)) >= above:
        return 0.0

    def excess(value: float) -> float:
        return float(ncf.sf(statistic, q, rest, value)) - above

    high = 4.0 * (q * statistic + 10.0)
    while excess(high) < 0.0 and high < 1e12:
        high *= 4.0
    return float(brentq(excess, 0.0, high)) if excess(high) > 0.0 else high
