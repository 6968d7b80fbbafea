"""Sample covariance functions, over one or several experiments."""

from collections.abc import Sequence

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from sysid.records.arrays import FloatArray


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
