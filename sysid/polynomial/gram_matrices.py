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
    out = np.zeros((blocks, q, blocks, q))
    for z in signals:
        out += _hankel_sums(z, blocks)
    count = sum(len(z) - blocks + 1 for z in signals)
    return out.reshape(blocks * q, blocks * q) / count


def _hankel_sums(z: FloatArray, blocks: int) -> FloatArray:
    """Sums over t of z(t + i) z(t + j)' for i, j = 0, ..., blocks - 1, (blocks, q, blocks, q), of z (N, q)."""
    q = z.shape[1]
    columns = len(z) - blocks + 1
    out = np.empty((blocks, q, blocks, q))
    out[0] = lagged_sums(z, z, blocks).transpose(1, 0, 2)
    # one sample later, a product enters at the end of the sum and the first one leaves
    first, last = z[: blocks - 1], z[columns : columns + blocks - 1]
    for i in range(blocks - 1):
        change = np.multiply.outer(last[i], last[i:]) - np.multiply.outer(first[i], first[i:])
        out[i + 1, :, i + 1 :] = out[i, :, i:-1] + change
    # sums below the diagonal are those above it
    for i in range(1, blocks):
        out[i, :, :i] = out[:i, :, i].transpose(2, 0, 1)
    return out


def lagged_sums(s: FloatArray, z: FloatArray, lags: int) -> FloatArray:
    """Sums over t = 0, ..., N - lags of s(t) z(t + j)' for j = 0, ..., lags - 1, (lags, p, q), of s (N, p), z (N, q).

    Stretches of `lags` samples as rows turn all lags into products of two large matrices: each stretch with itself
    and with the next one. Half of the products are not needed, and still cost less than a pass for every lag.
    """
    (steps, p), q = s.shape, z.shape[1]
    columns = steps - lags + 1
    # the last stretch needs a whole one after it
    stretches = max((columns - 1) // lags, 0)
    covered = stretches * lags
    out = np.zeros((lags, p, q))
    if stretches:
        present = np.ascontiguousarray(s[:covered]).reshape(stretches, lags * p)
        same = np.ascontiguousarray(z[:covered]).reshape(stretches, lags * q)
        following = np.ascontiguousarray(z[lags : covered + lags]).reshape(stretches, lags * q)
        products = np.empty((lags, p, 2 * lags, q))
        products[:, :, :lags] = (present.T @ same).reshape(lags, p, lags, q)
        products[:, :, lags:] = (present.T @ following).reshape(lags, p, lags, q)
        for i in range(lags):
            out += products[i, :, i : i + lags].transpose(1, 0, 2)
    rest = columns - covered
    windows = np.lib.stride_tricks.sliding_window_view(z[covered:], rest, axis=0)
    return np.asarray(out + (windows @ s[covered : covered + rest]).transpose(0, 2, 1))


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
