"""Interval of a response's magnitude beside a normal error [Rice1945]."""

import numpy as np
import scipy

from sysid.records.arrays import FloatArray


def rice_interval(ratio: FloatArray, dimensions: int) -> tuple[FloatArray, FloatArray]:
    """95 % interval of a vector's length from its measured length (n,), both in standard deviations."""
    # A length that is small by chance must not bound the true one closer than one standard deviation.
    low, high = (
        np.sqrt(scipy.special.chndtrinc(np.maximum(ratio, least) ** 2, dimensions, probability))
        for least, probability in ((0.1, 0.975), (1.0, 0.025))
    )
    return low, high
