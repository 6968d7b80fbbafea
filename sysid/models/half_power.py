"""Search for half-power bandwidths."""

from typing import Protocol, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sysid.records.arrays import ComplexArray, FloatArray

HALF_POWER = 0.5  # -3.0103 dB


class Responding(Protocol):
    """A model in discrete or continuous time."""

    def dc_gain(self) -> FloatArray:
        """Gain at 0 Hz (ny, nu)."""

    def frequency_response(self, f_hz: ArrayLike) -> ComplexArray:
        """Response at frequencies in Hz (nf, ny, nu)."""

    def channel(self, input: int, output: int) -> Self:
        """The path from one input to one output."""


def half_power_frequencies(model: Responding, grid: FloatArray) -> FloatArray:
    """First frequency in Hz at which each gain has fallen by 3.01 dB from that at 0 Hz (ny, nu), as `bandwidth` says.

    The grid (nf,) in Hz rises, and is dense enough to see every crossing.
    """
    dc = model.dc_gain()
    out = np.full(dc.shape, np.nan)
    magnitude = np.abs(model.frequency_response(grid))
    for i, j in np.ndindex(out.shape):
        level = abs(dc[i, j]) * np.sqrt(HALF_POWER)
        if not np.isfinite(level) or level <= 1e-13 * magnitude[:, i, j].max():
            continue
        below = np.flatnonzero(magnitude[:, i, j] < level)
        if len(below):
            k = int(below[0])
            channel = model.channel(j, i)
            lower = grid[k - 1] if k else 0.0
            out[i, j] = scipy.optimize.brentq(
                lambda f, m=channel, v=level: abs(m.frequency_response(f)[0, 0, 0]) - v,
                lower,
                grid[k],
                xtol=1e-14 * grid[k],
                rtol=1e-13,
            )
    return out
