"""Sample covariance functions, autoregressive models of a signal, and prewhitening by them."""

from collections.abc import Sequence

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LARGEST_PRODUCT = 4_000_000  # entries of the products of two spectra, 32 MB


def covariance_function(x: Sequence[FloatArray], z: Sequence[FloatArray], lags: int) -> FloatArray:
    """R_xz(tau) = 1/N sum_t x(t + tau) z(t)', tau = -lags..lags, (2 lags + 1, nx, nz) [Ljung1999, sec. 6.1].

    The signals are x (N_i, nx) and z (N_i, nz) of each experiment. Division is by the total N at every lag (biased,
    positive semidefinite). Means are not removed. Products do not cross the boundary of an experiment. Blocks of
    samples bound the memory.
    """
    total = np.zeros((2 * lags + 1, x[0].shape[1], z[0].shape[1]))
    length = max(LARGEST_PRODUCT // max(total[0].size, 1), 4 * lags, 1)
    for xi, zi in zip(x, z, strict=True):
        for begin in range(0, len(zi), length):
            first, end = max(begin - lags, 0), min(begin + length, len(zi))
            around, part = xi[first : end + lags], np.concatenate((np.zeros_like(zi[first:begin]), zi[begin:end]))
            size = scipy.fft.next_fast_len(len(around) + lags + 1, real=True)
            spectra = (scipy.fft.rfft(signal, size, axis=0) for signal in (around, part))
            products = np.einsum("fi,fj->fij", next(spectra), next(spectra).conj())
            circular = scipy.fft.irfft(products, size, axis=0)
            total += np.concatenate((circular[size - lags :] if lags else circular[:0], circular[: lags + 1]))
    return total / sum(len(xi) for xi in x)


def covariance_with_gaps(x: Sequence[FloatArray], z: Sequence[FloatArray], lags: int) -> FloatArray:
    """Covariance function of signals with missing samples (NaN), from the products of known samples.

    The mean of the known products times 1 - |tau|/N: without gaps exactly `covariance_function`. It need not be
    positive semidefinite. A lag without a product is zero.
    """
    known_x, known_z = ([np.isfinite(part).astype(float) for part in s] for s in (x, z))
    filled_x, filled_z = ([np.nan_to_num(part, nan=0.0) for part in s] for s in (x, z))
    products = covariance_function(filled_x, filled_z, lags)
    known = covariance_function(known_x, known_z, lags)
    ones = [np.ones((len(part), 1)) for part in x]
    possible = covariance_function(ones, ones, lags)
    # counts divided by N, up to rounding of the transform: half a product counts as none
    some = known > 0.5 / sum(len(part) for part in x)
    return np.where(some, products / np.where(some, known, 1.0) * possible, 0.0)


GRID = 8192  # frequencies of the spectrum: correlations of slow models must decay within half of them


def autoregression(e: FloatArray, order: int, *, select: bool = False) -> tuple[FloatArray, FloatArray]:
    """Autoregressive model of a signal by the Yule-Walker equations, and the correlations of that model.

    Unlike sample correlations these decay smoothly, so that sums over lags do not accumulate noise. The signal (N,) has
    zero mean, NaN for missing samples. With `select`, BIC may prefer fewer coefficients [Schwarz1978]. Returned are the
    whitening filter 1, a1, ..., (order + 1,), whose inverse is stable, and normalised correlations at lags 0, 1, ...
    """
    covariances = covariance_with_gaps if np.isnan(e).any() else covariance_function
    r = covariances([e[:, None]], [e[:, None]], order)[order:, 0, 0]
    # keeps the equations regular for a signal of a few sinusoids, or one that grows
    r[0] *= 1.0 + 1e-9
    if covariances is covariance_with_gaps:
        # the smallest white part that makes them those of a signal
        r[0] += max(-1.01 * float(np.linalg.eigvalsh(scipy.linalg.toeplitz(r))[0]), 0.0)
    if select:
        # variances of the one-step errors of all orders
        variances = np.diag(np.linalg.cholesky(scipy.linalg.toeplitz(r))) ** 2
        order = int(np.argmin(np.log(variances) + np.arange(order + 1) * np.log(len(e)) / len(e)))
    solution = scipy.linalg.solve_toeplitz(r[:order], r[1 : order + 1]) if order else np.zeros(0)
    whitener = np.concatenate(([1.0], -solution))
    spectrum = 1.0 / np.abs(scipy.fft.rfft(whitener, GRID)) ** 2
    correlations = scipy.fft.irfft(spectrum)[: min(len(e), GRID // 2)]
    return whitener, correlations / correlations[0]


def prewhitened(experiments: Sequence[IOData], channel: int, order: int) -> list[tuple[FloatArray, FloatArray]]:
    """Filter inputs (N, nu) and outputs (N, ny) of each experiment by the whitener of one input [Ljung1999, sec. 6.1].

    The response from the filtered inputs to the filtered outputs is that of the system. The records have zero mean. The
    first `order` samples are the transient of the filter, an autoregressive model of that order: omit them.
    """
    whitener = np.ones(1)
    if order:
        # zeros between the experiments keep their products apart
        gap = np.zeros(order)
        joined = np.concatenate([part for e in experiments for part in (e.u[:, channel], gap)])
        whitener, _ = autoregression(joined, order)
    return [
        (scipy.signal.lfilter(whitener, [1.0], e.u, axis=0), scipy.signal.lfilter(whitener, [1.0], e.y, axis=0))
        for e in experiments
    ]
