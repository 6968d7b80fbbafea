"""Autoregressive model of a disturbance, by the Yule-Walker equations."""

import numpy as np
from scipy.fft import irfft, rfft
from scipy.linalg import solve_toeplitz

from sysid.polynomial.correlation import covariance_function
from sysid.records.arrays import FloatArray

GRID = 8192


def autoregression(e: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    """Whitener of a signal, and the correlations that it stands for.

    Unlike sample correlations these fall off smoothly, so that a sum over lags does not gather noise.

    Args:
        e: Signal with zero mean (N,).
        order: Number of coefficients.

    Returns:
        The whitener 1, a1, ..., (order + 1,), whose inverse is stable, and normalised correlations at lags 0, 1, ...
        (k,).
    """
    r = covariance_function([e[:, None]], [e[:, None]], order)[order:, 0, 0]
    # keeps the equations regular where the signal is a few sinusoids, or grows
    r[0] *= 1.0 + 1e-9
    whitener = np.concatenate(([1.0], -solve_toeplitz(r[:-1], r[1:])))
    spectrum = 1.0 / np.abs(rfft(whitener, GRID)) ** 2
    correlations = irfft(spectrum)[: min(len(e), GRID // 2)]
    return whitener, correlations / correlations[0]
