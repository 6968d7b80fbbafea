"""Statistics of one record's error of the frequency response: each has a known mean for an honest, perfect estimator.

Errors are real and imaginary part (m, nf, ny, nu, 2); covariances (nf, ny, nu, 2, 2). A part of the response that no
estimate can get wrong, as the imaginary one at 0 Hz, is left out: `free` (nf, ny, nu, 2) says which are not.
"""

import numpy as np
from scipy.stats import norm

from sysid.records.arrays import ComplexArray, FloatArray

TWO_SIDED_95 = float(norm.ppf(0.975))
NOTHING = 1e-12
"""A part of the response with less than this share of the variance of both parts does not vary."""


def parts_of(difference: ComplexArray) -> FloatArray:
    """Real and imaginary part of differences of responses, on a new last axis."""
    return np.stack((difference.real, difference.imag), axis=-1)


def free_parts(covariance: FloatArray) -> np.ndarray:
    """Parts that vary (nf, ny, nu, 2), booleans."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.asarray(variances > NOTHING * np.maximum(variances.sum(axis=-1, keepdims=True), np.finfo(float).tiny))


def power_by_frequency(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """|error|^2 over its variance (m, nf, ny, nu), NaN where nothing varies; its mean is 1."""
    variances = np.where(free, np.diagonal(covariance, axis1=-2, axis2=-1), 0.0).sum(axis=-1)
    powers = np.sum(errors**2, axis=-1)
    return _ratio(powers, np.broadcast_to(np.where(free.any(axis=-1), variances, np.nan), powers.shape))


def power(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of |error|^2 over its variance (m,); its mean is 1."""
    return np.asarray(np.nanmean(power_by_frequency(errors, covariance, free), axis=(1, 2, 3)))


def normalised(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of error' covariance^-1 error over the number of its parts (m,); its mean is 1.

    A covariance that is singular or none at all makes it infinite; one that is infinite makes it 0.
    """
    real, imaginary = errors[..., 0], errors[..., 1]
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    determinant = a * c - b * b
    positive = (a > 0.0) & (c > 0.0) & (determinant > 0.0)
    squares = c * real**2 - 2.0 * b * real * imaginary + a * imaginary**2
    both = _ratio(squares, np.broadcast_to(np.where(positive, 2.0 * determinant, 0.0), squares.shape))
    one = np.where(free[..., 0], _ratio(real**2, np.broadcast_to(a, real.shape)), np.nan)
    other = np.where(free[..., 1], _ratio(imaginary**2, np.broadcast_to(c, real.shape)), np.nan)
    values = np.where(free.all(axis=-1), both, np.where(free[..., 0], one, other))
    endless = np.isinf(covariance).any(axis=(-2, -1)) & free.any(axis=-1)
    values = np.where(endless, 0.0, values)
    return np.asarray(np.nanmean(values, axis=(1, 2, 3)))


def covered(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Share of the parts of the response within their 95 % intervals (m,); its mean is 0.95."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    inside = errors**2 <= TWO_SIDED_95**2 * variances
    return np.asarray(inside[:, free].mean(axis=1))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """Quotient; infinite where it is divided by nothing or less, NaN where by NaN."""
    infinite = np.where(np.isnan(below), np.nan, np.inf)
    return np.divide(above, below, out=infinite, where=below > 0.0)
