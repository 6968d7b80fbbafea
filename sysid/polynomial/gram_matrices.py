"""Gram matrices of lagged signals, from first rows and edge terms instead of the whole regressor matrix."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.polynomial.least_squares import SQUARE_SAFE, refuse_overflow
from sysid.records.arrays import FloatArray


def lagged_products(signals: FloatArray, lags: int, start: int) -> FloatArray:
    """Sums over t = start, ..., N-1 of s(t - i) r(t - j) for all pairs of signals, (ns, lags + 1, ns, lags + 1).

    The signals are (N, ns), the lags i, j = 0, ..., lags, at most `start`.
    """
    n, count = signals.shape
    out = np.empty((count, lags + 1, count, lags + 1))
    for s in range(count):
        for r in range(count):
            # s(t) r(t - j) for all j; np.correlate returns the largest lag first
            by_lag = np.correlate(signals[start - lags :, r], signals[start:, s], "valid")[::-1]
            out[s, 0, r] = by_lag
            out[r, :, s, 0] = by_lag
    # one lag more of both signals shifts the sum by one sample: a product enters before its start, the last one leaves
    before = signals[start - lags : start][::-1].T
    last = signals[n - lags : n][::-1].T
    for i in range(lags):
        edges = before[:, i, None, None] * before - last[:, i, None, None] * last
        out[:, i + 1, :, 1:] = out[:, i, :, :-1] + edges
    return out


def lagged_solution(products: FloatArray, lags: Sequence[range], target: Sequence[float]) -> FloatArray | None:
    """Least-squares coefficients of lagged signals that explain a combination of the signals at lag zero.

    They come signal by signal from the `lagged_products`, summed over experiments, the lags of each signal among the
    regressors, and the weight of each in the combination, `target`. Those of the first signal, the output, are negated,
    as coefficients of A are. None if the regressors are too nearly dependent for normal equations.
    """
    signal = np.repeat(np.arange(len(lags)), [len(lags_of_signal) for lags_of_signal in lags])
    lag = np.concatenate([np.asarray(lags_of_signal, dtype=int) for lags_of_signal in lags])
    gram = products[signal[:, None], lag[:, None], signal, lag]
    refuse_overflow(gram)
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    if not len(lag) or not scale.all():
        return None
    try:
        factor = scipy.linalg.cho_factor(gram / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    if np.diag(factor[0]).min() * SQUARE_SAFE < 1.0:
        return None
    right = products[:, 0, signal, lag].T @ np.asarray(target)
    # coefficients of A, those of signal 0, stand on the other side of the equation
    signs = np.where(signal, 1.0, -1.0)
    return np.asarray(signs * scipy.linalg.cho_solve(factor, right / scale) / scale)


def hankel_moments(signals: Sequence[FloatArray], blocks: int) -> FloatArray:
    """Mean over t of Z(t) Z(t)', (blocks q, blocks q), with Z(t) = [z(t); ...; z(t + blocks - 1)] of z (N_i, q).

    Experiments are never joined. Blocks along a diagonal differ by one product at either end of the record, so that
    only the first block row needs sums over the whole record.
    """
    q = signals[0].shape[1]
    out = np.zeros((blocks, blocks, q, q))
    for z in signals:
        for lag in range(blocks):
            diagonal = _diagonal_of_moments(z, blocks, lag)
            index = np.arange(blocks - lag)
            out[index, index + lag] += diagonal
            if lag:
                out[index + lag, index] += diagonal.transpose(0, 2, 1)
    count = sum(len(z) - blocks + 1 for z in signals)
    return out.transpose(0, 2, 1, 3).reshape(blocks * q, blocks * q) / count


def _diagonal_of_moments(z: FloatArray, blocks: int, lag: int) -> FloatArray:
    """Sums over t of z(t + i) z(t + i + lag)' for i = 0, ..., blocks - lag - 1, (blocks - lag, q, q), of z (N, q)."""
    q = z.shape[1]
    columns = len(z) - blocks + 1
    first = z[:columns].T @ z[lag : lag + columns]
    steps = blocks - lag - 1
    entering = z[columns : columns + steps, :, None] * z[columns + lag : columns + lag + steps, None]
    leaving = z[:steps, :, None] * z[lag : lag + steps, None]
    changes = np.cumsum(entering - leaving, axis=0)
    return np.asarray(first + np.concatenate((np.zeros((1, q, q)), changes)))


def hankel_triangle(
    signals: Sequence[FloatArray], blocks: int, moments: FloatArray, sequence: FloatArray
) -> FloatArray:
    """Lower triangle L with L L' = moments, rows in a given sequence.

    It is computed from the moments if they are far from singular, else from the data (N_i, q) per experiment.
    """
    index = np.asarray(sequence, dtype=int)
    selected = moments[np.ix_(index, index)]
    scale = np.sqrt(np.maximum(np.diag(selected), np.finfo(float).tiny))
    try:
        triangle = np.linalg.cholesky(selected / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        triangle = None
    if triangle is None or np.diag(triangle).min() * SQUARE_SAFE < 1.0:
        rows = np.vstack([_hankel_rows(z, blocks) for z in signals])
        upper = np.asarray(np.linalg.qr(rows[:, index] / (scale * np.sqrt(len(rows))), mode="r"))
        # fewer rows than columns leave the last columns of the triangle zero
        triangle = np.zeros((len(index), len(index)))
        triangle[:, : len(upper)] = upper.T
    return scale[:, None] * triangle


def _hankel_rows(z: FloatArray, blocks: int) -> FloatArray:
    """Rows [z(t)', ..., z(t + blocks - 1)'] of a signal (N, q)."""
    windows = np.lib.stride_tricks.sliding_window_view(z, blocks, axis=0)
    return windows.transpose(0, 2, 1).reshape(-1, blocks * z.shape[1])
