"""Mean error of repeated estimates in units of their own scatter: Hotelling's test with an allowance."""

from dataclasses import dataclass

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.singular_values import svd


@dataclass(frozen=True)
class MeanError:
    """Size of a mean error, here in standard deviations of one record's error.

    Attributes:
        size: Estimate free of the part that scatter alone has, 0 where that part is larger.
        interval: 95 % interval of the size.
        limit: Value that `size` exceeds with the given probability where the mean is as large as allowed.
    """

    size: float
    interval: tuple[float, float]
    limit: float


def mean_error(errors: FloatArray, false_alarm: float, allowed: float = 0.0) -> MeanError:
    """Hotelling's test of the mean of repeated errors, with an allowance [Anderson2003, sec. 5.2].

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
    rest, noncentrality = records - q, records * allowed**2
    # the noncentral distribution loses digits where there is no noncentrality
    if allowed:
        upper = scipy.stats.ncf.isf(false_alarm, q, rest, noncentrality)
    else:
        upper = scipy.stats.f.isf(false_alarm, q, rest)
    limit = _size(float(upper), records, q)
    statistic = f_statistic(errors)
    if not np.isfinite(statistic):
        return MeanError(np.inf, (np.inf, np.inf), limit)
    low, high = _noncentrality(statistic, q, rest, 0.025), _noncentrality(statistic, q, rest, 0.975)
    interval = (float(np.sqrt(low / records)), float(np.sqrt(high / records)))
    return MeanError(_size(statistic, records, q), interval, limit)


def f_statistic(errors: FloatArray) -> float:
    """F-distributed statistic of Hotelling's test, (K - q) / (q (K - 1)) T^2, of errors (K, q); see `mean_error`.

    It is 0 where there are no errors, infinite where some direction does not scatter.
    """
    records, q = errors.shape
    mean = errors.mean(axis=0)
    # T^2 does not change with the units of the columns: root mean squares of 1 keep its digits
    length = np.sqrt(np.mean(errors**2, axis=0))
    used = length > 0.0
    if not used.any():
        return 0.0
    _, values, right = svd((errors - mean)[:, used] / length[used], full_matrices=False)
    if values[-1] <= 1e-12 * np.sqrt(records):
        # the same error in every record, in some direction: it has no scatter to be judged by
        return float("inf")
    whitened = (right @ (mean[used] / length[used])) / values
    return float(whitened @ whitened) * records * (records - q) / q


def _size(statistic: float, records: int, q: int) -> float:
    """E T^2 = (K - 1) (q + K d^2) / (K - q - 2), solved for d."""
    squared = statistic * q * (records - 1.0) / (records - q)
    return float(np.sqrt(max(squared * (records - q - 2.0) / (records - 1.0) - q, 0.0) / records))


def _noncentrality(statistic: float, q: int, rest: int, above: float) -> float:
    """Noncentrality with which a larger statistic has the given probability; 0 where even that is too much."""
    if float(scipy.stats.f.sf(statistic, q, rest)) >= above:
        return 0.0

    def excess(value: float) -> float:
        return float(scipy.stats.ncf.sf(statistic, q, rest, value)) - above

    high = 4.0 * (q * statistic + 10.0)
    # the search for an end of the bracket stops at 1e12, which is returned as it is
    while excess(high) < 0.0 and high < 1e12:
        high *= 4.0
    if excess(high) <= 0.0:
        return high
    return float(scipy.optimize.brentq(excess, 0.0, high))
