"""Prediction errors of an experiment with missing outputs, and their exact Jacobian.

Missing outputs and initial conditions are eliminated together: the result is the Jacobian of the record with the
missing outputs at their conditional means, projected onto the complement of both [GolubPereyra2003].
"""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from sysid.polynomial.error_jacobian import ErrorJacobian, error_jacobian, free_transients
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.missing_outputs import MissingOutputs
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

FIRST_LENGTH = 64  # samples after which most responses have died out
NEGLIGIBLE = 1e-12  # tail of a response, relative to its largest value
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

    inputs = sum(lfilter(bj, fj, experiment.u[:, j]) for j, (bj, fj) in enumerate(zip(b, f, strict=True)))
    errors = lfilter(d, c, lfilter(a, [1.0], y) - inputs)[start:]
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
        (0, orders.na, lfilter(d, c, pulse)),
        (orders.na + sum(orders.nb), orders.nc, -lfilter([1.0], c, gaps.response[:, 0, 0])),
        (orders.na + sum(orders.nb) + orders.nc, orders.nd, lfilter(a, c, pulse)),
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
    length = min(max(FIRST_LENGTH, 4 * (len(numerator) + len(denominator))), most)
    while True:
        pulse = np.zeros(length)
        pulse[0] = 1.0
        response = lfilter(numerator, denominator, pulse)
        alive = np.flatnonzero(np.abs(response) > NEGLIGIBLE * np.abs(response).max())
        if length == most or alive[-1] < 3 * length // 4:
            return np.asarray(response[: alive[-1] + 1])
        length = min(4 * length, most)


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
