"""From a minimum of the prediction-error criterion to the public record."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.completed_records import completed
from sysid.polynomial.excitation import check_excitation
from sysid.polynomial.initial_conditions import Past
from sysid.polynomial.initial_estimates import check_room_to_start
from sysid.polynomial.operating_point import check_means
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import check_enough_data, check_single_output, make_estimate
from sysid.polynomial.prediction_error import Linearisation, coloured_information
from sysid.polynomial.robust_covariance import curvature_covariance, sandwich
from sysid.polynomial.search import Start, search
from sysid.records.arguments import truth_value, whole_number
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning

ILL_CONDITIONED = 1e10
COLOUR = 30  # coefficients of the autoregressive model of a coloured disturbance


def prediction_error_estimate(
    method: str,
    experiments: Sequence[IOData],
    orders: Orders,
    asked: Mapping[str, Any],
    starts: Callable[[Sequence[IOData], Orders], Iterable[Start]],
    *,
    max_iterations: int,
    coloured: bool = False,
    past: Past | str = Past.ESTIMATED,
) -> Estimate:
    """Check the data, search, and turn the minimum into an estimate.

    The covariance is variance * (J' J)^-1 with J the exact Jacobian of the errors, initial conditions projected out
    [Ljung1999, ch. 9]; the variance is unbiased: parameters and initial conditions are counted. Where
    outputs are missing, the gaps tell of the parameters too, and the curvature of the likelihood takes J' J's place.

    Args:
        method: Name of the estimator.
        experiments: Single-output experiments.
        orders: The structure.
        asked: Orders as the user knows them.
        starts: Makes the beginnings, the most promising first.
        max_iterations: Steps of the polishing.
        coloured: Whether the covariance allows for errors that are not white; without a model of the noise they are
            taken to be independent of the input, which makes for sharper intervals.
        past: What is assumed about the time before each record.

    Raises:
        SysidError: Several outputs, too little data, backcasting over gaps, iterations or past that are none.

    Warns:
        SysidWarning: Poor excitation, means that do not fit the dynamics, no convergence, bad conditioning, roots of
            C, D or F at the unit circle.
    """
    past = Past.of(past)
    max_iterations = whole_number("max_iterations", max_iterations, 1)
    coloured = truth_value("coloured", coloured)
    check_single_output(experiments)
    gaps = not all(e.complete for e in experiments)
    if gaps and past is Past.BACKCAST:
        raise SysidError(
            "past=Past.BACKCAST needs complete outputs; Past.ESTIMATED and Past.ZERO do not, and data.complete_parts() "
            "cuts a record into experiments without gaps"
        )
    transients = max(orders.nc, orders.nd) + sum(orders.nf)
    texts = check_excitation(experiments, [n + max(orders.na, f) for n, f in zip(orders.nb, orders.nf, strict=True)])
    texts += check_means(experiments, max(orders.na, *orders.nf))
    check_enough_data(experiments, orders, transients)
    check_room_to_start(experiments, orders)
    beginnings = starts(completed(experiments, orders) if gaps else experiments, orders)
    found = search(experiments, orders, beginnings, max_iterations=max_iterations, past=past)
    at = found.best.at
    variance = at.sum_of_squares / (at.errors - orders.count - at.transients)
    covariance, condition = covariance_of(at, at.inflation * variance)
    if gaps and orders.na + orders.nc + orders.nd and at.cost > 0.0:
        covariance = curvature_covariance(experiments, orders, at.theta, covariance, at.inflation * variance, past)
    if coloured and at.cost > 0.0:
        if orders.na == orders.nc == orders.nd == 0:
            half = covariance / variance
            information = coloured_information(experiments, orders, at.theta, min(COLOUR, at.errors // 20), past)
            covariance = half @ information @ half
        else:
            covariance = sandwich(experiments, orders, at.theta, covariance, variance, past)
    if not found.best.converged:
        texts.append(f"{method} did not converge: {found.best.reason}")
    if condition > ILL_CONDITIONED and at.cost > 0.0:
        texts.append(f"the parameters are poorly determined: condition number {condition:.2g} of the scaled Jacobian")
    texts += _near_unit_circle(orders, at.theta)
    for text in texts:
        warnings.warn(text, SysidWarning, stacklevel=3)
    return make_estimate(
        method,
        experiments,
        orders,
        asked,
        theta=at.theta,
        covariance=covariance,
        variance=variance,
        diagnostics={
            "condition": condition,
            "iterations": found.best.iterations,
            "evaluations": found.best.evaluations,
            "converged": found.best.converged,
            "reason": found.best.reason,
            "starts": found.costs,
            "start": found.chosen,
            "sum_of_squares": at.sum_of_squares,
            "rows": at.errors,
            "initial_conditions": at.transients,
        },
        texts=texts,
    )


def covariance_of(at: Linearisation, variance: float) -> tuple[FloatArray, float]:
    """Covariance of the parameters (p, p), and the condition number of the scaled Jacobian."""
    _, values, right = np.linalg.svd(at.triangle)
    if not len(values):
        return np.zeros((0, 0)), 1.0
    kept = values > 1e-14 * values[0]
    half = right[kept].T / values[kept] / at.scale[:, None]
    condition = float(values[0] / values[-1]) if values[-1] > 0.0 else np.inf
    return variance * (half @ half.T), condition


def _near_unit_circle(orders: Orders, theta: FloatArray) -> list[str]:
    _, _, c, d, f = orders.split(theta)
    texts = []
    for name, polynomial in [("C", c), ("D", d), *(("F", fj) for fj in f)]:
        radius = float(np.abs(np.roots(polynomial)).max(initial=0.0))
        if radius > 1.0 - 1e-4:
            texts.append(f"{name} has a root of modulus {radius:.7f}, at the edge of stability: intervals may not hold")
    return texts
