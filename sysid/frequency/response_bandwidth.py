"""The bandwidth of a measured frequency response, with its interval."""

import numpy as np
from scipy.stats import t as student

from sysid import Bandwidth, FrequencyResponse
from sysid.records.arrays import FloatArray

DEGREE = 4
"""Degree, in squared frequency, of the polynomial that 1 / |G|^2 is fitted by."""

REACH = 2.0
"""How far beyond the crossing the fit looks, in multiples of its frequency."""

NEIGHBOURS = 4
"""Lines to either side over which the variance is averaged."""


def response_bandwidth(response: FrequencyResponse) -> Bandwidth:
    """Half-power bandwidth of each channel, relative to the gain extrapolated to 0 Hz.

    Near and below its bandwidth the squared gain of a servo is mainly that of a few poles, so 1 / |G|^2 is a polynomial
    in squared frequency. It is fitted by weighted least squares to the lines up to twice the crossing, each corrected
    for the bias that noise gives to a squared modulus; its value at 0 Hz and its crossing of twice that value give the
    bandwidth, their covariance its interval, to first order and on a logarithmic scale. The variances of neighbouring
    lines, which are alike, are averaged. On the joints of the nominal arm the polynomial is off by up to 1.3e-4 of the
    bandwidth, which the interval does not hold.

    Args:
        response: The response with its covariance, lines from well below the bandwidth to well above it.

    Returns:
        Bandwidth and 95 % interval of every channel, (ny, nu); NaN where the response has no more lines in
        reach than the polynomial has coefficients, or never falls to half power.
    """
    _, ny, nu = response.response.shape
    hz, low, high = np.full((3, ny, nu), np.nan)
    for i, j in np.ndindex(ny, nu):
        hz[i, j], low[i, j], high[i, j] = _channel(response, i, j)
    return Bandwidth(hz, (low, high))


def _channel(response: FrequencyResponse, i: int, j: int) -> tuple[float, float, float]:
    unknown = (np.nan, np.nan, np.nan)
    f, g = response.frequencies, response.response[:, i, j]
    if response.covariance is None or not np.isfinite(g).all():
        return unknown
    variance = _smooth(np.trace(response.covariance[:, i, j], axis1=1, axis2=2))
    power = np.abs(g) ** 2 - variance
    below = np.flatnonzero(power < 0.5 * np.median(power[:3]))
    if not len(below) or (power[: below[0] + 1] <= 0.0).any():
        return unknown
    seen = np.flatnonzero(f <= REACH * f[below[0]])
    seen = seen[power[seen] > 0.0]
    if len(seen) < DEGREE + 2:
        return unknown
    # 1 / |G|^2 has the standard deviation 2 sd(|G|) / |G|^3, where the variance of |G| is half that of G.
    target, deviation = 1.0 / power[seen], 2.0 * np.sqrt(0.5 * variance[seen]) / power[seen] ** 1.5
    scale = f[seen[-1]]
    basis = np.vander((f[seen] / scale) ** 2, DEGREE + 1, increasing=True) / deviation[:, None]
    inverse = np.linalg.pinv(basis)
    coefficients, covariance = inverse @ (target / deviation), inverse @ inverse.T
    crossing = np.polynomial.Polynomial(coefficients - 2.0 * coefficients[0] * np.eye(DEGREE + 1)[0])
    roots = crossing.roots()
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
    if coefficients[0] <= 0.0 or not len(real) or real.min() > 1.0:
        return unknown
    x = real.min()
    # Of p(x) = 2 p(0): dx = -(d p(x) - 2 d p(0)) / p'(x), and the frequency goes with the root of x.
    gradient = -(x ** np.arange(DEGREE + 1) - 2.0 * np.eye(DEGREE + 1)[0]) / crossing.deriv()(x)
    spread = 0.5 * np.sqrt(gradient @ covariance @ gradient) / x
    hz = float(scale * np.sqrt(x))
    freedom = response.degrees_of_freedom
    reach = spread * (student.ppf(0.975, (2 * NEIGHBOURS + 1) * freedom) if freedom else student.ppf(0.975, np.inf))
    return hz, float(hz * np.exp(-reach)), float(hz * np.exp(reach))


def _smooth(variance: FloatArray) -> FloatArray:
    """Mean over neighbouring lines, over fewer at the ends."""
    window, inner = np.ones(2 * NEIGHBOURS + 1), slice(NEIGHBOURS, NEIGHBOURS + len(variance))
    return np.asarray(np.convolve(variance, window)[inner] / np.convolve(np.ones(len(variance)), window)[inner])
