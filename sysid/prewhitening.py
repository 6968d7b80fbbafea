"""Prewhitening: an input made white, and the outputs filtered alike."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from sysid.arrays import FloatArray
from sysid.autoregression import autoregression
from sysid.data import IOData


def prewhitened(experiments: Sequence[IOData], channel: int, order: int) -> list[tuple[FloatArray, FloatArray]]:
    """Filter input and outputs by the whitener of one input [Ljung1999, sec. 6.1].

    The response from the filtered input to the filtered output is that of the system. Samples that the filter has to
    start from, and the initialisation window, are left out.

    Args:
        experiments: Records with zero mean.
        channel: Which input.
        order: Coefficients of the autoregressive model of the input; 0 leaves everything as it is.

    Returns:
        Per experiment the whitened input (n, 1) and the filtered outputs (n, ny).
    """
    whitener = np.ones(1)
    if order:
        # zeros between the experiments keep their products apart
        gap = np.zeros(order)
        joined = np.concatenate([part for e in experiments for part in (e.u[:, channel], gap)])
        whitener, _ = autoregression(joined, order)
    parts = []
    for e in experiments:
        start = max(order, e.window)
        u = lfilter(whitener, [1.0], e.u[:, [channel]], axis=0)[start:]
        parts.append((u, lfilter(whitener, [1.0], e.y, axis=0)[start:]))
    return parts
