"""Least squares on lagged signals without forming the regressors.

Columns of lagged signals repeat each other one sample later, so that their Gram matrix follows from its first rows by
sums of edge terms: the covariance method of linear prediction [Ljung1999, sec. 10.1].
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from sysid.polynomial.least_squares import SQUARE_SAFE
from sysid.records.arrays import FloatArray


def lagged_products(signals: FloatArray, lags: int, start: int) -> FloatArray:
    """Sums over t = start, ..., N-1 of s(t - i) r(t - j), lags i, j = 0, ..., lags, for all pairs of signals.

    Args:
        signals: Signals (N, ns).
        lags: Largest lag, at most `start`.
        start: First time.

    Returns:
        Sums (ns, lags + 1, ns, lags + 1).
    """
    n, count = signals.shape
    out = np.empty((count, lags + 1, count, lags + 1))
    for s in range(count):
        for r in range(count):
            # s(t) r(t - j) for all j; correlate runs from the largest lag down
            first = np.correlate(signals[start - lags :, r], signals[start:, s], "valid")[::-1]
            out[s, 0, r] = first
            out[r, :, s, 0] = first
    before = signals[start - lags : start][::-1].T
    last = signals[n - lags : n][::-1].T
    for i in range(lags):
        gained = before[:, i, None, None] * before - last[:, i, None, None] * last
        out[:, i + 1, :, 1:] = out[:, i, :, :-1] + gained
    return out


def solution(products: FloatArray, lags: Sequence[range], target: Sequence[float]) -> FloatArray | None:
    """Coefficients of lagged signals that explain a combination of the signals at lag zero.

    Args:
        products: As `lagged_products` gives them, summed over experiments.
        lags: Lags of each signal among the regressors.
        target: Weight of each signal in what is to be explained.

    Returns:
        Coefficients, signal by signal; None where regressors are so near to dependent that squares lose digits.
    """
    signal = np.repeat(np.arange(len(lags)), [len(part) for part in lags])
    lag = np.concatenate([np.asarray(part, dtype=int) for part in lags])
    gram = products[signal[:, None], lag[:, None], signal, lag]
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    if not len(lag) or not scale.all():
        return None
    try:
        factor = cho_factor(gram / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    if np.diag(factor[0]).min() * SQUARE_SAFE < 1.0:
        return None
    right = products[:, 0, signal, lag].T @ np.asarray(target)
    return np.asarray(cho_solve(factor, right / scale) / scale)
