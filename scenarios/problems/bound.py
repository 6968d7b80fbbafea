"""The Cramér-Rao bound of polynomial models: what the best unbiased estimate from one record is known to."""

import numpy as np
import scipy.linalg

from scenarios.files.errors import ScenarioError
from scenarios.problems.problem import Bound
from scenarios.problems.regressors import Signals, regressors, response_derivatives
from sysid import Polynomials
from sysid.models.delta_method import standard_directions
from sysid.polynomial.orders import Orders
from sysid.records.arrays import ComplexArray, FloatArray

LOG_STEP = 1e-4
"""Relative step of the slope at the half-power frequency."""

SINGULAR = 1e-10
"""Ratio of the root information's singular values, columns scaled, below which parameters are not all determined."""


def polynomial_bound(
    at: Polynomials,
    parameters: FloatArray,
    orders: Orders,
    *,
    driven: Signals,
    pulse: Signals,
    burn_in: int,
    variance: float,
    dt: float,
    frequencies: FloatArray,
    bandwidth_hz: FloatArray,
) -> Bound:
    """Bound for Gaussian white innovations [Ljung1999, sec. 7.4 and 9.4].

    The regressors are linear in what drives the system: a part that is known, and one that is noise. Their information
    is the sum over the record of the first, and the number of samples times the expectation of the second, which is the
    sum over the responses to a unit pulse of innovation. Feedback is no exception. The variance of the innovation is a
    parameter too, but to first order it tells nothing of the others [Ljung1999, sec. 9.3]. So do the unknown values
    before the record: they take as many samples' worth of information at most as there are states.

    Args:
        at: The truth in the structure.
        parameters: Its parameters (p,).
        orders: Of the structure.
        driven: Signals without noise, the burn-in in front.
        pulse: Signals of a unit pulse of innovation alone, until they have died out.
        burn_in: Samples of `driven` that are no part of the record.
        variance: Of the innovation.
        dt: Sampling interval, s.
        frequencies: (nf,), Hz.
        bandwidth_hz: True bandwidths (1, nu).

    Returns:
        The bound.

    Raises:
        ScenarioError: The record does not determine the parameters.
    """
    known = regressors(at, orders, driven)[burn_in:] / np.sqrt(variance)
    noise = regressors(at, orders, pulse) * np.sqrt(len(known))
    directions = _directions(np.vstack((known, noise)))
    response, derivatives = response_derivatives(at, orders, dt, frequencies)
    moves = np.tensordot(directions.T, derivatives, 1)
    return Bound(
        polynomials=at,
        parameters=parameters,
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


def perfect_parameters(bound: Bound, rng: np.random.Generator) -> FloatArray:
    """Parameters of one perfect estimate (p,)."""
    directions = standard_directions(bound.covariance)
    return bound.parameters + directions @ rng.standard_normal(directions.shape[1])


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
