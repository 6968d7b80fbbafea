"""Frequencies at which estimates are compared with the truth."""

import numpy as np

from sysid import StateSpace
from sysid.records.arrays import FloatArray

COUNT = 16
LOWEST = 0.05
"""Of the lowest bandwidth. Below it the response is the static gain again, its imaginary part all but zero and known
all but exactly: ratios to its deviation would be ratios of rounding errors."""
HIGHEST = 0.6
"""Of the Nyquist frequency. Above it hardly a system here responds any more."""


def comparison_frequencies(truth: StateSpace) -> FloatArray:
    """Frequencies on a logarithmic grid over all that matters of a system (16,), Hz.

    Where there is no bandwidth they begin below the slowest pole.
    """
    nyquist = 0.5 / truth.dt
    bandwidths = truth.bandwidth()
    known = bandwidths[np.isfinite(bandwidths)]
    if len(known):
        corner = float(known.min())
    else:
        poles = truth.input_path().poles()
        speeds = np.abs(np.log(poles[np.abs(poles) > 1e-6])) / (2.0 * np.pi * truth.dt)
        corner = float(speeds.min(initial=HIGHEST * nyquist))
    return np.geomspace(LOWEST * min(corner, nyquist), HIGHEST * nyquist, COUNT)
