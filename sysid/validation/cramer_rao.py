"""Cramér-Rao bound of polynomial models: the accuracy of the best unbiased estimate from one record."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.polynomial.polynomial import polyadd

from sysid.models.polynomials import Polynomials, innovations_form
from sysid.polynomial.orders import Orders
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.records.errors import SysidError
from sysid.records.singular_values import singular_values

LOG_STEP = 1e-4  # relative step of the slope at the half-power frequency
SINGULAR = 1e-10  # ratio of singular values of the scaled root information: below, some parameters are undetermined
DIED_OUT = 1e-14  # of the response to a pulse: beyond, only rounding is left of the sum of its squares
LONGEST_PULSE = 60_000  # samples: poles that decay more slowly than this belong to no record of an experiment


@dataclass(frozen=True, eq=False, repr=False)
class CramerRaoBound(Locked):
    """Covariance of the best unbiased estimate from one record.

    Attributes:
        polynomials: The truth in the structure; None for state-space models with several outputs.
        parameters: Its parameters in the sequence A, B, C, D, F, or local coordinates where there are none (p,).
        covariance: Of them (p, p).
        frequencies: (nf,), Hz.
        response: From input to output (nf, ny, nu).
        response_directions: Change of real and imaginary part of the response by independent steps of one standard
            deviation each (p, nf, ny, nu, 2); products summed over the first axis are covariances.
        bandwidth_hz: Half-power bandwidth (ny, nu), Hz.
        bandwidth_deviation: Standard deviation of its logarithm (ny, nu).
    """

    polynomials: Polynomials | None
    parameters: FloatArray
    covariance: FloatArray
    frequencies: FloatArray
    response: ComplexArray
    response_directions: FloatArray
    bandwidth_hz: FloatArray
    bandwidth_deviation: FloatArray

    @property
    def response_covariance(self) -> FloatArray:
        """Covariance of real and imaginary part of the response (nf, ny, nu, 2, 2)."""
        changes = self.response_directions
        return np.asarray(np.einsum("k...i,k...j->...ij", changes, changes))

    def response_errors(self, count: int, rng: np.random.Generator) -> ComplexArray:
        """Draw errors of the response of efficient estimates.

        Args:
            count: Number of estimates.
            rng: Source of the draws.

        Returns:
            (count, nf, ny, nu).
        """
        p = len(self.response_directions)
        flat = rng.standard_normal((count, p)) @ self.response_directions.reshape(p, -1)
        errors = flat.reshape(count, *self.response_directions.shape[1:])
        return np.asarray(errors[..., 0] + 1j * errors[..., 1])


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


def signals_from_rest(
    polynomials: Polynomials, reference: FloatArray, innovation: FloatArray, feedback: float = 0.0
) -> Signals:
    """Simulate a system in open loop, or with one input under proportional feedback u = r - feedback y.

    The reference (N, nu) is the input of an open loop, or r; the innovation is (N,).
    """
    p = polynomials
    noise = scipy.signal.lfilter(p.C, np.convolve(p.A, p.D), innovation)
    if not feedback:
        responses = []
        for j in range(p.nu):
            b, f = p.channel(j)
            responses.append(scipy.signal.lfilter(b, np.convolve(p.A, f), reference[:, j]))
        return Signals(reference, np.sum(responses, axis=0) + noise, innovation)
    b, f = p.channel(0)
    # A F y = B u + A F noise with u = r - feedback y, solved for y
    by_reference = scipy.signal.lfilter(b, [1.0], reference[:, 0])
    by_noise = scipy.signal.lfilter(np.convolve(p.A, f), [1.0], noise)
    y = scipy.signal.lfilter([1.0], _closed_loop(p, feedback), by_reference + by_noise)
    u = reference[:, 0] - feedback * y
    return Signals(u[:, None], y, innovation)


def prediction_gradient(polynomials: Polynomials, orders: Orders, signals: Signals) -> FloatArray:
    """Derivatives of the prediction by the parameters, from rest [Ljung1999, sec. 10.3].

    The prediction error is D/C (A y - sum B_j/F_j u_j); at the truth it is the innovation. The derivatives are (N, p),
    parameters in the sequence A, B, C, D, F.
    """
    c, d = polynomials.C, polynomials.D
    channels = [polynomials.channel(j) for j in range(polynomials.nu)]
    inputs = []
    for j, (_, f) in enumerate(channels):
        inputs.append(scipy.signal.lfilter(d, np.convolve(c, f), signals.u[:, j]))
    # by a_k: -D/C y(t - k); by b_k: D/(C F) u(t - k)
    rows = _delayed(-scipy.signal.lfilter(d, c, signals.y), range(1, orders.na + 1))
    for x, n, delay in zip(inputs, orders.nb, orders.nk, strict=True):
        rows += _delayed(x, range(delay, delay + n))
    # by c_k: 1/C e(t - k); by d_k: -1/D e(t - k), since A y - B/F u = C/D e
    rows += _delayed(scipy.signal.lfilter([1.0], c, signals.e), range(1, orders.nc + 1))
    rows += _delayed(-scipy.signal.lfilter([1.0], d, signals.e), range(1, orders.nd + 1))
    # by f_k: -B D/(C F F) u(t - k)
    for x, (b, f), n in zip(inputs, channels, orders.nf, strict=True):
        rows += _delayed(-scipy.signal.lfilter(b, f, x), range(1, n + 1))
    return np.array(rows).reshape(orders.count, len(signals.y)).T


def response_gradient(
    polynomials: Polynomials, orders: Orders, dt: float, f_hz: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Response (nf, 1, nu) at frequencies in Hz, and its derivatives by the parameters (p, nf, 1, nu)."""
    z = np.exp(-2j * np.pi * dt * np.asarray(f_hz))
    a = np.polyval(polynomials.A[::-1], z)
    response = np.zeros((len(z), 1, polynomials.nu), dtype=complex)
    derivatives = np.zeros((orders.count, len(z), 1, polynomials.nu), dtype=complex)
    first_b, first_f = orders.na, orders.count - sum(orders.nf)
    for j in range(polynomials.nu):
        b, f = (np.polyval(row[::-1], z) for row in polynomials.channel(j))
        # G = B/(A F): each coefficient of A or F changes it by -G z^-k over that polynomial
        response[:, 0, j] = b / (a * f)
        for k in range(orders.na):
            derivatives[k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / a
        for k in range(orders.nb[j]):
            derivatives[first_b + k, :, 0, j] = z ** (orders.nk[j] + k) / (a * f)
        for k in range(orders.nf[j]):
            derivatives[first_f + k, :, 0, j] = -response[:, 0, j] * z ** (k + 1) / f
        first_b, first_f = first_b + orders.nb[j], first_f + orders.nf[j]
    return response, derivatives


def cramer_rao_bound(
    polynomials: Polynomials,
    orders: Orders,
    reference: FloatArray,
    *,
    dt: float,
    variance: float,
    frequencies: FloatArray,
    system: Polynomials | None = None,
    feedback: float = 0.0,
    burn_in: int = 0,
) -> CramerRaoBound:
    """Cramér-Rao bound for Gaussian white innovations [Ljung1999, sec. 7.4 and 9.4].

    The derivatives of the prediction are linear in the signals that drive the system: the reference, which is known,
    and the innovation. Their information is the sum over the record of the first, and the number of samples times the
    expectation of the second, which is the sum over the responses to a unit pulse of innovation. Feedback is no
    exception. The variance of the innovation is a parameter too, but to first order it tells nothing of the others
    [Ljung1999, sec. 9.3]. So do the unknown values before the record: they take as many samples' worth of information
    at most as there are states.

    Args:
        polynomials: The truth, one output, in the structure that is estimated.
        orders: Coefficients that are estimated.
        reference: Inputs, or the reference of the loop (burn_in + N, nu).
        dt: Sampling interval, s.
        variance: Of the innovation.
        frequencies: Where the accuracy of the response is wanted (nf,), Hz.
        system: The truth as it makes the record, where it has another structure; `polynomials` by default.
        feedback: Gain of a proportional controller, u = r - feedback y; 0 for an open loop.
        burn_in: Samples before the record, so that it does not begin at rest.

    Returns:
        The bound.

    Raises:
        SysidError: The record does not determine the parameters, or the predictor or the loop is not stable.
    """
    system = polynomials if system is None else system
    truth = innovations_form(system, dt, variance)
    filters = [polynomials.A, polynomials.C, polynomials.D]
    filters += [polynomials.channel(j)[1] for j in range(polynomials.nu)]
    if feedback:
        filters.append(_closed_loop(system, feedback))
    slowest = max(float(np.abs(np.roots(row)).max(initial=0.0)) for row in filters)
    if slowest >= 1.0:
        raise SysidError(
            "expected A, C, D, F and the loop with all roots inside the unit circle, "
            f"got a root of modulus {slowest:.6g}: the predictor or the loop is not stable"
        )
    pulse = np.eye(1, pulse_length(slowest, DIED_OUT))[0]
    driven = signals_from_rest(system, reference, np.zeros(len(reference)), feedback)
    noise = signals_from_rest(system, np.zeros((len(pulse), system.nu)), pulse, feedback)
    by_reference = prediction_gradient(polynomials, orders, driven)[burn_in:] / np.sqrt(variance)
    # the variance cancels: the pulse response is that of a unit innovation, and the information is over the variance
    by_noise = prediction_gradient(polynomials, orders, noise) * np.sqrt(len(by_reference))
    directions = _directions(np.vstack((by_reference, by_noise)))
    response, derivatives = response_gradient(polynomials, orders, dt, frequencies)
    changes = np.tensordot(directions.T, derivatives, 1)
    bandwidth_hz = truth.bandwidth()
    deviation = np.full(bandwidth_hz.shape, np.nan)
    for _, j in np.argwhere(np.isfinite(bandwidth_hz)):
        deviation[0, j] = _bandwidth_deviation(polynomials, orders, dt, float(bandwidth_hz[0, j]), directions, j)
    return CramerRaoBound(
        polynomials=polynomials,
        parameters=orders.parameters(polynomials),
        covariance=directions @ directions.T,
        frequencies=frequencies,
        response=response,
        response_directions=np.stack((changes.real, changes.imag), axis=-1),
        bandwidth_hz=bandwidth_hz,
        bandwidth_deviation=deviation,
    )


def _bandwidth_deviation(
    polynomials: Polynomials, orders: Orders, dt: float, f: float, directions: FloatArray, j: int
) -> float:
    """Standard deviation of the logarithm of the half-power frequency f, Hz, of input j.

    To first order the crossing moves by the change of the level relative to that at 0 Hz, over the slope there.
    """
    ends = np.array([0.0, f, f * (1.0 - LOG_STEP), f * (1.0 + LOG_STEP)])
    levels, derivatives = response_gradient(polynomials, orders, dt, ends)
    # of the logarithms of the levels at 0 Hz and at f
    by_parameter = (derivatives[:, :2, 0, j] / levels[:2, 0, j]).real
    slope = np.diff(np.log(np.abs(levels[2:, 0, j])))[0] / (2.0 * LOG_STEP)
    return float(np.linalg.norm(directions.T @ (by_parameter[:, 1] - by_parameter[:, 0])) / abs(slope))


def pulse_length(slowest: float, remainder: float) -> int:
    """Samples until the response to a pulse has fallen to a remainder, for the modulus of the slowest pole."""
    # room for numerators, whose part of the response ends by itself
    margin = 100
    if slowest < 1e-3:
        return margin
    modulus = min(slowest, 1.0 - 1e-9)
    return min(margin + int(np.log(remainder) / np.log(modulus)), LONGEST_PULSE)


def _closed_loop(polynomials: Polynomials, feedback: float) -> FloatArray:
    """Characteristic polynomial of the loop with the plant B/(A F)."""
    b, f = polynomials.channel(0)
    return np.asarray(polyadd(np.convolve(polynomials.A, f), feedback * b))


def _delayed(x: FloatArray, lags: range) -> list[FloatArray]:
    """x(t - lag) for each lag, zero before the record."""
    return [np.concatenate((np.zeros(lag), x[: len(x) - lag])) for lag in lags]


def _directions(root: FloatArray) -> FloatArray:
    """Inverse L of a root R of the information R' R: the covariance is L L' (p, p).

    By the orthogonal factor of the gradients themselves: products of them would square the condition.
    """
    scale = np.linalg.norm(root, axis=0)
    if not (scale > 0.0).all():
        raise SysidError(f"the record does not depend on parameter {int(np.argmin(scale)) + 1} of {len(scale)}")
    # parameters differ by decades: columns of unit length show what is collinear
    triangle = np.linalg.qr(root / scale, mode="r")
    values = singular_values(triangle)
    if values[-1] < SINGULAR * values[0]:
        raise SysidError(f"the record does not determine the {len(scale)} parameters: singular values {values}")
    return np.asarray(scipy.linalg.solve_triangular(triangle, np.eye(len(scale)))) / scale[:, None]
