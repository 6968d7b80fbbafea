"""Resolution of recorded values: the steps of an encoder or a converter, or the digits of a file."""

import numpy as np

from sysid.records.arrays import FloatArray

WHOLE = 0.05  # distance from a whole number of steps that counts as none
FEWEST_LEVELS = 3  # different values that show a step at least


def resolution(values: FloatArray) -> float:
    """The step of which all differences of values (N,) are multiples; 0 where there is none, NaN are left out.

    Differences, so that an offset that was subtracted does not matter.
    """
    levels = np.unique(values[np.isfinite(values)])
    if len(levels) < FEWEST_LEVELS:
        return 0.0
    # values that differ by rounding are one level
    rounding = 8.0 * np.finfo(float).eps * float(np.abs(levels).max())
    differences = np.diff(levels)
    differences = differences[differences > rounding]
    if len(differences) + 1 < FEWEST_LEVELS:
        return 0.0
    step = float(differences.min())
    multiples = differences / step
    distance = np.abs(multiples - np.round(multiples))
    if rounding > WHOLE * step or (distance > WHOLE).any():
        return 0.0
    return step
