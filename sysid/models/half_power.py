"""Half-power bandwidths of models: the first crossing of the gain, solved for to rounding."""

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
        # an integrator has no gain at 0 Hz, and the gain of a differentiator there is rounding
        if not np.isfinite(level) or level <= 1e-13 * magnitude[:, i, j].max():
            continue
        below = np.flatnonzero(magnitude[:, i, j] < level)
        if not len(below):
            continue
        k = int(below[0])
        lower = grid[k - 1] if k else 0.0
        out[i, j] = _crossing(model.channel(j, i), level, lower, grid[k])
    return out


def _crossing(channel: Responding, level: float, lower: float, upper: float) -> float:
    """Frequency in Hz between two bounds at which the gain of one path crosses a level."""

    def excess(f: float) -> float:
        return float(abs(channel.frequency_response(f)[0, 0, 0]) - level)

    at_lower, at_upper = excess(lower), excess(upper)
    # a path alone rounds otherwise than in the whole response: a crossing at a bound may then lie on neither side
    if at_lower * at_upper > 0.0:
        return lower if abs(at_lower) < abs(at_upper) else upper
    # nearly exact: the delta method takes differences between close models, which a tolerance would hide
    return float(scipy.optimize.brentq(excess, lower, upper, xtol=1e-14 * upper, rtol=1e-13))
