"""Sample covariance functions, autoregressive models of a signal, and prewhitening by them."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData


def covariance_function(x: Sequence[FloatArray], z: Sequence[FloatArray], lags: int) -> FloatArray:
    """R_xz(tau) = 1/N sum_t x(t + tau) z(t)', tau = -lags..lags [Ljung1999, sec. 6.1].

    Division is by the total N at every lag (biased, positive semidefinite). Means are left as they are. Products never
    reach over the boundary of an experiment.

    Args:
        x: First signal per experiment (N_i, nx).
        z: Second signal per experiment (N_i, nz).
        lags: Largest lag.

    Returns:
        Covariances (2 lags + 1, nx, nz), lag zero in the middle.
    """
    total = np.zeros((2 * lags + 1, x[0].shape[1], z[0].shape[1]))
    for xi, zi in zip(x, z, strict=True):
        size = next_fast_len(len(xi) + lags + 1, real=True)
        products = rfft(xi, size, axis=0)[:, :, None] * rfft(zi, size, axis=0).conj()[:, None, :]
        circular = irfft(products, size, axis=0)
        total += np.concatenate((circular[size - lags :] if lags else circular[:0], circular[: lags + 1]))
    return total / sum(len(xi) for xi in x)


def covariance_with_gaps(x: Sequence[FloatArray], z: Sequence[FloatArray], lags: int) -> FloatArray:
    """The same from the products whose two samples are known, NaN marking those that are not.

    The mean of the known products times 1 - |tau|/N: without gaps exactly `covariance_function`. It need not be
    positive semidefinite. A lag without a product is zero.

    Args:
        x: First signal per experiment (N_i, nx).
        z: Second signal per experiment (N_i, nz).
        lags: Largest lag.

    Returns:
        Covariances (2 lags + 1, nx, nz), lag zero in the middle.
    """
    known_x, known_z = ([np.isfinite(part).astype(float) for part in s] for s in (x, z))
    filled_x, filled_z = ([np.nan_to_num(part, nan=0.0) for part in s] for s in (x, z))
    products = covariance_function(filled_x, filled_z, lags)
    known = covariance_function(known_x, known_z, lags)
    ones = [np.ones((len(part), 1)) for part in x]
    possible = covariance_function(ones, ones, lags)
    # counts divided by N; rounding of the transform stands for none
    some = known > 0.5 / sum(len(part) for part in x)
    return np.where(some, products / np.where(some, known, 1.0) * possible, 0.0)


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
