"""Minimisation of prediction errors, for all polynomial structures.

eps = D/C (A y - sum_j B_j/F_j u_j), minimised in the mean square; ARMAX, OE and BJ differ only in orders. For given C
and F the unknown initial conditions enter linearly, as a few transient columns. They are projected out (variable
projection [GolubPereyra2003]), so that they add no parameters to the search and no bias.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain

import numpy as np
import scipy

from sysid.polynomial.correlation import autoregression
from sysid.polynomial.error_jacobian import (
    ErrorJacobian,
    FreeResponses,
    error_jacobian,
    gapped_error_jacobian,
    jacobian_of_record,
)
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.orders import Orders
from sysid.polynomial.recent_minima import RecentResults, fingerprint
from sysid.polynomial.root_exchange import exchanged_roots
from sysid.polynomial.stability_limit import AT_THE_LIMIT, admissible, constrained_step, move_roots_inside, outward
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd

CONVERGED = 1e-9  # remaining decrease, relative to the sum of squares
STALLED = 1e-15  # decrease by an accepted step, relative to the sum of squares, that is rounding
FLAT = 1e-4  # decrease that the linear model promises, relative likewise, up to which a failing step ends at a minimum
SIGNIFICANT = 1e-13  # singular value of the scaled Jacobian, relative to the largest, above which a direction is used
FIRST_DAMPING = 1e-4  # Jacobian of columns of unit length
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
    tolerance: float = CONVERGED,
) -> Minimum:
    """Levenberg-Marquardt with exact gradients; C, D and every F stay stable at every accepted step [More1978]."""
    energy = sum(map(_output_energy, experiments))
    longest = max(map(len, experiments))

    def criterion(theta: FloatArray, origin: FloatArray) -> Linearisation | None:
        if not np.isfinite(theta).all():
            return None
        return linearise(experiments, orders, move_roots_inside(orders, theta, origin, longest), initial_conditions)

    at = start if isinstance(start, Linearisation) else linearise(experiments, orders, start, initial_conditions)
    return levenberg_marquardt(
        criterion,
        at,
        energy,
        outward=partial(outward, orders, samples=longest),
        max_iterations=max_iterations,
        good_enough=good_enough,
        tolerance=tolerance,
    )


def _output_energy(experiment: IOData) -> float:
    """Sum of squares of the known outputs."""
    y = experiment.y[:, 0]
    return float(np.nansum(y**2)) if experiment.missing else float(y @ y)


def levenberg_marquardt(
    criterion: Callable[[FloatArray, FloatArray], Linearisation | None],
    at: Linearisation,
    energy: float,
    *,
    outward: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = None,
    max_iterations: int = 100,
    good_enough: float = 0.0,
    tolerance: float = CONVERGED,
) -> Minimum:
    """Minimise a criterion from one linearisation of it [More1978].

    Args:
        criterion: Linearisation at parameters (p,) that a step from others (p,) leads to; None where not admissible.
        at: That at the initial parameters.
        energy: Sum of squares of the output: errors far below it are rounding.
        outward: Directions at parameters that lead to a limit (k, p), and the largest product of a step with each (k,).
        max_iterations: Limit on the accepted steps.
        good_enough: Cost at which to stop early.
        tolerance: Remaining decrease, relative to the cost, at which the minimum counts as reached.
    """
    damping, iterations, evaluations = FIRST_DAMPING, 0, 1
    while True:
        if at.cost <= ROUNDING * energy:
            return Minimum(at, iterations, evaluations, True, "errors at rounding level")
        model = LinearModel.at(at, outward)
        step, decrease = model.step(0.0)
        if decrease <= tolerance * at.cost:
            where = " at the edge of stability" if model.reaches_limit(step) else ""
            return Minimum(at, iterations, evaluations, True, f"no decrease left{where}")
        if at.cost <= good_enough:
            return Minimum(at, iterations, evaluations, False, "good enough")
        if iterations >= max_iterations:
            return Minimum(at, iterations, evaluations, False, f"stopped after {iterations} iterations")
        noise_free = at.cost <= NOISE_FREE * energy
        improved = None
        for trial_damping in _dampings(damping, smaller_too=not noise_free):
            step, predicted = model.step(trial_damping)
            trial = criterion(at.theta + model.parameter_step(step), at.theta)
            evaluations += trial is not None
            if trial is not None and trial.cost < at.cost:
                improved, damping = trial, trial_damping
                break
        if improved is None:
            flat = decrease <= FLAT * at.cost or noise_free
            return Minimum(at, iterations, evaluations, flat, "no step decreases the errors further")
        achieved = at.cost - improved.cost
        stalled = achieved <= STALLED * at.cost
        at = improved
        iterations += 1
        # the gain ratio of a trust region: the linear model holds far beyond the step, or not even as far
        if achieved > 0.75 * predicted:
            damping = max(damping / 30.0, 1e-100)
        elif achieved < 0.25 * predicted:
            damping = max(damping * 4.0, 1e-12)
        if stalled:
            return Minimum(at, iterations, evaluations, True, "decrease at rounding level")


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linear model of the errors about one linearisation, in the singular directions of the scaled Jacobian U S V'.

    Attributes:
        values: Singular values S (p,), zero for directions that rounding alone determines.
        errors: U' times the target: the errors along the directions (p,).
        limits: Directions that lead to the limits of the parameters (k, p).
        reach: Largest product of a step with each of them (k,).
        right: V' (p, p).
        scale: Lengths of the Jacobian's columns (p,).
    """

    values: FloatArray
    errors: FloatArray
    limits: FloatArray
    reach: FloatArray
    right: FloatArray
    scale: FloatArray

    @staticmethod
    def at(at: Linearisation, outward: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None) -> "LinearModel":
        """Singular value decomposition of a linearisation, with limits as in `levenberg_marquardt`."""
        left, values, right = svd(at.triangle)
        significant = values > SIGNIFICANT * values[0] if len(values) else values > 0
        limits, reach = np.zeros((0, len(at.theta))), np.zeros(0)
        if outward is not None:
            limits, reach = outward(at.theta)
        return LinearModel(
            values=np.where(significant, values, 0.0),
            errors=left.T @ at.target,
            limits=np.where(significant, limits / at.scale @ right.T, 0.0),
            reach=reach,
            right=right,
            scale=at.scale,
        )

    def step(self, damping: float) -> tuple[FloatArray, float]:
        """Damped step along the directions (p,) that keeps within the limits, and the decrease that it promises."""
        curvature = np.where(self.values > 0.0, self.values**2 + damping, 1.0)
        step = constrained_step(curvature, -self.values * self.errors, self.limits, self.reach)
        remaining = self.errors + self.values * step
        return step, float(self.errors @ self.errors - remaining @ remaining)

    def reaches_limit(self, step: FloatArray) -> bool:
        """Whether a step ends at a limit."""
        return bool((self.reach - self.limits @ step < 1e-12).any())

    def parameter_step(self, step: FloatArray) -> FloatArray:
        """Change of the parameters (p,) by a step along the singular directions."""
        return self.right.T @ step / self.scale


def _dampings(last: float, *, smaller_too: bool) -> Iterator[float]:
    """Dampings to try: ever larger ones up to 1e10 from the last one that worked, then smaller ones."""
    yield from last * 10.0 ** np.arange(10.0 - np.log10(last))
    if smaller_too:
        # along a narrow valley a nearly undamped step may go down where shorter ones leave it
        yield from np.geomspace(1e-14, last, 10, endpoint=False)


def coloured_information(columns: Sequence[FloatArray], order: int, directions: FloatArray) -> FloatArray:
    """L' J' R J L (q, q) with the correlations R of output errors that are independent of the input but not white.

    R is that of an autoregressive model of the errors, of the order up to `order` that BIC prefers, which is 0 for
    white ones: J is filtered by the model [Ljung1999, ch. 9]. The directions L (p, q), for which J L is orthonormal,
    keep the digits that J' R J loses where parameters are poorly determined.

    Args:
        columns: [J, errors] of each experiment (rows, p + 1); of a missing output J is zero and the error NaN.
        order: Highest order of the model.
        directions: L.
    """
    errors = np.concatenate([table[:, -1] for table in columns])
    whitener, correlations = autoregression(errors, order, select=True)
    total = np.zeros((directions.shape[1],) * 2)
    if not total.size:
        # no direction of the parameters is determined
        return total
    for table in columns:
        filtered = scipy.signal.lfilter([1.0], whitener, table[:, :-1] @ directions, axis=0)
        total += filtered.T @ filtered
    # the variance of the model's innovations, relative to that of the errors
    return total * float(whitener @ correlations[: len(whitener)])


def output_errors(
    experiments: Sequence[IOData], orders: Orders, theta: FloatArray, initial_conditions: InitialConditions
) -> list[FloatArray]:
    """Jacobian and errors of each experiment (rows, p + 1) without noise model; errors of missing outputs are NaN."""
    jacobian = gapped_error_jacobian if any(not e.complete for e in experiments) else error_jacobian
    tables = [jacobian(e, orders, theta, initial_conditions).columns for e in experiments]
    for experiment, table in zip(experiments, tables, strict=True):
        first = len(experiment) - len(table)
        table[~experiment.known[first:, 0], -1] = np.nan
    return tables


def scores(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> list[FloatArray]:
    """Jacobian times error, sample by sample (rows, p) per experiment: the terms of half the gradient."""
    tables = [error_jacobian(e, orders, theta, initial_conditions).columns for e in experiments]
    return [table[:, :-1] * table[:, -1:] for table in tables]


def linearise(
    experiments: Sequence[IOData],
    orders: Orders,
    theta: FloatArray,
    initial_conditions: InitialConditions = InitialConditions.ESTIMATED,
) -> Linearisation:
    """Criterion and exact first derivatives at parameters theta (p,)."""
    responses = FreeResponses(orders, theta)
    jacobians = [jacobian_of_record(e, orders, theta, initial_conditions, responses) for e in experiments]
    return linearisation_of(jacobians, theta)


def linearisation_of(jacobians: Sequence[ErrorJacobian], theta: FloatArray) -> Linearisation:
    """Criterion and first derivatives from those of every experiment, at parameters theta (p,)."""
    # stacking copies the largest array of the search
    columns = jacobians[0].columns if len(jacobians) == 1 else np.vstack([jacobian.columns for jacobian in jacobians])
    p = len(theta)
    error_count = sum(jacobian.errors for jacobian in jacobians)
    inflation = 1.0
    slopes = [jacobian.slope for jacobian in jacobians if jacobian.slope is not None]
    if slopes:
        # at the best variance of the errors, -2 log likelihood is their number times the logarithm of the cost
        inflation = float(np.exp(sum(jacobian.log_determinant for jacobian in jacobians) / error_count))
        columns[:, :p] += columns[:, p:] * np.sum(slopes, axis=0) / (2.0 * error_count)
        columns *= np.sqrt(inflation)
    errors = columns[:, p]
    triangle, lengths = scaled_triangle(columns, guarded=p)
    return Linearisation(
        theta=theta,
        cost=float(errors @ errors),
        triangle=triangle[:p, :p],
        target=lengths[p] * triangle[:p, p],
        scale=lengths[:p],
        errors=error_count,
        transients=sum(jacobian.transients for jacobian in jacobians),
        inflation=inflation,
    )


SCREENING_STEPS = 4  # steps from every initial estimate before the best is chosen
AGREED = 0.1  # N dV/V between two initial estimates that lead to the same minimum
SHORT = 50.0  # samples per parameter below which the criterion often has several minima
EASY = 20  # steps to the minimum; more suggest a difficult criterion, for which all initial estimates are tried
ROUNDS = ((6, 8), (3, 16), (2, 1000))  # of a difficult criterion: the best initial estimates, and their further steps

EXCHANGES = 3  # of a root between A and F, one after the other
EXCHANGE_ROUNDS = ((4, 8), (2, 16))  # of their minima: the best, and their further steps


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
    tolerance: float = CONVERGED,
) -> Search:
    """Refine initial estimates by a few steps until two agree, then the best to the minimum; if that is slow, all.

    Where several minima are likely, those of smaller structures, padded with zeros, join; a `start` replaces them.

    Args:
        experiments: The data.
        initial_estimates: Initial estimates of a structure, the best methods first.
        orders: The structure.
        start: A further initial estimate.
        smaller_too: Whether to try the structure with one degree less of everything, which does so in turn.
        neighbours: Whether to try, beside it, those with one degree less of one polynomial, and exchanged roots.
        thorough: Whether other initial estimates than the best one are refined too.
        max_iterations: Limit on the steps of every search.
        initial_conditions: Assumption about the time before each experiment.
        tolerance: Remaining decrease, relative to the sum of squares, at which a minimum counts as reached.

    Raises:
        SysidError: C, D or F of every initial estimate has a root at the unit circle or beyond.
    """
    refine = Refinement(experiments, orders, max_iterations, initial_conditions, tolerance)
    first = [] if start is None else [start]
    candidates = chain(first, initial_estimates(orders))
    remaining = (candidate for candidate in candidates if admissible(orders, candidate.theta))
    screened, agreed = _screened_until_two_agree(refine, remaining)
    if not screened:
        # roots of polynomials of hundreds of coefficients move by more than their distance from the unit circle
        # when they are rounded: moving them inside then does not keep them there
        degrees = ", ".join(f"{name} = {order}" for name, order in orders.select("na", "nc", "nd", "nf").items())
        raise SysidError(
            f"no initial estimate of {degrees} has C, D and F with all roots inside the unit circle, which rounding "
            "prevents at high orders; expected lower orders, or start=Polynomials(...) that has them inside"
        )
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    best = screened[chosen] if screened[chosen].converged else refine(screened[chosen].at)

    noise_free = best.at.cost <= NOISE_FREE * sum(float(np.nansum(e.y**2)) for e in experiments)
    at_the_limit = not admissible(orders, best.at.theta, max(map(len, experiments)), AT_THE_LIMIT)
    slow = best.iterations > EASY or not best.converged
    difficult = not noise_free and (slow or at_the_limit or not agreed)
    if difficult and thorough:
        for candidate in remaining:
            screened[candidate.name] = refine(candidate.theta, SCREENING_STEPS)
        best, chosen = _best_of_rivals(refine, screened, best, chosen)
        if not best.converged and best.iterations < max_iterations:
            best = refine(best.at)

    costs = {name: minimum.at.cost for name, minimum in screened.items()}
    ambiguous = difficult or (refine.samples < SHORT * orders.count and not noise_free)
    if smaller_too and ambiguous and start is None:
        minima = _smaller_minima(
            partial(search, experiments, initial_estimates, thorough=thorough, initial_conditions=initial_conditions),
            orders,
            max_iterations,
            neighbours=neighbours,
        )
        for less, below in minima:
            if below.best.at.cost < best.at.cost:
                best = refine(orders.parameters(less.polynomials(below.best.at.theta)))
                chosen = f"padded from {less.count} parameters, {below.start}"
                costs[chosen] = best.at.cost
    if orders.na and any(orders.nf) and neighbours and thorough and not noise_free:
        best, chosen = _best_of_exchanges(refine, best, chosen)
        costs.setdefault(chosen, best.at.cost)
    return Search(best, costs, chosen)


STRETCHES = 5  # of each long experiment that are searched, spread over it
STRETCH = 4000  # samples of each: long beside the memory of most systems


def search_of_long_records(
    experiments: Sequence[IOData],
    initial_estimates: Callable[[Sequence[IOData], Orders], Iterable[InitialEstimate]],
    find: partial[Search],
) -> Search | None:
    """Search stretches of long records, then refine their minimum with all samples; None if that is not the minimum.

    Several minima are as many in 20,000 samples as in a million, and the search among them costs a fiftieth. The first
    initial estimate of all samples, refined by a few steps, must not lead below the minimum. Records whose stretches
    cannot be fitted, as those with a single step of the input, are searched as a whole by the caller.

    Args:
        experiments: The data, without gaps.
        initial_estimates: Initial estimates of a structure from data, the best methods first.
        find: `search` with the structure, the limit on the steps and the initial conditions.
    """
    orders, initial_conditions = find.keywords["orders"], find.keywords["initial_conditions"]
    stretches = _stretches(experiments)
    try:
        result = find(stretches, partial(initial_estimates, stretches))
    except SysidError:
        return None
    if not result.best.converged:
        return None
    refine = Refinement(experiments, orders, find.keywords["max_iterations"], initial_conditions)
    best = refine(result.best.at.theta)
    rival = next((start for start in initial_estimates(experiments, orders) if admissible(orders, start.theta)), None)
    if rival is None or not best.converged or best.iterations > EASY:
        return None
    screened = refine(rival.theta, SCREENING_STEPS, best.at.cost)
    if refine.samples * (best.at.cost - screened.at.cost) > AGREED * best.at.cost:
        return None
    costs = {f"{len(stretches)} stretches, {result.start}": best.at.cost, rival.name: screened.at.cost}
    return Search(best, costs, next(iter(costs)))


def _stretches(experiments: Sequence[IOData]) -> list[IOData]:
    """Stretches spread over long experiments, and all of short ones."""
    stretches = []
    for experiment in experiments:
        if len(experiment) <= STRETCHES * STRETCH:
            stretches.append(experiment)
            continue
        for first in np.linspace(experiment.window, len(experiment) - STRETCH, STRETCHES).astype(int).tolist():
            stretches.append(experiment[first : first + STRETCH])
    return stretches


def _smaller_minima(
    search_below: Callable[..., Search], orders: Orders, max_iterations: int, *, neighbours: bool
) -> Iterator[tuple[Orders, Search]]:
    """Smaller structures with their minima; without `neighbours` that with one degree less of everything alone."""
    smaller = _smaller_structures(orders)
    if not neighbours:
        smaller = smaller[:1]
    for k, less in enumerate(smaller):
        # the first has one degree less of everything; only it is searched to the end, and leads to still smaller ones
        steps = max_iterations if k == 0 else EASY
        # a structure that cannot be fitted offers no minimum
        with suppress(SysidError):
            yield less, search_below(less, smaller_too=k == 0, neighbours=False, max_iterations=steps)


RECENT_MINIMA: RecentResults[Minimum] = RecentResults(capacity=2048)
"""Minima of the last searches, some kilobytes each: a scan of a hundred structures fits."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """Minimisation of one structure from any parameters.

    Attributes:
        experiments: The data.
        orders: The structure.
        max_iterations: Limit on the steps.
        initial_conditions: Assumption about the time before each experiment.
        tolerance: Remaining decrease, relative to the sum of squares, at which a minimum counts as reached.
    """

    experiments: Sequence[IOData]
    orders: Orders
    max_iterations: int
    initial_conditions: InitialConditions
    tolerance: float = CONVERGED

    @property
    def samples(self) -> int:
        """Samples of all experiments."""
        return sum(map(len, self.experiments))

    def __call__(
        self, origin: FloatArray | Linearisation, steps: int | None = None, good_enough: float = 0.0
    ) -> Minimum:
        """Minimise in at most so many steps, or until a cost is reached that is good enough."""
        limit = self.max_iterations if steps is None else min(steps, self.max_iterations)
        theta = origin.theta if isinstance(origin, Linearisation) else origin
        key = (self._record, self.orders, theta.tobytes(), limit, self.initial_conditions, good_enough, self.tolerance)
        compute = partial(
            minimise,
            self.experiments,
            self.orders,
            origin,
            max_iterations=limit,
            initial_conditions=self.initial_conditions,
            good_enough=good_enough,
            tolerance=self.tolerance,
        )
        return RECENT_MINIMA.get(key, compute)

    @cached_property
    def _record(self) -> bytes:
        return fingerprint(self.experiments)


def _screened_until_two_agree(
    refine: Refinement, candidates: Iterable[InitialEstimate]
) -> tuple[dict[str, Minimum], bool]:
    """Refine initial estimates by a few steps until two agree; the minima by name, and whether two agree."""
    screened: dict[str, Minimum] = {}
    for candidate in candidates:
        # a cost that agrees with the best one needs no further steps
        least_cost = min((minimum.at.cost for minimum in screened.values()), default=0.0)
        good_enough = least_cost * (1.0 + AGREED / refine.samples)
        screened[candidate.name] = refine(candidate.theta, SCREENING_STEPS, good_enough)
        costs = sorted(minimum.at.cost for minimum in screened.values())
        if len(costs) > 1 and refine.samples * (costs[1] - costs[0]) <= AGREED * costs[0]:
            return screened, True
    return screened, False


def _best_of_rivals(
    refine: Refinement,
    screened: dict[str, Minimum],
    best: Minimum,
    chosen: str,
    rounds: Sequence[tuple[int, int]] = ROUNDS,
) -> tuple[Minimum, str]:
    """Refine the other screened minima, ever fewer by ever more steps; the lowest minimum of all, and its name."""
    rivals = {name: minimum for name, minimum in screened.items() if name != chosen}
    for count, steps in rounds:
        ranked = sorted(rivals.items(), key=lambda rival: rival[1].at.cost)
        rivals, reached = {}, [best.at.cost]
        for name, rival in ranked:
            # a cost that another has reached is that of the same minimum
            is_new = all(refine.samples * abs(rival.at.cost - cost) > AGREED * cost for cost in reached)
            if len(rivals) < count and is_new:
                reached.append(rival.at.cost)
                rivals[name] = rival if rival.converged else refine(rival.at, steps)
        for name, rival in rivals.items():
            if rival.at.cost < best.at.cost:
                best, chosen = rival, name
    return best, chosen


def _best_of_exchanges(refine: Refinement, best: Minimum, chosen: str) -> tuple[Minimum, str]:
    """The lowest minimum that exchanges of roots between A and F lead to, one after the other, and its name."""
    for _ in range(EXCHANGES):
        rivals: dict[str, Minimum] = {}
        for candidate in exchanged_roots(refine.orders, best.at.theta):
            if admissible(refine.orders, candidate):
                name = f"{chosen}, exchange {len(rivals) + 1}"
                rivals[name] = refine(candidate, SCREENING_STEPS)
        lowest, name = _best_of_rivals(refine, rivals, best, chosen, EXCHANGE_ROUNDS)
        # the same minimum stays as it is, to the last bit
        if refine.samples * (best.at.cost - lowest.at.cost) <= AGREED * best.at.cost:
            break
        chosen = name
        best = lowest if lowest.converged else refine(lowest.at)
    return best, chosen


def _smaller_structures(orders: Orders) -> list[Orders]:
    """Structures with one degree less: of everything, and of B or F for all inputs or of A, C or D alone."""
    less = {name: max(getattr(orders, name) - 1, 0) for name in ("na", "nc", "nd")}
    less["nb"] = tuple(max(n - 1, 1) for n in orders.nb)
    less["nf"] = tuple(max(n - 1, 0) for n in orders.nf)
    smaller = [replace(orders, **less)]
    for name, value in less.items():
        smaller.append(replace(orders, **{name: value}))
    # an order that is 0 already gives the structure itself, or the same one twice
    return [structure for structure in dict.fromkeys(smaller) if structure != orders]
