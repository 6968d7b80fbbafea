"""Even and odd nonlinear distortion, read at the silent lines of an odd-random multisine."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sysid.frequency.bla import BestLinearApproximation
from sysid.records.arrays import ComplexArray, FloatArray, Locked
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
    g_at_silent = np.empty((len(silent), *g.shape[1:]), dtype=complex)
    for i, j in np.ndindex(g.shape[1:]):
        g_at_silent[:, i, j] = np.interp(silent, approximation.lines, g[:, i, j])
    powers, noise_powers = [], []
    for record in records:
        u = _lines_of_periods(record.u, period, silent)
        y = _lines_of_periods(record.y, period, silent)
        errors = y - np.einsum("fij,pfj->pfi", g_at_silent, u)
        scatter = errors.var(axis=0, ddof=1)
        # the mean over periods still holds the noise divided by their number
        powers.append(np.abs(errors.mean(axis=0)) ** 2 - scatter / len(errors))
        noise_powers.append(scatter)
    # A line X_k of numpy's transform carries the mean square 2 |X_k|^2 / N^2.
    level = 2.0 * np.mean(powers, axis=0) / period**2
    noise = 2.0 * np.mean(noise_powers, axis=0) / period**2
    is_odd = silent % 2 == 1
    # the excited odd lines, which cannot be read, have the same distortion as the silent ones on average
    odd_lines = np.sum(band % 2 == 1)
    odd = level[is_odd].sum(axis=0) * odd_lines / max(np.sum(is_odd), 1)
    even = level[~is_odd].sum(axis=0)
    return SilentLines(
        even=np.sqrt(np.maximum(even, 0.0)),
        odd=np.sqrt(np.maximum(odd, 0.0)),
        noise=np.sqrt(np.maximum(noise.sum(axis=0) * len(band) / len(silent), 0.0)),
    )


def _lines_of_periods(signals: FloatArray, period: int, lines: NDArray[np.int_]) -> ComplexArray:
    """Transform of every period at some lines (periods, lines, channels)."""
    periods = signals.reshape(-1, period, signals.shape[1])
    return np.asarray(np.fft.rfft(periods, axis=1)[:, lines])
