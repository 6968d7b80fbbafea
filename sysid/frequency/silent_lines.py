"""Even and odd nonlinear distortion, read at the silent lines of an odd-random multisine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid.frequency.bla import BestLinearApproximation
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData


@dataclass(frozen=True, eq=False)
class SilentLines(Locked):
    """Distortion at the silent lines of an odd-random grid, as root mean square over the excited band.

    Attributes:
        even: Of even order, and all else that falls on even lines (ny,), in the unit of the output.
        odd: Of odd order (ny,): the silent odd lines stand for all odd ones.
        noise: Noise of one period over the same band (ny,).
    """

    even: FloatArray
    odd: FloatArray
    noise: FloatArray


def silent_lines(
    records: Sequence[IOData], approximation: BestLinearApproximation, period: int, band: NDArray[np.int_]
) -> SilentLines:
    """Read even and odd distortion at the silent lines [Pintelon2012, sec. 4.3].

    The input itself may have some power at those lines, because it is rounded or limited. It passes through the system
    and is subtracted first, with the response interpolated between the excited lines.

    Args:
        records: Steady records of whole periods, two or more each.
        approximation: The best linear approximation at the excited lines.
        period: Length of a period in samples.
        band: All multiples of 1 / (period dt) between the lowest and the highest line, excited or silent.

    Returns:
        The levels less noise, not below zero.
    """
    silent = np.setdiff1d(band, approximation.lines)
    g = approximation.response.response
    at = np.empty((len(silent), *g.shape[1:]), dtype=complex)
    for i, j in np.ndindex(g.shape[1:]):
        at[:, i, j] = np.interp(silent, approximation.lines, g[:, i, j])
    power, noise = [], []
    for record in records:
        u, y = (
            np.fft.rfft(part.reshape(-1, period, part.shape[1]), axis=1)[:, silent] for part in (record.u, record.y)
        )
        errors = y - np.einsum("fij,pfj->pfi", at, u)
        scatter = errors.var(axis=0, ddof=1)
        power.append(np.abs(errors.mean(axis=0)) ** 2 - scatter / len(errors))
        noise.append(scatter)
    # A line X_k of numpy's transform carries the mean square 2 |X_k|^2 / N^2.
    level, floor = (2.0 * np.mean(part, axis=0) / period**2 for part in (power, noise))
    is_odd = silent % 2 == 1
    mean_squares = (
        level[~is_odd].sum(axis=0),
        level[is_odd].sum(axis=0) * np.sum(band % 2 == 1) / max(np.sum(is_odd), 1),
        floor.sum(axis=0) * len(band) / len(silent),
    )
    return SilentLines(*(np.sqrt(np.maximum(mean_square, 0.0)) for mean_square in mean_squares))
