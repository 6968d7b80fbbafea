"""Prediction errors of one experiment and their exact Jacobian, for each assumption on the initial conditions.

Missing outputs and initial conditions are eliminated together: the result is the Jacobian of the record with the
missing outputs at their conditional means, projected onto the complement of both [GolubPereyra2003].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from sysid.models.polynomials import is_stable
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import Orders
from sysid.polynomial.orthonormal_basis import gramian
from sysid.polynomial.regressors import input_lags, lagged, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LEAST_VARIANCE = 1e-8  # of an initial disturbance state, relative to the innovation: keeps the covariance regular
ROUNDING = 1e-12  # the same relative to the sum of variances, for a disturbance that hardly decays
FIRST_LENGTH = 256  # samples after which most transients have died out
NEGLIGIBLE = 1e-17  # tail of a transient, relative to its largest value, that rounding hides
STEP = 1e-5  # of the coefficients, for difference quotients of the small matrices of backcasting


@dataclass(frozen=True, eq=False)
class ErrorJacobian:
    """Errors with their derivatives.

    Attributes:
        columns: [d eps / d theta, eps], the initial conditions projected out; with backcasting the initial disturbance
            states come first, in units of the deviation of the innovation (rows, p + 1).
        errors: Number of prediction errors among the rows.
        transients: Number of free initial conditions.
        log_determinant: Contribution of missing outputs to -2 times the logarithm of the likelihood.
        slope: Derivatives of `log_determinant` (p,); None without missing outputs.
    """

    columns: FloatArray
    errors: int
    transients: int
    log_determinant: float = 0.0
    slope: FloatArray | None = None


def error_jacobian(
    experiment: IOData, orders: Orders, theta: FloatArray, initial_conditions: InitialConditions
) -> ErrorJacobian:
    """Prediction errors and Jacobian of one single-output experiment at stable parameters theta (p,)."""
    y, u = experiment.y[:, 0], experiment.u
    if initial_conditions is InitialConditions.ZERO:
        columns = _free_initial_conditions(y, u, orders, theta, 0, np.zeros((0, 0))).columns[experiment.window :]
        return ErrorJacobian(columns, len(columns), 0)
    if initial_conditions is InitialConditions.BACKCAST and max(orders.nc, orders.nd):
        return _backcast(y, u, orders, theta, orders.first_row(experiment.window))
    start = orders.first_error(experiment.window)
    return _free_initial_conditions(y, u, orders, theta, start, free_transients(orders, theta, len(y) - start))


def _free_initial_conditions(
    y: FloatArray, u: FloatArray, orders: Orders, theta: FloatArray, start: int, transients: FloatArray
) -> ErrorJacobian:
    """Errors and Jacobian from `start` on, with the transients of free initial conditions projected out.

    Filters run over the whole record from rest. The error of that assumption is, from `start` on, a free response of
    1/C or of D/(C F), hence in the span of the transient columns.
    """
    a, b, c, d, f = orders.split(theta)
    n = len(y)
    responses = [scipy.signal.lfilter(bj, fj, u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True))]
    noise_count = max(orders.nc, orders.nd)
    # A filter without coefficients would cost as much as any other.
    v = (np.convolve(a, y)[:n] if orders.na else y) - sum(responses)
    eps = scipy.signal.lfilter(d, c, v)[start:] if noise_count else v[start:].copy()

    basis, tau = orthonormal(transients, eps) if transients.shape[1] else (None, np.zeros(0))
    if basis is not None:
        length = len(basis)
        eps[:length] -= basis @ (basis.T @ eps[:length])

    # the initial conditions of the filters below do not matter: they are transients too
    columns = np.empty((n - start, orders.count + 1), order="F")
    k = 0
    if orders.na:
        columns[:, : orders.na] = _shifts(scipy.signal.lfilter(d, c, y), orders.na, first=1)[start:]
        k = orders.na
    for j, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
        filtered = scipy.signal.lfilter(d, np.convolve(c, f[j]), u[:, j])
        columns[:, k : k + nb] = -_shifts(filtered, nb, first=nk)[start:]
        k += nb
    # w and v with the fitted initial conditions of eps
    used = noise_count
    corrected = v[start:]
    outputs = []
    for j in range(len(f)):
        w = responses[j][start:]
        if orders.nf[j] and basis is not None:
            initial = np.zeros(n - start)
            initial[: orders.nf[j]] = tau[used : used + orders.nf[j]]
            transient = scipy.signal.lfilter([1.0], f[j], initial)
            w, corrected = w + transient, corrected - transient
            used += orders.nf[j]
        outputs.append(w)
    if orders.nc:
        columns[:, k : k + orders.nc] = -_shifts(scipy.signal.lfilter([1.0], c, eps), orders.nc, first=1)
        k += orders.nc
    if orders.nd:
        columns[:, k : k + orders.nd] = _shifts(scipy.signal.lfilter([1.0], c, corrected), orders.nd, first=1)
        k += orders.nd
    for j, nf in enumerate(orders.nf):
        if nf:
            columns[:, k : k + nf] = _shifts(scipy.signal.lfilter(d, np.convolve(c, f[j]), outputs[j]), nf, first=1)
            k += nf
    if basis is not None:
        columns[:length, :k] -= basis @ (basis.T @ columns[:length, :k])
    columns[:, k] = eps
    return ErrorJacobian(columns, len(columns), 0 if basis is None else basis.shape[1])


def _backcast(y: FloatArray, u: FloatArray, orders: Orders, theta: FloatArray, start: int) -> ErrorJacobian:
    """Errors and Jacobian from `start` on; the initial disturbance state x costs x' P^-1 x, P its covariance.

    The disturbance filters run from rest at `start`. The state enters as pulses at the first samples, through 1/C.
    """
    a, b, c, d, f = orders.split(theta)
    rows, m = len(y) - start, max(orders.nc, orders.nd)
    pulse = np.zeros(rows)
    pulse[0] = 1.0
    responses = [scipy.signal.lfilter(bj, fj, u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True))]
    v = (scipy.signal.lfilter(a, [1.0], y) - sum(responses))[start:]
    root = _inverse_root(c, d, m)
    paths = [_shifts(scipy.signal.lfilter(d, np.convolve(c, f[j]), pulse), nf) for j, nf in enumerate(orders.nf)]
    noise = np.vstack((root, _shifts(scipy.signal.lfilter([1.0], c, pulse), m)))
    free = np.vstack((np.zeros((m, sum(orders.nf))), np.hstack((np.zeros((rows, 0)), *paths))))
    errors = np.concatenate((np.zeros(m), scipy.signal.lfilter(d, c, v)))
    basis, state = orthonormal(np.hstack((noise, free)), errors)
    errors[: len(basis)] -= basis @ (basis.T @ errors[: len(basis)])

    columns = np.zeros((m + rows, orders.count + 1), order="F")
    k = orders.na
    if k:
        columns[m:, :k] = scipy.signal.lfilter(d, c, lagged(y, output_lags(k), start), axis=0)
    for j, (nb, nk) in enumerate(zip(orders.nb, orders.nk, strict=True)):
        inputs = lagged(scipy.signal.lfilter([1.0], f[j], u[:, j]), input_lags(nb, nk), start)
        columns[m:, k : k + nb] = -scipy.signal.lfilter(d, c, inputs, axis=0)
        k += nb
    used, outputs = m, []
    for j, nf in enumerate(orders.nf):
        initial = np.zeros(len(y))
        initial[start : start + nf] = state[used : used + nf]
        transient = scipy.signal.lfilter([1.0], f[j], initial)
        outputs.append(responses[j] + transient)
        v = v - transient[start:]
        used += nf
    for i, (polynomial, sign) in enumerate(((c, -1.0), (d, 1.0))):
        driven = scipy.signal.lfilter([1.0], c, errors[m:] if i == 0 else v)
        n = len(polynomial) - 1
        columns[m:, k : k + n] = sign * _shifts(driven, n, first=1)
        for lag in range(1, n + 1):
            # derivative of the covariance at a fixed state
            ends = [polynomial + s * STEP * np.eye(1, n + 1, lag)[0] for s in (1.0, -1.0)]
            # at the stability limit one side has no stationary covariance; the difference is then one-sided, or zero
            sides = [j for j, end in enumerate(ends) if i == 0 or is_stable(end)]
            up, down = (
                (_inverse_root(ends[j], d, m) if i == 0 else _inverse_root(c, ends[j], m)) if j in sides else root
                for j in (0, 1)
            )
            columns[:m, k + lag - 1] = -(up - down) @ state[:m] / (max(len(sides), 1) * STEP)
        k += n
    for j, nf in enumerate(orders.nf):
        if nf:
            filtered = _shifts(scipy.signal.lfilter([1.0], f[j], outputs[j]), nf, first=1)[start:]
            columns[m:, k : k + nf] = scipy.signal.lfilter(d, c, filtered, axis=0)
            k += nf
    columns[: len(basis), :k] -= basis @ (basis.T @ columns[: len(basis), :k])
    columns[:, k] = errors
    return ErrorJacobian(columns, rows, basis.shape[1] - m)


def _inverse_root(c: FloatArray, d: FloatArray, m: int) -> FloatArray:
    """Inverse of L (m, m), L L' the stationary covariance of the observer-form state of C/D for unit innovations."""
    A = np.eye(m, k=1)
    A[: len(d) - 1, 0] = -d[1:]
    K = np.zeros((m, 1))
    K[: len(c) - 1, 0] += c[1:]
    K[: len(d) - 1, 0] -= d[1:]
    covariance = gramian(A, K @ K.T)
    least = max(LEAST_VARIANCE, ROUNDING * float(np.trace(covariance)))
    root = np.linalg.cholesky(0.5 * (covariance + covariance.T) + least * np.eye(m))
    return np.asarray(scipy.linalg.solve_triangular(root, np.eye(m), lower=True))


def free_transients(orders: Orders, theta: FloatArray, rows: int) -> FloatArray:
    """Responses of the errors to free initial conditions, one column each, until they have died out."""
    _, _, c, d, f = orders.split(theta)
    noise_count = max(orders.nc, orders.nd)
    blocks = [(np.ones(1), c, noise_count)] if noise_count else []
    blocks += [(d, np.convolve(c, fj), nf) for fj, nf in zip(f, orders.nf, strict=True) if nf]
    if not blocks:
        return np.zeros((0, 0))
    filters = [(numerator, denominator) for numerator, denominator, _ in blocks]
    responses = _pulse_responses(filters, min(FIRST_LENGTH, rows), rows, NEGLIGIBLE)
    return np.hstack([_shifts(h, count) for h, (_, _, count) in zip(responses, blocks, strict=True)])


def _shifts(signal: FloatArray, count: int, first: int = 0) -> FloatArray:
    """Columns of `signal` delayed by first, first + 1, ..., from rest."""
    out = np.zeros((len(signal), count), order="F")
    for i in range(count):
        delay = first + i
        out[delay:, i] = signal[: len(signal) - delay]
    return out


def _pulse_responses(
    filters: Sequence[tuple[FloatArray, FloatArray]], length: int, most: int, negligible: float
) -> list[FloatArray]:
    """Pulse responses of filters (numerator, denominator), until the last quarter of each is negligible."""
    while True:
        pulse = np.zeros(length)
        pulse[0] = 1.0
        responses = [scipy.signal.lfilter(*one, pulse) for one in filters]
        tail = max(np.abs(h[-(length // 4) :]).max() / np.abs(h).max() for h in responses)
        if length == most or tail < negligible:
            return responses
        length = min(4 * length, most)


def orthonormal(transients: FloatArray, eps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis of the transients until they have died out, and the coefficients of eps in them.

    Dependent transients (inputs with equal F) are dropped.
    """
    alive = np.flatnonzero(np.abs(transients).max(axis=1) > NEGLIGIBLE * np.abs(transients).max())
    length = int(alive[-1]) + 1
    left, values, right = np.linalg.svd(transients[:length], full_matrices=False)
    kept = values > 1e-12 * values[0]
    basis = left[:, kept]
    return basis, right[kept].T @ ((basis.T @ eps[:length]) / values[kept])


FIRST_RESPONSE = 64  # samples after which most responses have died out
NEGLIGIBLE_RESPONSE = 1e-12  # tail of a response, relative to its largest value
DEPENDENT = 1e-9  # remainder of a transient, relative to it, after the missing outputs are eliminated


def gapped_error_jacobian(
    experiment: IOData, orders: Orders, theta: FloatArray, initial_conditions: InitialConditions
) -> ErrorJacobian:
    """Errors and Jacobian of one single-output experiment, one row per sample; not for backcasting."""
    a, b, c, d, f = orders.split(theta)
    known = experiment.known[:, 0]
    y = np.where(known, experiment.y[:, 0], 0.0)
    start = experiment.window if initial_conditions is InitialConditions.ZERO else orders.first_error(experiment.window)
    rows = len(y) - start
    response = _died_out(np.convolve(d, a), c, len(y))
    gaps = MissingOutputs.of(known[start:, None], response[:, None, None])

    inputs = sum(scipy.signal.lfilter(bj, fj, experiment.u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True)))
    errors = scipy.signal.lfilter(d, c, scipy.signal.lfilter(a, [1.0], y) - inputs)[start:]
    # outputs that are missing before the first error are free initial conditions
    reach = len(response) if initial_conditions is InitialConditions.ZERO else orders.na
    early = [t for t in range(max(start - reach, 0), start) if not known[t]]
    initial_columns = (
        np.zeros((0, 0)) if initial_conditions is InitialConditions.ZERO else free_transients(orders, theta, rows)
    )
    free = np.zeros((rows, len(early) + initial_columns.shape[1]))
    for i, t in enumerate(early):
        tail = response[start - t :][:rows]
        free[: len(tail), i] = tail
    free[: len(initial_columns), len(early) :] = initial_columns
    remainder = gaps.eliminated(np.column_stack((free, errors))[:, None])[:, 0]
    basis, coefficients = _span(remainder[:, :-1], free, remainder[:, -1])
    y[early] = -coefficients[: len(early)]
    y[start:][~known[start:]] = -gaps.best((errors - free @ coefficients)[:, None, None])[:, 0]

    whole = error_jacobian(replace(experiment, y=y, missing=False), orders, theta, initial_conditions).columns
    columns = gaps.eliminated(whole[:, None])[:, 0]
    columns -= basis @ (basis.T @ columns)
    return ErrorJacobian(columns, rows - gaps.count, basis.shape[1], gaps.log_determinant, _slope(gaps, orders, theta))


def _slope(gaps: MissingOutputs, orders: Orders, theta: FloatArray) -> FloatArray:
    """Derivatives of the logarithm of the determinant (p,), which does not depend on B and F."""
    a, _, c, d, _ = orders.split(theta)
    out = np.zeros(orders.count)
    if len(gaps.response) == 1:
        return out
    pulse = np.zeros(len(gaps.response))
    pulse[0] = 1.0
    by_noise = [
        (0, orders.na, scipy.signal.lfilter(d, c, pulse)),
        (orders.na + sum(orders.nb), orders.nc, -scipy.signal.lfilter([1.0], c, gaps.response[:, 0, 0])),
        (orders.na + sum(orders.nb) + orders.nc, orders.nd, scipy.signal.lfilter(a, c, pulse)),
    ]
    index, derivatives = [], []
    for first, count, derivative in by_noise:
        for lag in range(1, count + 1):
            index.append(first + lag - 1)
            derivatives.append(np.concatenate((np.zeros(lag), derivative))[: len(pulse)])
    out[index] = gaps.slope(np.array(derivatives)[:, :, None, None])
    return out


def _died_out(numerator: FloatArray, denominator: FloatArray, most: int) -> FloatArray:
    """Pulse response until it has died out, at most `most` samples."""
    if len(denominator) == 1 or not denominator[1:].any():
        return numerator[:most]
    length = min(max(FIRST_RESPONSE, 4 * (len(numerator) + len(denominator))), most)
    (response,) = _pulse_responses([(numerator, denominator)], length, most, NEGLIGIBLE_RESPONSE)
    alive = np.flatnonzero(np.abs(response) > NEGLIGIBLE_RESPONSE * np.abs(response).max())
    return response[: alive[-1] + 1]


def _span(remainder: FloatArray, free: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal basis of the remainder of the free columns, and coefficients of the errors in them."""
    if not free.shape[1]:
        return remainder, np.zeros(0)
    lengths = np.sqrt(np.einsum("ij,ij->j", free, free))
    lengths[lengths == 0.0] = 1.0
    vectors, values, right = np.linalg.svd(remainder / lengths, full_matrices=False)
    kept = values > DEPENDENT
    basis = vectors[:, kept]
    return basis, (right[kept].T @ ((basis.T @ errors) / values[kept])) / lengths
