"""Response of one transfer function to a sampled input, with exact derivatives by its coefficients and delay."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from sysid.models.recursion import free_response, state_trajectory
from sysid.models.sampling import lagged_input, sample
from sysid.records.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """B(s)/A(s) exp(-s delay), coefficients of rising powers of s.

    Attributes:
        b: Numerator (m + 1,).
        a: Denominator (n + 1,), n >= m.
        delay: In s.
    """

    b: FloatArray
    a: FloatArray
    delay: float

    def realisation(self) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """A, B (n, 1), C (1, n) and D in a controllable form, scaled for accuracy (stiff poles)."""
        scale, A, B = companion(self.a)
        c, direct = _strictly_proper(self.b / self.a[-1], self.a / self.a[-1])
        return A, B, (c * scale)[None], direct


def companion(a: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Scale (n,), A and B (n, 1) of states z with scale z = [1, s, ..., s^(n-1)]/A u, A made monic; A is balanced."""
    n = len(a) - 1
    A, scale = np.eye(n, k=1), np.ones(n)
    if n:
        A[-1] = -a[:-1] / a[-1]
        A, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    return scale, A, np.eye(n, 1, 1 - n) / scale[:, None]


def _strictly_proper(b: FloatArray, a: FloatArray) -> tuple[FloatArray, float]:
    """Divide B/A, A monic, into a numerator of lower degree than A (n,) and the direct term."""
    n = len(a) - 1
    padded = np.concatenate((b, np.zeros(n + 1 - len(b))))
    return padded[:n] - padded[n] * a[:n], float(padded[n])


def derivatives_of(signal: FloatArray, a: FloatArray, dt: float, intersample: str, delay: float = 0.0) -> FloatArray:
    """s^i/A of a signal (N,), i = 0 ... n, from rest (N, n + 1); A of rising powers, monic."""
    scale, A, B = companion(a)
    sampled = sample(A, B, dt, delay, intersample)
    states = state_trajectory(sampled.phi, *sampled.drive(signal[:, None])) * scale
    delayed = sum(weight * lagged_input(signal, lag) for lag, weight in sampled.weights.items())
    # s^n/A is no state: A/A = 1 gives it from the lower powers
    return np.column_stack((states, delayed - states @ a[:-1]))


def transients(a: FloatArray, dt: float, rows: int) -> FloatArray:
    """Free responses of 1/A until they have died out (rows, n)."""
    _, A, _ = companion(a)
    n = len(A)
    if not n:
        return np.zeros((rows, 0))
    return free_response(scipy.linalg.expm(A * dt), np.eye(1, n), rows)[:, 0]


def transient_slopes(a: FloatArray, state: FloatArray, dt: float, rows: int) -> FloatArray:
    """Derivatives of `transients` @ state by A (at most `rows`, n + 1), up to free responses: -s^i/A of it, at rest."""
    scale, A, B = companion(a)
    n = len(A)
    # the free response of 1/A drives a second 1/A, which begins at rest
    cascade = np.block([[A, np.zeros((n, n))], [B @ np.eye(1, n), A]])
    outputs = np.vstack((np.eye(1, 2 * n), np.eye(n, 2 * n, n)))
    responses = free_response(scipy.linalg.expm(cascade * dt), outputs, rows)[:, :, :n] @ state
    return _by_denominator(responses[:, 0], responses[:, 1:] * scale, a)


def _by_denominator(y: FloatArray, filtered: FloatArray, a: FloatArray) -> FloatArray:
    """Derivatives (N, n + 1) of y = x/A by A: -s^i/A y, `filtered` (N, n) with A made monic up to i = n - 1."""
    highest = y - filtered @ (a[:-1] / a[-1])
    return -np.column_stack((filtered, highest)) / a[-1]


@dataclass(frozen=True, eq=False)
class PathResponse:
    """Response of a transfer function from rest, with its derivatives.

    Attributes:
        y: Output (N,).
        by_b: Derivatives by the numerator (N, m + 1).
        by_a: Derivatives by the denominator (N, n + 1).
        by_delay: Derivative by the delay (N,), from its left where the input jumps at a sample.
    """

    y: FloatArray
    by_b: FloatArray
    by_a: FloatArray
    by_delay: FloatArray


def respond(path: TransferFunction, u: FloatArray, dt: float, intersample: str) -> PathResponse:
    """Exact response to one input (N,), zero before the record.

    The cascade of B/A and 1/A has all derivatives as combinations of its states: those of y by the coefficients are
    s^i/A u and -s^i/A y, that by the delay is -s B/A u.
    """
    leading = path.a[-1]
    a, b = path.a / leading, path.b / leading
    n = len(a) - 1
    scale, A, B = companion(a)
    c, direct = _strictly_proper(b, a)
    state_matrix = np.block([[A, np.zeros((n, n))], [B * (c * scale), A]])
    input_matrix = np.vstack((B, direct * B))
    sampled = sample(state_matrix, input_matrix, dt, path.delay, intersample)
    if not np.isfinite(sampled.phi).all():
        # coefficients so far apart that the matrix exponential overflows
        unknown = np.full(len(u), np.nan)
        return PathResponse(unknown, np.outer(unknown, b), np.outer(unknown, path.a), unknown)
    drive, x0 = sampled.drive(u[:, None])
    # one 1/A after the other: the cascade is block triangular, and each recursion half as large
    phi, coupling = sampled.phi[:n, :n], sampled.phi[n:, :n]
    first = state_trajectory(phi, drive[:, :n], x0[:n])
    second = state_trajectory(phi, drive[:, n:] + first @ coupling.T, x0[n:])
    powers = first * scale
    delayed = sum(weight * lagged_input(u, lag) for lag, weight in sampled.weights.items())
    # s^i/A u, i = 0 ... n, the last one from A/A = 1
    powers = np.column_stack((powers, delayed - powers @ a[:n]))
    by_b = powers[:, : len(b)]
    y = by_b @ b
    input_slope = sum((weight * lagged_input(u, lag) for lag, weight in sampled.slopes.items()), np.zeros(len(u)))
    by_delay = -(powers[:, 1:] @ c + direct * input_slope)
    return PathResponse(y, by_b / leading, _by_denominator(y, second * scale, path.a), by_delay)


def respond_held(path: TransferFunction, u: FloatArray, dt: float, intersample: str) -> PathResponse:
    """Response to an input that had its first value before the record too, up to a free response.

    The constant part acts through the delay from the beginning on; only what moves in the record arrives late.
    """
    if not u[0]:
        return respond(path, u, dt, intersample)
    moving = respond(path, u - u[0], dt, intersample)
    constant = respond(replace(path, delay=0.0), np.full_like(u, u[0]), dt, intersample)
    return PathResponse(
        moving.y + constant.y, moving.by_b + constant.by_b, moving.by_a + constant.by_a, moving.by_delay
    )
