"""Minimisation of prediction errors, for all polynomial structures.

eps = D/C (A y - sum_j B_j/F_j u_j), minimised in the mean square; ARMAX, OE and BJ differ only in orders. For given C
and F the unknown initial conditions enter linearly, as a few transient columns. They are projected out (variable
projection [GolubPereyra2003]), so that they add no parameters to the search and no bias.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.polynomials import is_stable
from sysid.polynomial.correlation import autoregression
from sysid.polynomial.error_jacobian import error_jacobian, gapped_error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

STABILITY_MARGIN = 1e-7  # least distance of the roots of C, D and F from the unit circle
CONVERGED = 1e-9  # remaining decrease, relative to the sum of squares
ROUNDING = 1e-30  # sum of squares, relative to that of the output, that is rounding alone


@dataclass(frozen=True, eq=False)
class Linearisation:
    """The criterion and its first-order model at one parameter vector.

    Attributes:
        theta: Parameters (p,).
        cost: Sum of squared prediction errors, initial conditions and missing outputs optimal, times `inflation`.
        triangle: R of the projected Jacobian of the errors, columns scaled to unit length (p, p).
        target: Q' eps, so that the errors change as triangle @ (scale * step) + target (p,).
        scale: Lengths of the projected Jacobian's columns (p,).
        errors: Number of prediction errors.
        transients: Number of independent initial conditions projected out.
        inflation: Factor of the sum of squares in the cost: det(G'G)^(1/errors) with missing outputs, else 1.
    """

    theta: FloatArray
    cost: float
    triangle: FloatArray
    target: FloatArray
    scale: FloatArray
    errors: int
    transients: int
    inflation: float = 1.0

    @property
    def sum_of_squares(self) -> float:
        """Sum of squared prediction errors."""
        return self.cost / self.inflation

    @property
    def gradient(self) -> FloatArray:
        """Half the gradient of the cost (p,)."""
        return self.scale * (self.triangle.T @ self.target)


@dataclass(frozen=True, eq=False)
class Minimum:
    """Result of a minimisation.

    Attributes:
        at: Criterion and derivatives at the final parameters.
        iterations: Accepted steps.
        evaluations: Evaluations of the criterion.
        converged: Whether the remaining decrease is negligible, or the errors are at rounding level.
        reason: Reason for stopping.
    """

    at: Linearisation
    iterations: int
    evaluations: int
    converged: bool
    reason: str


def minimise(
    experiments: Sequence[IOData],
    orders: Orders,
    start: FloatArray | Linearisation,
    *,
    max_iterations: int = 100,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
    good_enough: float = 0.0,
) -> Minimum:
    """Levenberg-Marquardt with exact gradients; C, D and every F stay stable at every accepted step [More1978]."""
    energy = sum(float(np.nansum(e.y[:, 0] ** 2)) if e.missing else float(e.y[:, 0] @ e.y[:, 0]) for e in experiments)
    at = start if isinstance(start, Linearisation) else linearise(experiments, orders, start, initial_conditions)
    damping, iterations, evaluations = 1e-4, 0, 1
    while True:
        if at.cost <= ROUNDING * energy:
            return Minimum(at, iterations, evaluations, True, "errors at rounding level")
        left, values, right = np.linalg.svd(at.triangle)
        g = left.T @ at.target
        significant = values > 1e-13 * values[0] if len(values) else values > 0
        if float(g[significant] @ g[significant]) <= CONVERGED * at.cost:
            return Minimum(at, iterations, evaluations, True, "no decrease left")
        if at.cost <= good_enough:
            return Minimum(at, iterations, evaluations, False, "good enough")
        if iterations >= max_iterations:
            return Minimum(at, iterations, evaluations, False, f"stopped after {iterations} iterations")
        accepted = blocked = False
        while damping < 1e10:
            weights = np.where(significant, values / (values**2 + damping), 0.0)
            step = -(right.T @ (weights * g)) / at.scale
            theta = at.theta + step
            if admissible(orders, theta):
                trial = linearise(experiments, orders, theta, initial_conditions)
                evaluations += 1
                if trial.cost < at.cost:
                    # decrease predicted by the linear model
                    remaining = g * (1.0 - values * weights)
                    predicted = float(g @ g - remaining @ remaining)
                    gain = (at.cost - trial.cost) / predicted if predicted > 0.0 else 0.0
                    accepted = True
                    break
            else:
                blocked = True
            damping = max(damping * 10.0, 1e-8)
        if not accepted:
            decrease = float(g[significant] @ g[significant])
            flat = decrease <= 1e-4 * at.cost or at.cost <= 1e-16 * energy
            why = "the stability limit blocks the step" if blocked else "no step decreases the errors further"
            return Minimum(at, iterations, evaluations, flat, why)
        tiny = at.cost - trial.cost <= 1e-15 * at.cost
        at = trial
        iterations += 1
        if gain > 0.75:
            damping /= 30.0
        elif gain < 0.25:
            damping = max(damping * 4.0, 1e-8)
        if tiny:
            return Minimum(at, iterations, evaluations, True, "decrease at rounding level")


def admissible(orders: Orders, theta: FloatArray) -> bool:
    """Whether C, D and every F have their roots inside the unit circle."""
    if not np.isfinite(theta).all():
        return False
    _, _, c, d, f = orders.split(theta)
    return all(is_stable(polynomial, STABILITY_MARGIN) for polynomial in (c, d, *f))


def coloured_information(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    order: int,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> FloatArray:
    """J' R J (p, p) with the covariance R of errors that are independent of the input but not white.

    R is that of an autoregressive model of the errors: J is filtered by the model [Ljung1999, ch. 9].
    """
    parts = [error_jacobian(e, orders, theta, initial_conditions).columns for e in experiments]
    errors = np.concatenate([part[:, -1] for part in parts])
    whitener, _ = autoregression(errors, order)
    total = np.zeros((orders.count,) * 2)
    for part in parts:
        filtered = scipy.signal.lfilter([1.0], whitener, part[:, :-1], axis=0)
        total += filtered.T @ filtered
    return total * float(np.mean(scipy.signal.lfilter(whitener, [1.0], errors) ** 2))


def scores(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> list[FloatArray]:
    """Jacobian times error, sample by sample (rows, p) per experiment: the terms of half the gradient."""
    parts = [error_jacobian(e, orders, theta, initial_conditions).columns for e in experiments]
    return [part[:, :-1] * part[:, -1:] for part in parts]


def linearise(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> Linearisation:
    """Criterion and exact first derivatives at parameters theta (p,)."""
    parts = [
        error_jacobian(e, orders, theta, initial_conditions)
        if e.complete
        else gapped_error_jacobian(e, orders, theta, initial_conditions)
        for e in experiments
    ]
    columns = np.vstack([part.columns for part in parts]) if len(parts) > 1 else parts[0].columns
    p = orders.count
    inflation = 1.0
    slopes = [part.slope for part in parts if part.slope is not None]
    if slopes:
        # at the best variance of the errors, -2 log likelihood is `count` times the logarithm of the cost
        count = sum(part.errors for part in parts)
        inflation = float(np.exp(sum(part.log_determinant for part in parts) / count))
        columns[:, :p] += columns[:, p:] * np.sum(slopes, axis=0) / (2.0 * count)
        columns *= np.sqrt(inflation)
    errors = columns[:, p]
    cost = float(errors @ errors)
    triangle, lengths = scaled_triangle(columns, guarded=p)
    return Linearisation(
        theta=theta,
        cost=cost,
        triangle=triangle[:p, :p],
        target=lengths[p] * triangle[:p, p],
        scale=lengths[:p],
        errors=sum(part.errors for part in parts),
        transients=sum(part.transients for part in parts),
        inflation=inflation,
    )


SCREENING_STEPS = 4  # steps from every initial estimate before the best is chosen
AGREED = 0.1  # N dV/V between two initial estimates that lead to the same minimum
EASY = 20  # steps to the minimum; more suggest a difficult criterion, for which all initial estimates are tried


@dataclass(frozen=True)
class InitialEstimate:
    """Initial parameters of a search.

    Attributes:
        name: Method of estimation.
        theta: Parameters (p,).
    """

    name: str
    theta: FloatArray


@dataclass(frozen=True)
class Search:
    """Result of a search from several initial estimates.

    Attributes:
        best: The lowest minimum.
        costs: Sum of squares from each initial estimate after a few steps.
        start: Name of the initial estimate that led to the minimum.
    """

    best: Minimum
    costs: dict[str, float]
    start: str


def search(
    experiments: Sequence[IOData],
    orders: Orders,
    initial_estimates: Iterable[InitialEstimate],
    *,
    max_iterations: int = 100,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> Search:
    """Refine initial estimates by a few steps until two agree, then the best to the minimum; if that is slow, all."""
    samples = sum(len(e) for e in experiments)
    remaining = iter(initial_estimates)
    screened: dict[str, Minimum] = {}

    def screen(start: InitialEstimate, good_enough: float = 0.0) -> None:
        if admissible(orders, start.theta):
            screened[start.name] = minimise(
                experiments,
                orders,
                start.theta,
                max_iterations=SCREENING_STEPS,
                initial_conditions=initial_conditions,
                good_enough=good_enough,
            )

    def polish(name: str) -> Minimum:
        screening = screened[name]
        if screening.converged:
            return screening
        return minimise(
            experiments, orders, screening.at, max_iterations=max_iterations, initial_conditions=initial_conditions
        )

    for start in remaining:
        # a cost that agrees with the best one needs no further steps
        least = min((minimum.at.cost for minimum in screened.values()), default=0.0)
        screen(start, least * (1.0 + AGREED / samples))
        costs = sorted(minimum.at.cost for minimum in screened.values())
        if len(costs) > 1 and samples * (costs[1] - costs[0]) <= AGREED * costs[0]:
            break
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    best = polish(chosen)
    if not best.converged or best.iterations > EASY:
        for start in remaining:
            screen(start)
        for name in sorted(screened, key=lambda name: screened[name].at.cost):
            if name != chosen and (other := polish(name)).at.cost < best.at.cost:
                best, chosen = other, name
    return Search(best, {name: minimum.at.cost for name, minimum in screened.items()}, chosen)
