"""Errors of estimates weighed by their covariances: ratios to the variance, normalised squares, coverage.

Errors of responses are real and imaginary part (m, nf, ny, nu, 2), covariances (nf, ny, nu, 2, 2). A part of the
response that no estimate can get wrong, such as the imaginary part at 0 Hz, is left out: `free` (nf, ny, nu, 2) marks
the others.
"""

import numpy as np
import scipy

from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import ComplexArray, FloatArray


def normalised_error(error: FloatArray, covariance: FloatArray) -> float:
    """Error of parameters weighed by its covariance, e' P^-1 e: chi-square of p degrees of freedom [Ljung1999, ch. 9].

    It is infinite where the covariance (p, p) is not positive definite.
    """
    # scaled to ones on the diagonal first: parameters differ by orders of magnitude
    deviations = np.sqrt(np.diag(covariance))
    if not (deviations > 0.0).all():
        return float("inf")
    try:
        factor = scipy.linalg.cho_factor(covariance / np.outer(deviations, deviations))
    except (scipy.linalg.LinAlgError, ValueError):
        return float("inf")
    scaled = error / deviations
    return float(scaled @ scipy.linalg.cho_solve(factor, scaled))


def real_and_imaginary(difference: ComplexArray) -> FloatArray:
    """Real and imaginary part of differences of responses (..., nf, ny, nu), on a new last axis of length 2."""
    return np.stack((difference.real, difference.imag), axis=-1)


def free_parts(covariance: FloatArray) -> np.ndarray:
    """Parts of the response that vary (nf, ny, nu, 2), with more than a share of 1e-12 of the variance of both."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    floor = np.maximum(variances.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(variances > 1e-12 * floor)


def variance_ratio_by_frequency(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """|error|^2 over its variance (m, nf, ny, nu), NaN where nothing varies; its mean is 1."""
    of_parts = np.diagonal(covariance, axis1=-2, axis2=-1)
    variances = np.where(free, of_parts, 0.0).sum(axis=-1)
    return _ratio(np.sum(errors**2, axis=-1), np.where(free.any(axis=-1), variances, np.nan))


def variance_ratio(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of |error|^2 / variance of each estimate (m,), 1 on average where the variance is right."""
    return np.asarray(np.nanmean(variance_ratio_by_frequency(errors, covariance, free), axis=(1, 2, 3)))


def normalised_square(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Mean over frequencies of error' covariance^-1 error over the number of its parts (m,); its mean is 1.

    A covariance that is not positive definite makes it infinite; an infinite one makes it 0.
    """
    real, imaginary = errors[..., 0], errors[..., 1]
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    with np.errstate(invalid="ignore"):  # infinite covariances, see the end
        determinant = a * c - b * b
        positive = (a > 0.0) & (c > 0.0) & (determinant > 0.0)
        squares = c * real**2 - 2.0 * b * real * imaginary + a * imaginary**2
    of_two_parts = _ratio(squares, np.where(positive, 2.0 * determinant, 0.0))
    only_real = np.where(free[..., 0], _ratio(real**2, a), np.nan)
    only_imaginary = np.where(free[..., 1], _ratio(imaginary**2, c), np.nan)
    of_one_part = np.where(free[..., 0], only_real, only_imaginary)
    values = np.where(free.all(axis=-1), of_two_parts, of_one_part)
    infinite = np.isinf(covariance).any(axis=(-2, -1)) & free.any(axis=-1)
    return np.asarray(np.nanmean(np.where(infinite, 0.0, values), axis=(1, 2, 3)))


def covered_share(errors: FloatArray, covariance: FloatArray, free: np.ndarray) -> FloatArray:
    """Share of the parts of the response within their 95 % intervals (m,); its mean is 0.95."""
    inside = errors**2 <= NORMAL_95**2 * np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.asarray(inside[:, free].mean(axis=1))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """Quotient; infinite for a divisor of 0 or less, NaN for a divisor of NaN."""
    below = np.broadcast_to(below, above.shape)
    return np.divide(above, below, out=np.where(np.isnan(below), np.nan, np.inf), where=below > 0.0)
