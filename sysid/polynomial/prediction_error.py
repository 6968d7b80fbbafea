"""Minimisation of prediction errors, for all polynomial structures.

eps = D/C (A y - sum_j B_j/F_j u_j), minimised in the mean square; ARMAX, OE and BJ differ only in orders. For given C
and F the unknown initial conditions enter linearly, as a few transient columns. They are projected out (variable
projection [GolubPereyra2003]), so that they add no parameters to the search and no bias.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import numpy as np
import scipy

from sysid.polynomial.correlation import autoregression
from sysid.polynomial.error_jacobian import error_jacobian, gapped_error_jacobian
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.orders import Orders
from sysid.polynomial.stability_limit import AT_THE_LIMIT, admissible, constrained_step, outward, pulled_in
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

CONVERGED = 1e-9  # remaining decrease, relative to the sum of squares
ROUNDING = 1e-30  # sum of squares, relative to that of the output, that is rounding alone
NOISE_FREE = 1e-16  # the same, below which rounding decides about steps


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
    longest = max(map(len, experiments))

    def criterion(theta: FloatArray, origin: FloatArray) -> Linearisation | None:
        if not np.isfinite(theta).all():
            return None
        return linearise(experiments, orders, pulled_in(orders, theta, origin, longest), initial_conditions)

    at = start if isinstance(start, Linearisation) else linearise(experiments, orders, start, initial_conditions)
    return levenberg_marquardt(
        criterion,
        at,
        energy,
        outward=partial(outward, orders, samples=longest),
        max_iterations=max_iterations,
        good_enough=good_enough,
    )


def levenberg_marquardt(
    criterion: Callable[[FloatArray, FloatArray], Linearisation | None],
    at: Linearisation,
    energy: float,
    *,
    outward: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = None,
    max_iterations: int = 100,
    good_enough: float = 0.0,
) -> Minimum:
    """Minimise a criterion from one linearisation of it [More1978].

    Args:
        criterion: Linearisation at parameters (p,) that a step from others (p,) leads to; None where not admissible.
        at: That at the initial parameters.
        energy: Sum of squares of the output: errors far below it are rounding.
        outward: Directions at parameters that lead to a limit (k, p), and the largest product of a step with each (k,).
        max_iterations: Limit on the accepted steps.
        good_enough: Cost at which to stop early.
    """
    damping, iterations, evaluations = 1e-4, 0, 1
    while True:
        if at.cost <= ROUNDING * energy:
            return Minimum(at, iterations, evaluations, True, "errors at rounding level")
        left, values, right = np.linalg.svd(at.triangle)
        significant = values > 1e-13 * values[0] if len(values) else values > 0
        g = left.T @ at.target
        limits, reach = outward(at.theta) if outward else (np.zeros((0, len(at.theta))), np.zeros(0))
        rows = np.where(significant, limits / at.scale @ right.T, 0.0)
        predict = partial(_predicted_step, np.where(significant, values, 0.0), g, rows, reach)
        step, decrease = predict(0.0)
        if decrease <= CONVERGED * at.cost:
            where = " at the edge of stability" if (reach - rows @ step < 1e-12).any() else ""
            return Minimum(at, iterations, evaluations, True, f"no decrease left{where}")
        if at.cost <= good_enough:
            return Minimum(at, iterations, evaluations, False, "good enough")
        if iterations >= max_iterations:
            return Minimum(at, iterations, evaluations, False, f"stopped after {iterations} iterations")
        trial = None
        larger = damping * 10.0 ** np.arange(10.0 - np.log10(damping))
        # along a narrow valley a nearly undamped step may go down where shorter ones leave it
        smaller = np.geomspace(1e-14, damping, 0 if at.cost <= NOISE_FREE * energy else 10, endpoint=False)
        for damping in (*larger, *smaller):
            direction, predicted = predict(damping)
            trial = criterion(at.theta + right.T @ direction / at.scale, at.theta)
            evaluations += trial is not None
            if trial is not None and trial.cost < at.cost:
                break
            trial = None
        if trial is None:
            flat = decrease <= 1e-4 * at.cost or at.cost <= NOISE_FREE * energy
            return Minimum(at, iterations, evaluations, flat, "no step decreases the errors further")
        achieved, tiny = at.cost - trial.cost, at.cost - trial.cost <= 1e-15 * at.cost
        at = trial
        iterations += 1
        if achieved > 0.75 * predicted:
            damping = max(damping / 30.0, 1e-100)
        elif achieved < 0.25 * predicted:
            damping = max(damping * 4.0, 1e-12)
        if tiny:
            return Minimum(at, iterations, evaluations, True, "decrease at rounding level")


def _predicted_step(
    values: FloatArray, g: FloatArray, rows: FloatArray, reach: FloatArray, damping: float
) -> tuple[FloatArray, float]:
    """Damped step in singular directions that keeps roots inside, and the decrease by the linear model."""
    step = constrained_step(np.where(values > 0.0, values**2 + damping, 1.0), -values * g, rows, reach)
    remaining = g + values * step
    return step, float(g @ g - remaining @ remaining)


def coloured_information(parts: Sequence[FloatArray], order: int, directions: FloatArray) -> FloatArray:
    """L' J' R J L (q, q) with the correlations R of output errors that are independent of the input but not white.

    R is that of an autoregressive model of the errors, of the order up to `order` that BIC prefers, which is 0 for
    white ones: J is filtered by the model [Ljung1999, ch. 9]. The directions L (p, q), for which J L is orthonormal,
    keep the digits that J' R J loses where parameters are poorly determined.

    Args:
        parts: [J, errors] of each experiment (rows, p + 1); of a missing output J is zero and the error NaN.
        order: Highest order of the model.
        directions: L.
    """
    whitener, correlations = autoregression(np.concatenate([part[:, -1] for part in parts]), order, select=True)
    total = np.zeros((directions.shape[1],) * 2)
    for part in parts:
        filtered = scipy.signal.lfilter([1.0], whitener, part[:, :-1] @ directions, axis=0)
        total += filtered.T @ filtered
    return total * float(whitener @ correlations[: len(whitener)])


def output_errors(
    experiments: Sequence[IOData], orders: Orders, theta: FloatArray, initial_conditions: InitialConditions
) -> list[FloatArray]:
    """Jacobian and errors of each experiment (rows, p + 1) without noise model; errors of missing outputs are NaN."""
    jacobian = gapped_error_jacobian if any(not e.complete for e in experiments) else error_jacobian
    parts = [jacobian(e, orders, theta, initial_conditions).columns for e in experiments]
    for e, part in zip(experiments, parts, strict=True):
        part[~e.known[len(e) - len(part) :, 0], -1] = np.nan
    return parts


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
SHORT = 50.0  # samples per parameter below which the criterion often has several minima
EASY = 20  # steps to the minimum; more suggest a difficult criterion, for which all initial estimates are tried
ROUNDS = ((6, 8), (3, 16), (2, 1000))  # of a difficult criterion: the best initial estimates, and their further steps


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
    initial_estimates: Callable[[Orders], Iterable[InitialEstimate]],
    orders: Orders,
    *,
    start: InitialEstimate | None = None,
    smaller_too: bool = True,
    neighbours: bool = True,
    thorough: bool = True,
    max_iterations: int = 100,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> Search:
    """Refine initial estimates by a few steps until two agree, then the best to the minimum; if that is slow, all.

    Where several minima are likely, those of smaller structures, padded with zeros, join; a `start` replaces them.

    Args:
        experiments: The data.
        initial_estimates: Initial estimates of a structure, the best methods first.
        orders: The structure.
        start: A further initial estimate.
        smaller_too: Whether to try the structure with one degree less of everything, which does so in turn.
        neighbours: Whether to try, beside it, those with one degree less of one polynomial.
        thorough: Whether other initial estimates than the best one are refined too.
        max_iterations: Limit on the steps of every search.
        initial_conditions: Assumption about the time before each experiment.
    """
    samples = sum(len(e) for e in experiments)
    remaining = chain([] if start is None else [start], initial_estimates(orders))
    screened: dict[str, Minimum] = {}

    def refine(origin: FloatArray | Linearisation, steps: int = max_iterations, good_enough: float = 0.0) -> Minimum:
        return minimise(
            experiments,
            orders,
            origin,
            max_iterations=min(steps, max_iterations),
            initial_conditions=initial_conditions,
            good_enough=good_enough,
        )

    agreed = False
    for one in remaining:
        if not admissible(orders, one.theta):
            continue
        # a cost that agrees with the best one needs no further steps
        least = min((minimum.at.cost for minimum in screened.values()), default=0.0)
        screened[one.name] = refine(one.theta, SCREENING_STEPS, least * (1.0 + AGREED / samples))
        costs = sorted(minimum.at.cost for minimum in screened.values())
        if agreed := len(costs) > 1 and samples * (costs[1] - costs[0]) <= AGREED * costs[0]:
            break
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    best = screened[chosen] if screened[chosen].converged else refine(screened[chosen].at)
    exact = best.at.cost <= NOISE_FREE * sum(float(np.nansum(e.y**2)) for e in experiments)
    at_the_limit = not admissible(orders, best.at.theta, max(map(len, experiments)), AT_THE_LIMIT)
    difficult = not exact and (not (agreed and best.converged) or best.iterations > EASY or at_the_limit)
    if difficult and thorough:
        for one in remaining:
            if admissible(orders, one.theta):
                screened[one.name] = refine(one.theta, SCREENING_STEPS)
        rivals = {name: minimum for name, minimum in screened.items() if name != chosen}
        for count, steps in ROUNDS:
            ranked = sorted(rivals.items(), key=lambda pair: pair[1].at.cost)
            rivals, reached = {}, [best.at.cost]
            for name, rival in ranked:
                # a cost that another has reached is that of the same minimum
                if len(rivals) < count and all(samples * abs(rival.at.cost - c) > AGREED * c for c in reached):
                    reached.append(rival.at.cost)
                    rivals[name] = rival if rival.converged else refine(rival.at, steps)
            best, chosen = min(
                [(best, chosen), *((rival, name) for name, rival in rivals.items())], key=lambda p: p[0].at.cost
            )
        if not best.converged and best.iterations < max_iterations:
            best = refine(best.at)
    path = {name: minimum.at.cost for name, minimum in screened.items()}
    ambiguous = difficult or (samples < SHORT * orders.count and not exact)
    smaller = _smaller(orders)[: None if neighbours else 1] if smaller_too and ambiguous and start is None else []
    for k, less in enumerate(smaller):
        below = search(
            experiments,
            initial_estimates,
            less,
            smaller_too=k == 0,
            neighbours=False,
            thorough=thorough,
            max_iterations=EASY if k else max_iterations,
            initial_conditions=initial_conditions,
        )
        if below.best.at.cost < best.at.cost:
            best = refine(orders.parameters(less.polynomials(below.best.at.theta)))
            chosen = f"padded from {less.count} parameters, {below.start}"
            path[chosen] = best.at.cost
    return Search(best, path, chosen)


def _smaller(orders: Orders) -> list[Orders]:
    """Structures with one degree less: of everything, and of B or F for all inputs or of A, C or D alone."""
    less = {name: max(getattr(orders, name) - 1, 0) for name in ("na", "nc", "nd")}
    less["nb"] = tuple(max(n - 1, 1) for n in orders.nb)
    less["nf"] = tuple(max(n - 1, 0) for n in orders.nf)
    smaller = [replace(orders, **less), *(replace(orders, **{name: value}) for name, value in less.items())]
    return [one for one in dict.fromkeys(smaller) if one != orders]
