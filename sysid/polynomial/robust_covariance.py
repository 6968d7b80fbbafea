"""Covariance of estimates with coloured prediction errors or a wrong model structure: the "sandwich".

The error of the estimate is H^-1 sum_t psi(t) e(t), with H the curvature of the criterion and terms psi(t) e(t) that
are correlated in time [Ljung1999, ch. 9]. The covariance of their sum is that of a vector autoregression of them
[DenHaanLevin1997], which needs no choice of a window.
"""

from collections.abc import Sequence

import numpy as np

from sysid.models.delta_method import standard_directions
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import triangular_factor
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import admissible, linearise, scores
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

MOST_LAGS = 10  # largest order of the autoregression
SINGULAR = 0.01  # least curvature in standard directions, over that of a true model: less is no minimum
ROWS_PER_COEFFICIENT = 10  # least number of samples per coefficient of the autoregression
STEP = 0.01  # in standard deviations, for differences of the gradient


def sandwich(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    covariance: FloatArray,
    variance: float,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> FloatArray:
    """Covariance H^-1 S H^-1 of a prediction-error estimate (p, p), from its covariance for white errors."""
    if variance <= 0.0:
        return covariance
    directions = _free_directions(covariance)
    curvature = _curvature(experiments, orders, theta, directions, initial_conditions)
    # variance times identity for a true model, and the fallback at a stability bound
    if curvature is None or np.linalg.eigvalsh(curvature)[0] < SINGULAR * variance:
        curvature = variance * np.eye(directions.shape[1])
    series = [terms @ directions for terms in scores(experiments, orders, theta, initial_conditions)]
    half = directions @ np.linalg.inv(curvature)
    return half @ long_run_covariance(series) @ half.T


def curvature_covariance(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    covariance: FloatArray,
    variance: float,
    initial_conditions: InitialConditions,
) -> FloatArray:
    """Inverse of the observed information: the curvature of the likelihood at its maximum (p, p).

    `covariance` is an approximation whose directions serve as coordinates; it is returned if the curvature is not
    that of a minimum, as at a stability bound.
    """
    directions = _free_directions(covariance)
    # the gradient at theta itself is zero
    curvature = _curvature(experiments, orders, theta, directions, initial_conditions, sides=(1.0,))
    if curvature is None or np.linalg.eigvalsh(curvature)[0] < SINGULAR * variance:
        return covariance
    return variance * directions @ np.linalg.inv(curvature) @ directions.T


def _free_directions(covariance: FloatArray) -> FloatArray:
    """`standard_directions` (p, q) of the parameters that are not fixed, whose variance is zero."""
    free = np.diag(covariance) > 0.0
    if free.all() or not free.any():
        return standard_directions(covariance)
    directions = np.zeros((len(covariance), int(free.sum())))
    directions[free] = standard_directions(covariance[np.ix_(free, free)])
    return directions


def long_run_covariance(series: Sequence[FloatArray]) -> FloatArray:
    """Covariance (p, p) of the sum over time of a signal with zero mean, given per experiment (N_i, p).

    A vector autoregression, its order by Akaike's criterion, extrapolates the correlations.
    """
    samples, p = sum(len(x) for x in series), series[0].shape[1]
    shortest = min(len(x) for x in series)
    highest_order = min(MOST_LAGS, samples // (ROWS_PER_COEFFICIENT * p), shortest // 2)
    columns = np.vstack([_lags_then_present(x, highest_order) for x in series])
    rows = len(columns)
    if not columns.any():
        # no errors: the sum is zero
        return np.zeros((p, p))
    # one triangle contains the regressions of all orders
    triangle = triangular_factor(columns / np.sqrt(np.mean(columns**2)))
    triangle *= np.sqrt(np.mean(columns**2))
    present = triangle[:, highest_order * p :]
    least_aic, best = np.inf, np.eye(p)
    for order in range(highest_order + 1):
        coefficients = order * p
        residual_gram = present[coefficients:].T @ present[coefficients:]
        aic = np.linalg.slogdet(residual_gram / rows)[1] + 2.0 * coefficients * p / rows
        if aic < least_aic:
            lags = triangle[:coefficients, :coefficients]
            solution = np.linalg.lstsq(lags, present[:coefficients], rcond=None)[0]
            # rows of the solution are ordered by lag: x(t) = sum_k X_k' x(t - k) + w(t)
            gain_at_dc = np.linalg.inv(np.eye(p) - solution.reshape(order, p, p).sum(axis=0).T)
            least_aic, best = aic, gain_at_dc @ residual_gram @ gain_at_dc.T / (rows - coefficients)
    return samples * best


def _lags_then_present(x: FloatArray, order: int) -> FloatArray:
    """Rows [x(t - 1)', ..., x(t - order)', x(t)'] of a signal (N, p)."""
    return np.hstack([x[order - k : len(x) - k] for k in (*range(1, order + 1), 0)])


def _curvature(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    directions: FloatArray,
    initial_conditions: InitialConditions,
    sides: Sequence[float] = (1.0, -1.0),
) -> FloatArray | None:
    """Half the second derivative of the criterion along directions (p, p); None if a step is not stable.

    By differences of exact gradients, central ones or, where the gradient at theta is zero, one-sided ones.
    """
    gradients = []
    for step in STEP * directions.T:
        ends = [theta + side * step for side in sides]
        if not all(admissible(orders, end) for end in ends):
            return None
        slopes = [linearise(experiments, orders, end, initial_conditions).gradient for end in ends]
        gradients.append(directions.T @ (np.array(sides) @ slopes) / (len(sides) * STEP))
    curvature = np.array(gradients)
    return 0.5 * (curvature + curvature.T)
