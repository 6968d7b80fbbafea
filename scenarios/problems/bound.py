"""The Cramér-Rao bound of polynomial models: the accuracy of the best unbiased estimate from one record."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.signal import lfilter

from scenarios.estimators.claims import parameters
from scenarios.files.errors import ScenarioError
from scenarios.problems.problem import Bound
from sysid import Polynomials, StateSpace
from sysid.polynomial.orders import Orders
from sysid.records.arrays import ComplexArray, FloatArray

BURN_IN = 500
"""Samples before each record, so that it does not start at rest."""

LOG_STEP = 1e-4
"""Relative step of the slope at the half-power frequency."""

SINGULAR = 1e-10
"""Ratio of the root information's singular values, columns scaled, below which parameters are not all determined."""


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of a system from rest.

    Attributes:
        u: Inputs (N, nu).
        y: Output (N,).
        e: Innovation (N,).
    """

    u: FloatArray
    y: FloatArray
    e: FloatArray


def regressors(at: Polynomials, orders: Orders, signals: Signals) -> FloatArray:
    """Derivatives of the prediction by the parameters, from rest [Ljung1999, sec. 10.3].

    The prediction error is D/C (A y - sum B_j/F_j u_j); at the truth it is the innovation.

    Args:
        at: The true polynomials.
        orders: Which coefficients are parameters.
        signals: Of the true system.

    Returns:
        (N, p), parameters in the sequence A, B, C, D, F.
    """
    c, d = at.C, at.D
    channels = [at.channel(j) for j in range(at.nu)]
    inputs = [lfilter(d, np.convolve(c, f), signals.u[:, j]) for j, (_, f) in enumerate(channels)]
    rows = _delayed(-lfilter(d, c, signals.y), range(1, orders.na + 1))
    for x, n, delay in zip(inputs, orders.nb, orders.nk, strict=True):
        rows += _delayed(x, range(delay, delay + n))
    rows += _delayed(lfilter([1.0], c, signals.e), range(1, orders.nc + 1))
    rows += _delayed(-lfilter([1.0], d, signals.e), range(1, orders.nd + 1))
    for x, (b, f), n in zip(inputs, channels, orders.nf, strict=True):
        rows += _delayed(-lfilter(b, f, x), range(1, n + 1))
    return np.array(rows).reshape(orders.count, len(signals.y)).T


def response_derivatives(at: Polynomials, orders: Orders, dt: float, f_hz: FloatArray) -> tuple[ComplexArray, ...]:
    """The response and its derivatives.

    Args:
        at: Polynomials.
        orders: Which coefficients are parameters.
        dt: Sampling interval, s.
        f_hz: Frequencies (nf,), Hz.

    Returns:
        Response (nf, 1, nu) and derivatives (p, nf, 1, nu).
    """
    z = np.exp(-2j * np.pi * dt * np.asarray(f_hz))
    a = np.polyval(at.A[::-1], z)
    response = np.zeros((len(z), 1, at.nu), dtype=complex)
    derivatives = np.zeros((orders.count, len(z), 1, at.nu), dtype=complex)
    first_b, first_f = orders.na, orders.count - sum(orders.nf)
    for j in range(at.nu):
        b, f = (np.polyval(row[::-1], z) for row in at.channel(j))
        response[:, 0, j] = b / (a * f)
        for k in range(orders.na):
            derivatives[k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / a
        for k in range(orders.nb[j]):
            derivatives[first_b + k, :, 0, j] = z ** (orders.nk[j] + k) / (a * f)
        for k in range(orders.nf[j]):
            derivatives[first_f + k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / f
        first_b, first_f = first_b + orders.nb[j], first_f + orders.nf[j]
    return response, derivatives


def _delayed(x: FloatArray, lags: range) -> list[FloatArray]:
    return [np.concatenate((np.zeros(lag), x[: len(x) - lag])) for lag in lags]


def polynomial_bound(
    at: Polynomials,
    orders: Orders,
    truth: StateSpace,
    variance: float,
    frequencies: FloatArray,
    signals: tuple[Signals, Signals],
) -> Bound:
    """Bound for Gaussian white innovations [Ljung1999, sec. 7.4 and 9.4].

    The regressors are linear in what drives the system: a part that is known, and one that is noise. Their information
    is the sum over the record of the first, and the number of samples times the expectation of the second, which is the
    sum over the responses to a unit pulse of innovation. Feedback is no exception. The variance of the innovation is a
    parameter too, but to first order it tells nothing of the others [Ljung1999, sec. 9.3]. So do the unknown values
    before the record: they take as many samples' worth of information at most as there are states.

    Args:
        at: The truth in the structure.
        orders: Of the structure.
        truth: The truth in state space.
        variance: Of the innovation.
        frequencies: (nf,), Hz.
        signals: The known part with `BURN_IN` samples in front, and the response to a unit pulse of innovation alone
            until it has died out.

    Raises:
        ScenarioError: The record does not determine the parameters.
    """
    driven, pulse = signals
    dt, bandwidth_hz = truth.dt, truth.bandwidth()
    known = regressors(at, orders, driven)[BURN_IN:] / np.sqrt(variance)
    noise = regressors(at, orders, pulse) * np.sqrt(len(known))
    directions = _directions(np.vstack((known, noise)))
    response, derivatives = response_derivatives(at, orders, dt, frequencies)
    moves = np.tensordot(directions.T, derivatives, 1)
    return Bound(
        polynomials=at,
        parameters=parameters(at, orders),
        covariance=directions @ directions.T,
        frequencies=frequencies,
        response=response,
        response_directions=np.stack((moves.real, moves.imag), axis=-1),
        bandwidth_hz=bandwidth_hz,
        bandwidth_deviation=_bandwidth_deviation(at, orders, dt, bandwidth_hz, directions),
    )


def perfect_errors(bound: Bound, count: int, rng: np.random.Generator) -> ComplexArray:
    """Errors of the response of perfect estimates.

    Args:
        bound: The bound.
        count: Number of estimates.
        rng: Source of the draws.

    Returns:
        (count, nf, ny, nu).
    """
    p = len(bound.response_directions)
    parts = rng.standard_normal((count, p)) @ bound.response_directions.reshape(p, -1)
    parts = parts.reshape(count, *bound.response_directions.shape[1:])
    return np.asarray(parts[..., 0] + 1j * parts[..., 1])


def response_covariance(bound: Bound) -> FloatArray:
    """Of real and imaginary part of the response (nf, ny, nu, 2, 2)."""
    moves = bound.response_directions
    return np.asarray(np.einsum("k...i,k...j->...ij", moves, moves))


def _directions(root: FloatArray) -> FloatArray:
    """Inverse L of a root R of the information R' R: the covariance is L L' (p, p).

    By the orthogonal factor of the regressors themselves: products of them would square the condition.
    """
    scale = np.linalg.norm(root, axis=0)
    if not (scale > 0.0).all():
        raise ScenarioError(f"the record does not depend on parameter {int(np.argmin(scale)) + 1} of {len(scale)}")
    triangle = np.linalg.qr(root / scale, mode="r")
    values = np.linalg.svd(triangle, compute_uv=False)
    if values[-1] < SINGULAR * values[0]:
        raise ScenarioError(f"the record does not determine the {len(scale)} parameters: singular values {values}")
    return np.asarray(scipy.linalg.solve_triangular(triangle, np.eye(len(scale)))) / scale[:, None]


def _bandwidth_deviation(
    at: Polynomials, orders: Orders, dt: float, bandwidth_hz: FloatArray, directions: FloatArray
) -> FloatArray:
    """Of the logarithm, to first order: the crossing moves by the change of the level over its slope (1, nu)."""
    out = np.full(bandwidth_hz.shape, np.nan)
    for _, j in np.argwhere(np.isfinite(bandwidth_hz)):
        f = float(bandwidth_hz[0, j])
        ends = np.array([0.0, f, f * (1.0 - LOG_STEP), f * (1.0 + LOG_STEP)])
        response, derivatives = response_derivatives(at, orders, dt, ends)
        relative = (derivatives[:, :2, 0, j] / response[:2, 0, j]).real
        slope = np.diff(np.log(np.abs(response[2:, 0, j])))[0] / (2.0 * LOG_STEP)
        out[0, j] = np.linalg.norm(directions.T @ (relative[:, 1] - relative[:, 0])) / abs(slope)
    return out
