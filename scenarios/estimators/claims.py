"""Accuracy that an estimator claims for its model: covariances and intervals, checked."""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress

import numpy as np

from scenarios.estimators.named_numbers import shaped
from scenarios.estimators.outcome import NoModelError
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.models.estimate import DataSummary
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidWarning

NEGATIVE = 1e-6
"""Eigenvalues of a covariance may be this far below zero, relative to the largest: rounding makes them so."""

MOST_PARAMETERS = 100
"""With more parameters nothing is propagated to the response and the bandwidth: it would take seconds."""


def check_covariance(name: str, matrix: FloatArray) -> None:
    """Raise NoModelError unless a matrix is symmetric without negative eigenvalues, to rounding."""
    size = float(np.abs(matrix).max(initial=0.0))
    if np.abs(matrix - matrix.T).max(initial=0.0) > NEGATIVE * size:
        raise NoModelError("malformed", f"{name} is not symmetric, expected a covariance")
    # Scaled to ones on the diagonal: parameters differ by orders of magnitude, and so does their rounding.
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale[scale == 0.0] = 1.0
    least = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]) if matrix.size else 0.0
    if (np.diag(matrix) < 0.0).any() or least < -NEGATIVE * len(matrix):
        raise NoModelError("malformed", f"{name} has a negative eigenvalue, expected a covariance")


def claimed_response_covariance(values: FloatArray, data: IOData, task: Task) -> FloatArray:
    """A claimed covariance of the response, checked (nf, ny, nu, 2, 2); (nf, 2, 2) does for one channel each."""
    nf = len(task.frequencies)
    expected = (nf, data.ny, data.nu, 2, 2)
    if (data.ny, data.nu) == (1, 1) and values.shape == (nf, 2, 2):
        values = values.reshape(expected)
    if values.shape != expected:
        raise NoModelError("malformed", f"response_covariance of shape {values.shape} given, expected {expected}")
    size = np.abs(values).max(axis=(-2, -1), initial=0.0)
    skewed = np.abs(values - values.swapaxes(-1, -2)).max(axis=(-2, -1), initial=0.0) > NEGATIVE * size
    negative = np.linalg.eigvalsh(0.5 * (values + values.swapaxes(-1, -2)))[..., 0] < -NEGATIVE * size
    if (skewed | negative).any():
        f, i, j = np.argwhere(skewed | negative)[0]
        fault = "is not symmetric" if skewed[f, i, j] else "has a negative eigenvalue"
        raise NoModelError(
            "malformed",
            f"response_covariance {fault} at {task.frequencies[f]:g} Hz from input {j + 1} to output {i + 1}, "
            "expected a covariance",
        )
    return values


def claimed_interval(values: FloatArray, data: IOData) -> tuple[FloatArray, FloatArray]:
    """A claimed interval of the bandwidth, checked: lower and upper ends (ny, nu), Hz, NaN where there is none."""
    low, high = shaped("bandwidth_ci95", values, (2, data.ny, data.nu))
    if (np.isnan(low) != np.isnan(high)).any() or (low > high).any() or (low < 0.0).any():
        raise NoModelError("malformed", "bandwidth_ci95 holds an interval whose ends are not 0 <= lower <= upper, Hz")
    return low, high


def known_parameters(
    covariance: FloatArray, polynomials: Polynomials | None, model: StateSpace, data: IOData, task: Task
) -> Estimate:
    """The claimed covariance of the parameters as an estimate, which can propagate it.

    Args:
        covariance: Of the parameters in the sequence A, B, C, D, F (p, p).
        polynomials: With the parameters.
        model: The same in state space.
        data: The record.
        task: With the orders, where they were given.

    Returns:
        An estimate without residuals.

    Raises:
        NoModelError: There are no parameters, or not as many, or it is no covariance.
    """
    if polynomials is None:
        raise NoModelError(
            "malformed",
            "covariance of parameters given without polynomials, expected those, or response_covariance and "
            "bandwidth_ci95 instead",
        )
    layouts = list(_layouts(polynomials, task.orders))
    count = int(np.sqrt(covariance.size))
    orders = next((layout for layout in layouts if layout.count == count), None)
    if orders is None or covariance.size != count**2:
        counts = " or ".join(dict.fromkeys(str(layout.count) for layout in layouts))
        raise NoModelError(
            "malformed",
            f"covariance of shape {covariance.shape} given, expected one of {counts} parameters: A without its 1, B "
            "without its leading zeros, C, D, F without their 1, with or without the zeros that fill up a row",
        )
    matrix = shaped("covariance", covariance, (count, count))
    check_covariance("covariance", matrix)
    summary = DataSummary.of((data,))
    variance = 1.0 if model.innovation_covariance is None else float(model.innovation_covariance[0, 0])
    return Estimate(
        model=model,
        polynomials=polynomials,
        parameters=parameters(polynomials, orders),
        parameter_names=orders.names,
        covariance=matrix,
        noise_variance=np.array([[variance]]),
        residuals=np.zeros((0, 1)),
        method="claimed",
        orders={},
        diagnostics={},
        data=summary,
        realise=Realise(orders, summary, variance),
    )


def response_and_interval(
    estimate: Estimate, task: Task
) -> tuple[FloatArray | None, tuple[FloatArray, FloatArray] | None]:
    """Covariance of the response (nf, ny, nu, 2, 2) and ends of the bandwidth's interval; None where not known."""
    if not np.isfinite(estimate.covariance).all() or not 0 < len(estimate.parameters) <= MOST_PARAMETERS:
        return None, None
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", SysidWarning)
        response, bandwidth = estimate.response_and_bandwidth(task.frequencies)
    return response.covariance, bandwidth.ci95


def parameters(polynomials: Polynomials, orders: Orders) -> FloatArray:
    """Parameters of polynomials in the sequence A, B, C, D, F (p,), zero where a polynomial is short.

    Args:
        polynomials: Any.
        orders: Which coefficients are parameters.

    Raises:
        ScenarioError: The polynomials are longer than the orders.
    """
    rows = [polynomials.channel(j) for j in range(polynomials.nu)]
    return orders.join(
        filled("A", polynomials.A, orders.na + 1),
        [filled("B", b, n + k) for (b, _), n, k in zip(rows, orders.nb, orders.nk, strict=True)],
        filled("C", polynomials.C, orders.nc + 1),
        filled("D", polynomials.D, orders.nd + 1),
        [filled("F", f, n + 1) for (_, f), n in zip(rows, orders.nf, strict=True)],
    )


def filled(name: str, row: FloatArray, length: int) -> FloatArray:
    """Coefficients with zeros behind, up to a length; ScenarioError where they are longer."""
    longest = int(np.flatnonzero(row)[-1]) + 1 if row.any() else 1
    if longest > length:
        raise ScenarioError(f"{name} has {longest} coefficients, expected at most {length}")
    return np.concatenate((row, np.zeros(max(0, length - len(row)))))[:length]


def _layouts(polynomials: Polynomials, task_orders: Mapping[str, int]) -> Iterator[Orders]:
    """Orders whose parameters the covariance may be of: those of the task where they fit, then those of the rows.

    Zeros behind the last coefficient of a row fill it up, or are coefficients that happen to be zero: either is right.
    """
    rows = [polynomials.channel(j) for j in range(polynomials.nu)]
    leading = tuple(int(np.flatnonzero(b)[0]) if b.any() else 0 for b, _ in rows)
    if "nb" in task_orders:
        with suppress(ScenarioError):
            orders = make_orders(polynomials.nu, **task_orders)
            parameters(polynomials, orders)
            if all(zeros >= k or not b.any() for (b, _), zeros, k in zip(rows, leading, orders.nk, strict=True)):
                yield orders
    # Rows of several inputs are always filled up.
    whole = list(zip(np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F), strict=True))
    for shown in (whole, rows) if polynomials.nu == 1 else (rows,):
        yield Orders(
            na=len(polynomials.A) - 1,
            nb=tuple(len(b) - k for (b, _), k in zip(shown, leading, strict=True)),
            nc=len(polynomials.C) - 1,
            nd=len(polynomials.D) - 1,
            nf=tuple(len(f) - 1 for _, f in shown),
            nk=leading,
        )
