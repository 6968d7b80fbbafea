"""Prewhitening: an input made white, and the outputs filtered alike."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from sysid.polynomial.autoregression import autoregression
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData


def prewhitened(experiments: Sequence[IOData], channel: int, order: int) -> list[tuple[FloatArray, FloatArray]]:
    """Filter inputs and outputs by the whitener of one input [Ljung1999, sec. 6.1].

    The response from the filtered inputs to the filtered outputs is that of the system. The first `order` samples are
    the start-up of the filter: leave them out.

    Args:
        experiments: Records with zero mean.
        channel: Which input is to become white.
        order: Coefficients of its autoregressive model; 0 leaves everything as it is.

    Returns:
        Per experiment all inputs (N, nu) and outputs (N, ny), filtered.
    """
    whitener = np.ones(1)
    if order:
        # zeros between the experiments keep their products apart
        gap = np.zeros(order)
        joined = np.concatenate([part for e in experiments for part in (e.u[:, channel], gap)])
        whitener, _ = autoregression(joined, order)
    return [(lfilter(whitener, [1.0], e.u, axis=0), lfilter(whitener, [1.0], e.y, axis=0)) for e in experiments]
