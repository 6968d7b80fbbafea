"""What an estimator claims to know of its model: covariances and intervals, checked."""

import warnings
from collections.abc import Mapping

import numpy as np

from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.shapes import shaped
from scenarios.estimators.task import Task
from sysid import Estimate, IOData, Polynomials, StateSpace
from sysid.models.estimate import DataSummary
from sysid.polynomial.orders import Orders, make_orders
from sysid.polynomial.polynomial_estimate import Realise
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidWarning

NEGATIVE = 1e-6
"""So far below zero, relative to the largest, rounding may take an eigenvalue of a covariance."""

MOST_PARAMETERS = 100
"""With more parameters nothing is propagated to the response and the bandwidth: it would take seconds."""


def check_covariance(name: str, matrix: FloatArray) -> None:
    """Check that a matrix is a covariance.

    Raises:
        NoModelError: It is not symmetric, or has a negative eigenvalue.
    """
    size = float(np.abs(matrix).max(initial=0.0))
    if np.abs(matrix - matrix.T).max(initial=0.0) > NEGATIVE * size:
        raise NoModelError("malformed", f"{name} is not symmetric, expected a covariance")
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale[scale == 0.0] = 1.0
    least = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]) if matrix.size else 0.0
    if (np.diag(matrix) < 0.0).any() or least < -NEGATIVE * len(matrix):
        raise NoModelError("malformed", f"{name} has a negative eigenvalue, expected a covariance")


def covariance_of_response(values: FloatArray, data: IOData, task: Task) -> FloatArray:
    """The claimed covariance of the response (nf, ny, nu, 2, 2).

    Args:
        values: In that shape, or (nf, 2, 2) where there is one input and one output.
        data: The record.
        task: With the frequencies.

    Raises:
        NoModelError: It has another shape or is none.
    """
    nf = len(task.frequencies)
    wanted = (nf, data.ny, data.nu, 2, 2)
    if (data.ny, data.nu) == (1, 1) and values.shape == (nf, 2, 2):
        values = values.reshape(wanted)
    if values.shape != wanted:
        raise NoModelError("malformed", f"response_covariance of shape {values.shape} given, expected {wanted}")
    size = np.abs(values).max(axis=(-2, -1), initial=0.0)
    crooked = np.abs(values - values.swapaxes(-1, -2)).max(axis=(-2, -1), initial=0.0) > NEGATIVE * size
    negative = np.linalg.eigvalsh(0.5 * (values + values.swapaxes(-1, -2)))[..., 0] < -NEGATIVE * size
    if (crooked | negative).any():
        f, i, j = np.argwhere(crooked | negative)[0]
        what = "is not symmetric" if crooked[f, i, j] else "has a negative eigenvalue"
        raise NoModelError(
            "malformed",
            f"response_covariance {what} at {task.frequencies[f]:g} Hz from input {j + 1} to output {i + 1}, "
            "expected a covariance",
        )
    return values


def interval_of(values: FloatArray, data: IOData) -> tuple[FloatArray, FloatArray]:
    """The claimed interval of the bandwidth: its ends (ny, nu), NaN where there is no bandwidth.

    Args:
        values: (2, ny, nu), or two numbers where there is one input and one output.
        data: The record.

    Raises:
        NoModelError: It has another shape, or an end lies beyond the other.
    """
    wanted = (2, data.ny, data.nu)
    low, high = shaped("bandwidth_ci95", values, wanted)
    if (np.isnan(low) != np.isnan(high)).any() or (low > high).any() or (low < 0.0).any():
        raise NoModelError("malformed", "bandwidth_ci95 holds an interval whose ends are not 0 <= lower <= upper, Hz")
    return low, high


def known_parameters(
    covariance: FloatArray, polynomials: Polynomials | None, model: StateSpace, data: IOData, task: Task
) -> Estimate:
    """An estimate of which response and bandwidth are known as the covariance of its parameters says.

    Args:
        covariance: Of the parameters in the sequence A, B, C, D, F (p, p).
        polynomials: With the parameters.
        model: The same in state space.
        data: The record.
        task: With the orders, where they were asked.

    Raises:
        NoModelError: There are no parameters, or not as many, or it is no covariance.
    """
    if polynomials is None:
        raise NoModelError(
            "malformed",
            "covariance of parameters given without polynomials, expected those, or response_covariance and "
            "bandwidth_ci95 instead",
        )
    layouts = _layouts(polynomials, task.orders)
    given = int(np.sqrt(covariance.size))
    fitting = [orders for orders in layouts if orders.count == given]
    if not fitting or covariance.size != given**2:
        counts = " or ".join(dict.fromkeys(str(orders.count) for orders in layouts))
        raise NoModelError(
            "malformed",
            f"covariance of shape {covariance.shape} given, expected one of {counts} parameters: A without its 1, B "
            "without its leading zeros, C, D, F without their 1, with or without the zeros that fill up a row",
        )
    orders = fitting[0]
    matrix = shaped("covariance", covariance, (given, given))
    check_covariance("covariance", matrix)
    summary = DataSummary.of((data,))
    variance = 1.0 if model.innovation_covariance is None else float(model.innovation_covariance[0, 0])
    rows = [polynomials.channel(j) for j in range(polynomials.nu)]
    theta = np.concatenate(
        [
            _padded(polynomials.A[1:], orders.na),
            *(_padded(b[k:], n) for (b, _), n, k in zip(rows, orders.nb, orders.nk, strict=True)),
            _padded(polynomials.C[1:], orders.nc),
            _padded(polynomials.D[1:], orders.nd),
            *(_padded(f[1:], n) for (_, f), n in zip(rows, orders.nf, strict=True)),
        ]
    )
    return Estimate(
        model=model,
        polynomials=polynomials,
        parameters=theta,
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


def _padded(row: FloatArray, length: int) -> FloatArray:
    return np.concatenate((row, np.zeros(max(length - len(row), 0))))[:length]


def _layouts(polynomials: Polynomials, asked: Mapping[str, int]) -> list[Orders]:
    """Orders whose parameters the covariance may be of: as asked, if the polynomials have no higher ones; as given.

    Zeros behind the last coefficient of a row fill it up, or are coefficients that happen to be zero: either is right.
    """
    wanted = _asked(polynomials, asked)
    # rows of several inputs are always filled up
    ways = (True, False) if polynomials.nu == 1 else (False,)
    return [*([] if wanted is None else [wanted]), *(_shown(polynomials, filled=filled) for filled in ways)]


def _shown(polynomials: Polynomials, *, filled: bool) -> Orders:
    """Orders of the polynomials as they are; zeros behind the last coefficients of B and F count where `filled`."""
    rows = [polynomials.channel(j) for j in range(polynomials.nu)]
    if filled:
        rows = list(zip(np.atleast_2d(polynomials.B), np.atleast_2d(polynomials.F), strict=True))
    leading = [_leading(b) for b, _ in rows]
    return Orders(
        na=len(polynomials.A) - 1,
        nb=tuple(len(b) - k for (b, _), k in zip(rows, leading, strict=True)),
        nc=len(polynomials.C) - 1,
        nd=len(polynomials.D) - 1,
        nf=tuple(len(f) - 1 for _, f in rows),
        nk=tuple(leading),
    )


def _asked(polynomials: Polynomials, asked: Mapping[str, int]) -> Orders | None:
    """Orders as asked; None where none are, or where the polynomials have higher ones."""
    if "nb" not in asked:
        return None
    shown = _shown(polynomials, filled=False)
    wanted = make_orders(
        polynomials.nu,
        nb=asked["nb"],
        nk=asked["nk"],
        na=asked.get("na", 0),
        nc=asked.get("nc", 0),
        nd=asked.get("nd", 0),
        nf=asked.get("nf", 0),
    )
    rows = [polynomials.channel(j)[0] for j in range(polynomials.nu)]
    fits = (
        shown.na <= wanted.na
        and shown.nc <= wanted.nc
        and shown.nd <= wanted.nd
        and all(f <= n for f, n in zip(shown.nf, wanted.nf, strict=True))
        and all(len(b) <= n + k for b, n, k in zip(rows, wanted.nb, wanted.nk, strict=True))
        and all(_leading(b) >= k or not b.any() for b, k in zip(rows, wanted.nk, strict=True))
    )
    return wanted if fits else None


def _leading(b: FloatArray) -> int:
    """Zeros before the first coefficient."""
    return int(np.flatnonzero(b)[0]) if b.any() else 0
