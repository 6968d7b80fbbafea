"""Tests of residuals that keep their size on short records: whiteness, and independence of an input."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from sysid.polynomial.autoregression import autoregression
from sysid.polynomial.least_squares import solve
from sysid.polynomial.regressors import lagged
from sysid.records.arrays import FloatArray


def whiteness_p(correlations: FloatArray, counts: NDArray[np.int_]) -> FloatArray:
    """p-values of Q = N (N + 2) sum_k (r(k) - E r(k))^2 / (N - k), k = 1..h [LjungBox1978].

    Q has mean h and, on short records, a variance well above the 2 h of the chi-square distribution, which would reject
    white residuals of 250 samples twice as often as claimed. The variance is worked out for Gaussian white noise from
    the traces of the quadratic forms r(k), and Q compared with the F distribution of that mean and variance.

    Args:
        correlations: r(k) at lags 1..h, one column per signal (h, m).
        counts: N and the numbers of products at lags 1..h (h + 1,).

    Returns:
        One p-value per signal (m,).
    """
    h, n = len(correlations), float(counts[0])
    k = n - counts[1:].astype(float)
    # a mean that has been removed leaves correlations of about -1/N
    centred = correlations + ((n - k) / (n * (n - 1.0)))[:, None]
    statistic = n * (n + 2.0) * np.sum(centred**2 / (n - k)[:, None], axis=0)
    a, b = np.meshgrid(k, k)
    # E c(k)^2 c(l)^2 of the covariances of unit white noise; the power of c(0)^4 is that of a chi-square variable
    fourth = (n - a) * (n - b) + 12.0 * (n - a - b) + 4.0 * np.minimum(a, b)
    np.fill_diagonal(fourth, 3.0 * (n - k) ** 2 + 18.0 * n - 30.0 * k)
    fourth /= n * (n + 2.0) * (n + 4.0) * (n + 6.0)
    variance = (n * (n + 2.0)) ** 2 * float(np.sum(fourth / ((n - a) * (n - b)))) - h**2
    excess = variance / h - 2.0
    if excess <= 0.0:
        return np.asarray(chi2.sf(statistic, h), dtype=np.float64)
    second = (2.0 * h - 4.0 + 4.0 * variance / h) / excess
    return np.asarray(f_distribution.sf(statistic / h * second / (second - 2.0), h, second), dtype=np.float64)


def independence_p(e: Sequence[FloatArray], u: Sequence[FloatArray], lags: int) -> float:
    """p-value of "e does not depend on u(t), u(t - 1), ..., u(t - lags)".

    Both are filtered by the whitener of e; then an F test of the regression of e on the lags of u, which is exact for
    white Gaussian e, however short the record and whatever the input. Directions without power are left out.

    Args:
        e: Residuals per experiment (N_i,), zero mean.
        u: Input per experiment (N_i,), zero mean.
        lags: Largest lag; less than half of the shortest experiment.
    """
    samples = sum(len(part) for part in e)
    order = max(1, min(lags, samples // 20, min(len(part) for part in e) // 8))
    whitener, _ = autoregression(np.concatenate(e), order)
    start = order + lags
    # half of what there is must be left to judge the rest by
    reach = min(lags, sum(len(part) - start for part in e) // 2 - 1)
    phi, target = [], []
    for own, given in zip(e, u, strict=True):
        phi.append(lagged(lfilter(whitener, [1.0], given), range(reach + 1), start))
        target.append(lfilter(whitener, [1.0], own)[start:])
    columns, y = np.vstack(phi), np.concatenate(target)
    columns = columns - columns.mean(axis=0)
    y = y - y.mean()
    fit = solve(columns, y[:, None])
    freedom = len(y) - fit.rank - 1
    if fit.rank < 1 or freedom < 1:
        return np.nan
    left = float(fit.residual_gram[0, 0])
    explained = max(float(y @ y) - left, 0.0)
    return float(f_distribution.sf(explained / fit.rank * freedom / max(left, np.finfo(float).tiny), fit.rank, freedom))
