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
    # a block much shorter than the lags would be transformed mostly for the samples around it
    length = max(LARGEST_PRODUCT // max(total[0].size, 1), 4 * lags, 1)
    for xi, zi in zip(x, z, strict=True):
        for begin in range(0, len(zi), length):
            total += _block_products(xi, zi, begin, min(begin + length, len(zi)), lags)
    return total / sum(len(xi) for xi in x)


def _block_products(x: FloatArray, z: FloatArray, begin: int, end: int, lags: int) -> FloatArray:
    """Sums of x(t + tau) z(t)' over t = begin, ..., end - 1, by the transform, (2 lags + 1, nx, nz)."""
    first = max(begin - lags, 0)
    around = x[first : end + lags]
    # both signals count time from `first`
    block = np.concatenate((np.zeros_like(z[first:begin]), z[begin:end]))
    # room for the lags of either sign, which would overlap in a shorter circular correlation
    size = scipy.fft.next_fast_len(len(around) + lags + 1, real=True)
    spectrum_x = scipy.fft.rfft(around, size, axis=0)
    spectrum_z = scipy.fft.rfft(block, size, axis=0)
    products = np.einsum("fi,fj->fij", spectrum_x, spectrum_z.conj())
    circular = scipy.fft.irfft(products, size, axis=0)
    # negative lags stand at the end of the circular correlation
    return np.concatenate((circular[size - lags : size], circular[: lags + 1]))


def covariance_with_gaps(x: Sequence[FloatArray], z: Sequence[FloatArray], lags: int) -> FloatArray:
    """Covariance function of signals with missing samples (NaN), from the products of known samples.

    The mean of the known products times 1 - |tau|/N: without gaps exactly `covariance_function`. It need not be
    positive semidefinite. A lag without a product is zero.
    """
    products = covariance_function(_gaps_as_zeros(x), _gaps_as_zeros(z), lags)
    # numbers of known products, and of all products, divided by N
    known_share = covariance_function(_masks(x), _masks(z), lags)
    ones = [np.ones((len(xi), 1)) for xi in x]
    total_share = covariance_function(ones, ones, lags)
    # these are counts up to rounding of the transform: half a product counts as none
    determined = known_share > 0.5 / sum(len(xi) for xi in x)
    return np.where(determined, products / np.where(determined, known_share, 1.0) * total_share, 0.0)


def _gaps_as_zeros(signals: Sequence[FloatArray]) -> list[FloatArray]:
    return [np.nan_to_num(signal, nan=0.0) for signal in signals]


def _masks(signals: Sequence[FloatArray]) -> list[FloatArray]:
    """One for known samples, zero for missing ones."""
    return [np.isfinite(signal).astype(float) for signal in signals]


GRID = 8192  # frequencies of the spectrum: correlations of slow models must decay within half of them


def autoregression(e: FloatArray, order: int, *, select: bool = False) -> tuple[FloatArray, FloatArray]:
    """Autoregressive model of a signal by the Yule-Walker equations, and the correlations of that model.

    Unlike sample correlations these decay smoothly, so that sums over lags do not accumulate noise. The signal (N,) has
    zero mean, NaN for missing samples. With `select`, BIC may prefer fewer coefficients [Schwarz1978]. Returned are the
    whitening filter 1, a1, ..., (order + 1,), whose inverse is stable, and normalised correlations at lags 0, 1, ...
    """
    covariances = covariance_with_gaps if np.isnan(e).any() else covariance_function
    r = covariances([e[:, None]], [e[:, None]], order)[order:, 0, 0]
    if not r[0] > 0.0:
        # squares of a signal that is rounding alone vanish: as white as any
        return np.eye(1, order + 1)[0], np.eye(1, min(len(e), GRID // 2))[0]
    # keeps the equations regular for a signal of a few sinusoids, or one that grows
    r[0] *= 1.0 + 1e-9
    if covariances is covariance_with_gaps:
        # the smallest white part that makes them those of a signal
        r[0] += max(-1.01 * float(np.linalg.eigvalsh(scipy.linalg.toeplitz(r))[0]), 0.0)
    if select:
        # variances of the one-step errors of all orders
        variances = np.diag(np.linalg.cholesky(scipy.linalg.toeplitz(r))) ** 2
        bic = np.log(variances) + np.arange(order + 1) * np.log(len(e)) / len(e)
        order = int(np.argmin(bic))
    # Levinson's recursion refuses an empty system
    solution = scipy.linalg.solve_toeplitz(r[:order], r[1 : order + 1]) if order else np.zeros(0)
    whitener = np.concatenate(([1.0], -solution))
    spectrum = 1.0 / np.abs(scipy.fft.rfft(whitener, GRID)) ** 2
    correlations = scipy.fft.irfft(spectrum)[: min(len(e), GRID // 2)]
    return whitener, correlations / correlations[0]


COLOUR = 20  # highest order of the autoregressive model of errors
ERRORS_PER_COEFFICIENT = 20  # of that model, at least


def colour(errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Autoregressive model of errors (N,), NaN where the output is missing: its whitener and its correlations."""
    order = min(COLOUR, int(np.isfinite(errors).sum()) // ERRORS_PER_COEFFICIENT)
    return autoregression(errors, order, select=True)


def relative_spectrum(whitener: FloatArray, correlations: FloatArray, angle: float) -> float:
    """Spectrum of errors at a frequency, rad per sample, relative to that of white errors of the same variance.

    Whitener and correlations are those of `colour`.
    """
    variance_of_innovations = float(whitener @ correlations[: len(whitener)])
    response = np.polyval(whitener[::-1], np.exp(-1j * angle))
    return variance_of_innovations / max(float(np.abs(response)) ** 2, float(np.finfo(float).tiny))


def prewhitened(experiments: Sequence[IOData], channel: int, order: int) -> list[tuple[FloatArray, FloatArray]]:
    """Filter inputs (N, nu) and outputs (N, ny) of each experiment by the whitener of one input [Ljung1999, sec. 6.1].

    The response from the filtered inputs to the filtered outputs is that of the system. The records have zero mean. The
    first `order` samples are the transient of the filter, an autoregressive model of that order: omit them.
    """
    whitener = np.ones(1)
    if order:
        # zeros behind every experiment keep its products apart from those of the next one
        separated = [np.append(e.u[:, channel], np.zeros(order)) for e in experiments]
        whitener, _ = autoregression(np.concatenate(separated), order)
    filtered = []
    for experiment in experiments:
        u = scipy.signal.lfilter(whitener, [1.0], experiment.u, axis=0)
        y = scipy.signal.lfilter(whitener, [1.0], experiment.y, axis=0)
        filtered.append((u, y))
    return filtered
