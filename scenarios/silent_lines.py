"""Nonlinear distortion where nothing was excited: even and odd apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.multisines import Multisines
from sysid import BestLinearApproximation, IOData
from sysid.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SilentLines:
    """Distortion at the silent lines of an odd-random grid, as root mean square over the excited band.

    Attributes:
        even: Of even order, and all else that falls on even lines (ny,), rad.
        odd: Of odd order (ny,), rad: the silent odd lines stand for all odd ones.
        noise: Noise of one period over the same band (ny,), rad.
    """

    even: FloatArray
    odd: FloatArray
    noise: FloatArray


def silent_lines(
    records: Sequence[IOData], approximation: BestLinearApproximation, multisines: Multisines
) -> SilentLines:
    """Read even and odd distortion at the silent lines [Pintelon2012, sec. 4.3].

    What the command itself holds at those lines, because it was rounded or limited, passes through the system and is
    taken off first, with the response interpolated between the excited lines.

    Args:
        records: Steady, whole periods.
        approximation: The response.
        multisines: The excitation class, on an odd-random grid.

    Returns:
        The levels, noise taken off and not below zero.
    """
    period, band = multisines.samples, multisines.band
    silent = np.setdiff1d(band, multisines.lines)
    g = approximation.response.response
    at = np.empty((len(silent), *g.shape[1:]), dtype=complex)
    for i, j in np.ndindex(g.shape[1:]):
        real, imaginary = (np.interp(silent, multisines.lines, part) for part in (g[:, i, j].real, g[:, i, j].imag))
        at[:, i, j] = real + 1j * imaginary
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
    return SilentLines(
        even=_rms(level[~is_odd].sum(axis=0)),
        odd=_rms(level[is_odd].sum(axis=0) * np.sum(band % 2 == 1) / max(np.sum(is_odd), 1)),
        noise=_rms(floor.sum(axis=0) * len(band) / len(silent)),
    )


def _rms(mean_square: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(mean_square, 0.0)))
