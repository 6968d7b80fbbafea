"""Accuracy that an estimator claims for its model: covariances and intervals, checked."""

from collections.abc import Iterator, Mapping
from contextlib import suppress

import numpy as np

from scenarios.estimators.named_numbers import shaped
from scenarios.estimators.outcome import NoModelError
from scenarios.estimators.task import Task
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import known_estimate
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

NEGATIVE = 1e-6
"""Eigenvalues of a covariance may be this far below zero, relative to the largest: rounding makes them so."""


def check_covariance(name: str, matrix: FloatArray) -> None:
    """Raise NoModelError unless a matrix (p, p) is symmetric without negative eigenvalues, to rounding.

    It is scaled to ones on the diagonal: parameters differ by orders of magnitude, and so does their rounding.
    """
    for _, fault in _faults(matrix[None], np.sqrt(np.abs(np.diag(matrix)))[None]):
        raise NoModelError(f"{name} {fault}, expected a covariance")


def claimed_response_covariance(values: FloatArray, data: IOData, task: Task) -> FloatArray:
    """A claimed covariance of the response, checked (nf, ny, nu, 2, 2); (nf, 2, 2) does for one channel each."""
    expected = (len(task.frequencies), data.ny, data.nu, 2, 2)
    if (data.ny, data.nu) == (1, 1) and values.shape == (len(task.frequencies), 2, 2):
        values = values.reshape(expected)
    if values.shape != expected:
        raise NoModelError(f"response_covariance of shape {values.shape} given, expected {expected}")
    matrices = values.reshape(-1, 2, 2)
    # Not by its diagonal: at low frequencies the imaginary part is all but known, and its variance but rounding.
    size = np.sqrt(np.abs(matrices).max(axis=(1, 2), initial=0.0))
    for index, fault in _faults(matrices, np.stack((size, size), axis=1)):
        f, i, j = np.unravel_index(index, expected[:3])
        where = f"at {task.frequencies[f]:g} Hz from input {j + 1} to output {i + 1}"
        raise NoModelError(f"response_covariance {fault} {where}, expected a covariance")
    return values


def claimed_interval(values: FloatArray, data: IOData) -> tuple[FloatArray, FloatArray]:
    """A claimed interval of the bandwidth, checked: lower and upper ends (ny, nu), Hz, NaN where there is none."""
    low, high = shaped("bandwidth_ci95", values, (2, data.ny, data.nu))
    if (np.isnan(low) != np.isnan(high)).any() or (low > high).any() or (low < 0.0).any():
        raise NoModelError("bandwidth_ci95 holds an interval whose ends are not 0 <= lower <= upper, Hz")
    return low, high


def known_parameters(
    covariance: FloatArray, polynomials: Polynomials | None, model: StateSpace, data: IOData, task: Task
) -> Estimate:
    """The claimed covariance (p, p) of the parameters as an estimate without residuals, which can propagate it.

    Raises:
        NoModelError: There are no parameters, or not as many, or it is no covariance.
    """
    if polynomials is None:
        raise NoModelError(
            "covariance of parameters given without polynomials, expected those, or response_covariance and "
            "bandwidth_ci95 instead"
        )
    # The size of the covariance tells which of the layouts it is of.
    layouts = list(_layouts(polynomials, task.orders))
    count = int(np.sqrt(covariance.size))
    orders = next((layout for layout in layouts if layout.count == count), None)
    if orders is None or covariance.size != count**2:
        counts = " or ".join(dict.fromkeys(str(layout.count) for layout in layouts))
        raise NoModelError(
            f"covariance of shape {covariance.shape} given, expected one of {counts} parameters: A without its 1, B "
            "without its leading zeros, C, D, F without their 1, with or without the zeros that fill up a row"
        )
    matrix = shaped("covariance", covariance, (count, count))
    check_covariance("covariance", matrix)
    variance = 1.0 if model.innovation_covariance is None else float(model.innovation_covariance[0, 0])
    return known_estimate(model, polynomials, orders, matrix, variance=variance, data=data)


def _faults(matrices: FloatArray, scales: FloatArray) -> Iterator[tuple[int, str]]:
    """Indices and faults of matrices (m, n, n) that are no covariances, scaled by rows and columns (m, n) first."""
    transposed = matrices.swapaxes(1, 2)
    size = np.abs(matrices).max(axis=(1, 2), initial=0.0)
    # Relative to each matrix: variances of responses differ by orders of magnitude over frequency.
    skewed = np.abs(matrices - transposed).max(axis=(1, 2), initial=0.0) > NEGATIVE * size
    # A parameter that is known exactly has a row of zeros.
    scales = np.where(scales == 0.0, 1.0, scales)
    scaled = 0.5 * (matrices + transposed) / (scales[:, :, None] * scales[:, None, :])
    negative = np.linalg.eigvalsh(scaled)[:, 0] < -NEGATIVE * scales.shape[1]
    for index in np.flatnonzero(skewed | negative):
        fault = "is not symmetric" if skewed[index] else "has a negative eigenvalue"
        yield int(index), fault


def _layouts(polynomials: Polynomials, task_orders: Mapping[str, int]) -> Iterator[Orders]:
    """Orders whose parameters the covariance may be of: those of the task where they fit, then those of the rows.

    Zeros behind the last coefficient of a row fill it up, or are coefficients that happen to be zero: either is right.
    """
    if "nb" in task_orders:
        with suppress(SysidError):
            orders = make_orders(polynomials.nu, **task_orders)
            orders.parameters(polynomials)
            rows = np.atleast_2d(polynomials.B)
            has_delay = all(not row[:delay].any() for row, delay in zip(rows, orders.nk, strict=True))
            if has_delay:
                yield orders
    # Rows of several inputs are always filled up.
    if polynomials.nu == 1:
        yield Orders.of(polynomials, padded=True)
    yield Orders.of(polynomials)
