"""Regressors of lagged signals, and the delay convention of all estimators.

y(t) = b1 u(t - nk) + b2 u(t - nk - 1) + ...: with nk = 1 the output depends on the previous input first; with
nk = 0 there is a direct term. B(q) carries nk leading zeros.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError


def lagged(signal: FloatArray, lags: range, start: int, ahead: int = 0) -> FloatArray:
    """Columns signal(t - lag), (N - start - ahead, lags), for t = start, ..., N - 1 - ahead; each column is contiguous.

    The lags are consecutive, none above `start`; negative ones need `ahead` samples that are left out at the end.
    """
    end = len(signal) - ahead
    out = np.empty((end - start, len(lags)), order="F")
    for k, lag in enumerate(lags):
        out[:, k] = signal[start - lag : end - lag]
    return out


def input_lags(nb: int, nk: int) -> range:
    """Lags of u that B spans: nk, ..., nk + nb - 1."""
    return range(nk, nk + nb)


def output_lags(n: int) -> range:
    """Lags of y (or of residuals) that a monic polynomial of degree n spans: 1, ..., n."""
    return range(1, n + 1)


def first_row(na: int, nb: Sequence[int], nk: Sequence[int], window: int = 0) -> int:
    """First time after the initialisation window at which every lag of y and u is in the record."""
    return max(na, window, *(n + k - 1 for n, k in zip(nb, nk, strict=True)), 0)


def arx_regressors(
    y: FloatArray, u: FloatArray, na: int, nb: Sequence[int], nk: Sequence[int], start: int
) -> FloatArray:
    """Rows [-y(t-1) ... -y(t-na), u1(t-nk1) ..., u2(t-nk2) ...] from t = start on [Ljung1999, sec. 4.2].

    Of y (N,) and u (N, nu), with nb and nk for each input; see `first_row` for the start: (N - start, na + sum(nb)).
    """
    blocks = [-lagged(y, output_lags(na), start)]
    for j in range(u.shape[1]):
        blocks.append(lagged(u[:, j], input_lags(nb[j], nk[j]), start))
    return np.hstack(blocks)


def arx_equations(
    y: Sequence[FloatArray],
    u: Sequence[FloatArray],
    na: int,
    nb: Sequence[int],
    nk: Sequence[int],
    starts: Sequence[int],
) -> tuple[FloatArray, FloatArray]:
    """`arx_regressors` and outputs (rows,) of several experiments, one after the other."""
    rows, targets = [], []
    for yi, ui, start in zip(y, u, starts, strict=True):
        rows.append(arx_regressors(yi, ui, na, nb, nk, start))
        targets.append(yi[start:])
    return np.vstack(rows), np.concatenate(targets)


BLOCK = 2**16  # rows of a regression of a long record that are formed at a time


def equation_blocks(
    y: Sequence[FloatArray],
    u: Sequence[FloatArray],
    na: int,
    nb: Sequence[int],
    nk: Sequence[int],
    starts: Sequence[int],
) -> Iterator[FloatArray]:
    """`arx_equations` as blocks [Phi y] of at most `BLOCK` rows, without those that have a missing sample."""
    for yi, ui, start in zip(y, u, starts, strict=True):
        for begin in range(start, len(yi), BLOCK):
            signals = slice(begin - start, min(begin + BLOCK, len(yi)))
            phi = arx_regressors(yi[signals], ui[signals], na, nb, nk, start)
            block = np.column_stack((phi, yi[signals][start:]))
            yield block[np.isfinite(block).all(axis=1)]


def complete_rows(phi: FloatArray, target: FloatArray, unknown: int) -> NDArray[np.bool_]:
    """Mask of the equations (rows,) without a missing sample.

    Raises:
        SysidError: Not more of them than unknown coefficients.
    """
    complete = np.isfinite(phi).all(axis=1) & np.isfinite(target)
    if complete.sum() <= unknown:
        reason, remedy = ("few", "") if complete.all() else ("many missing", "; arma, armax, bj and oe use all others")
        raise SysidError(
            f"too {reason} samples: {int(complete.sum())} of {len(phi)} equations are complete, {unknown} coefficients "
            f"need more{remedy}"
        )
    return complete
