"""Search for the lowest sum of squared output errors: several starts, delays in every interval, smaller models."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sysid.continuous.initial_estimates import initial_estimates
from sysid.continuous.output_error_criterion import TIGHT, OutputError
from sysid.continuous.structures import enlarged
from sysid.polynomial.prediction_error import SCREENING_STEPS, Linearisation, LinearModel, Minimum
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

REACH = 3  # samples by which a delay may grow from its initial estimate before the search starts again
POLISHED = 2  # of the screened initial estimates, the best, from which the search runs to the end
EARLY = 0.5  # share of the input's movement, by its squared steps, from which on it is lost with the first samples
HOPS = 3  # intervals to each side that a quick search tries
ROUNDING = 1e-26  # sum of squared errors, relative to that of the output, below which rounding decides


@dataclass(frozen=True, eq=False)
class OutputFit:
    """Fit of the transfer functions from all inputs to one output.

    Attributes:
        criterion: Sum of squares that was minimised last.
        minimum: Its lowest minimum.
        starts: Number of initial estimates.
        early: Whether the input moves in the first samples above all, whose errors do not count.
    """

    criterion: OutputError
    minimum: Minimum
    starts: int
    early: bool = False

    def offsets(self) -> list[float]:
        """Constant in the output of each experiment."""
        theta = self.minimum.at.theta
        return [self.criterion.columns(e, theta)[2] for e in self.criterion.experiments]


def lowest_minimum(criterion: OutputError, max_iterations: int, start: FloatArray | None = None) -> OutputFit:
    """The lowest minimum from several initial estimates, or the one that is reached from a start (p,).

    Where the input is not known before the record, the first samples up to the longest delay do not count: the input
    of a step test may move there alone. Then it is taken as held at its first value before, unless the errors of those
    samples say otherwise.
    """
    if start is not None:
        return _minimum_from(criterion, start, max_iterations)
    further = []
    if criterion.known:
        # initial estimates are those of all parameters: the best of them stands near what is known
        unrestricted = replace(criterion, known={})
        further.append(_with_smaller_models(unrestricted, max_iterations).minimum.at.theta)
    fit = _with_smaller_models(criterion, max_iterations, further)
    if not (criterion.delays() and criterion.free):
        return fit
    if moves_early(criterion):
        held = _with_smaller_models(replace(criterion, held=True), max_iterations, [fit.minimum.at.theta])
        if _agrees(held, fit):
            return held
        fit = replace(fit, early=True)
    return _with_short_delays(criterion, fit, max_iterations)


def _check_start(criterion: OutputError, start: FloatArray) -> None:
    """Refuse a start whose delays are outside their limits, or at which the model cannot be simulated."""
    slack = TIGHT * criterion.experiments[0].dt
    for delay in start[criterion.delays()].tolist():
        if not -slack <= delay <= criterion.longest + slack:
            raise SysidError(
                f"start: expected a delay from 0 to {criterion.longest:g} s, the largest that is searched (max_delay "
                f"changes it), got {delay:g} s"
            )
    if criterion(start) is None:
        raise SysidError(f"start: expected parameters of a stable model of finite response, got {start.tolist()}")


def _minimum_from(criterion: OutputError, start: FloatArray, max_iterations: int) -> OutputFit:
    """The minimum that is reached from a start; see `lowest_minimum`."""
    _check_start(criterion, start)
    limited, delays = criterion, criterion.delays()
    has_free_delay = bool(delays) and criterion.free
    if has_free_delay:
        reach = float(start[delays].max()) + REACH * criterion.experiments[0].dt
        limited = replace(criterion, longest=min(reach, criterion.longest))
    fit = OutputFit(limited, _polished(limited, [start], max_iterations), 1)
    if has_free_delay and moves_early(criterion):
        of_held = replace(criterion, held=True)
        held = OutputFit(of_held, _polished(of_held, [start], max_iterations), 1)
        return held if _agrees(held, fit) else replace(fit, early=True)
    return fit


def moves_early(criterion: OutputError) -> bool:
    """Whether most of the movement of some input lies within the samples that do not count."""
    delayed = criterion.delays()
    for j, end in enumerate(criterion.sizes):
        lost = total = 0.0
        for experiment in criterion.experiments:
            steps = np.diff(experiment.u[:, j]) ** 2
            lost += float(np.sum(steps[: criterion.first(experiment)]))
            total += float(np.sum(steps))
        if end - 1 in delayed and lost >= EARLY * total:
            return True
    return False


def _agrees(held: OutputFit, fit: OutputFit) -> bool:
    """Whether BIC prefers held inputs before the record to errors of any size in the samples that do not count."""
    with_all, without = held.minimum.at, fit.minimum.at
    rounding = ROUNDING * held.criterion.energy
    ratio = max(with_all.cost, rounding) / max(without.cost, rounding)
    return with_all.errors * np.log(ratio) <= (with_all.errors - without.errors) * np.log(with_all.errors)


def quick_minimum(criterion: OutputError, starts: Sequence[FloatArray], steps: int, unfinished: float) -> Minimum:
    """A low minimum in few steps, for one of many structures: from the best start, at delays in the intervals around.

    Args:
        criterion: The sum of squares.
        starts: Parameters (p,) each.
        steps: Limit on the steps of each search.
        unfinished: Decrease of -2 log likelihood at which a search ends.

    Raises:
        SysidError: No start is stable.
    """
    tolerance = unfinished / sum(criterion.usable())
    screened = []
    for start in starts:
        at = criterion(start)
        if at is not None:
            screened.append(criterion.minimum(at, SCREENING_STEPS, tolerance))
    if not screened:
        raise SysidError("no initial estimate is stable: try fewer poles, or other delays")
    best = criterion.minimum(min(screened, key=_cost).at, steps, tolerance)
    for k in criterion.delays():
        best = _nearby(criterion, best, k, steps, tolerance)
    return best


def _nearby(criterion: OutputError, best: Minimum, k: int, steps: int, tolerance: float) -> Minimum:
    """A minimum, or a lower one with the delay of parameter k in one of the sampling intervals around."""
    dt = criterion.experiments[0].dt
    cell = math.ceil(best.at.theta[k] / dt - TIGHT)
    for direction in (-1, 1):
        for hop in range(1, HOPS + 1):
            at = _at_delay(criterion, best.at.theta, k, (cell + direction * hop - 0.5) * dt)
            if at is None or not _promises(criterion, at, best.at.cost):
                break
            hopped = criterion.minimum(at, SCREENING_STEPS, tolerance)
            # delay and lags change places slowly: as far as the errors fall
            if hopped.at.cost >= best.at.cost:
                break
            best = hopped
    return criterion.minimum(best.at, steps, tolerance)


def _promises(criterion: OutputError, at: Linearisation, cost: float) -> bool:
    """Whether the linear model at some parameters leads below a cost."""
    _, decrease = LinearModel.at(at, criterion.outward).step(0.0)
    return at.cost - decrease < cost


def _with_short_delays(criterion: OutputError, fit: OutputFit, max_iterations: int) -> OutputFit:
    """The fit with the samples that count where delays are not much longer than they are."""
    theta, delays = fit.minimum.at.theta, criterion.delays()
    dt = criterion.experiments[0].dt
    reach = float(theta[delays].max()) + REACH * dt
    shorter = replace(criterion, longest=min(reach, criterion.longest))
    at = shorter(theta)
    if at is None:
        return replace(fit, criterion=shorter)
    minimum = shorter.minimum(at, max_iterations)
    at_limit = (minimum.at.theta[delays] >= shorter.longest - TIGHT * dt).any()
    if at_limit and shorter.longest < criterion.longest:
        # the limit is none of the caller's: the minimum of fewer samples stays
        return fit
    return replace(fit, criterion=shorter, minimum=minimum)


def _with_smaller_models(criterion: OutputError, max_iterations: int, further: Sequence[FloatArray] = ()) -> OutputFit:
    """The lowest minimum, never above that of a smaller model."""
    starts = [*_starts(criterion), *further]
    best = _hopped(criterion, _polished(criterion, starts, max_iterations), max_iterations)
    return OutputFit(criterion, _not_above_smaller(criterion, best, max_iterations), len(starts))


def _not_above_smaller(criterion: OutputError, best: Minimum, max_iterations: int) -> Minimum:
    """A minimum, or one that is reached from the answer of the next smaller model if that is lower."""
    smaller_structures = [structure.smaller() or structure for structure in criterion.structures]
    # a smaller model need not hold the values that are known
    if criterion.known or smaller_structures == list(criterion.structures):
        return best
    contained = replace(criterion, structures=smaller_structures)
    try:
        smaller = _polished(contained, _starts(contained), max_iterations)
    except SysidError:
        # no start of the smaller model is stable
        return best
    smaller = _not_above_smaller(contained, smaller, max_iterations)
    if smaller.at.cost >= best.at.cost:
        return best
    dt = criterion.experiments[0].dt
    pairs = zip(criterion.structures, contained.transfers(smaller.at.theta), strict=True)
    theta = np.concatenate([enlarged(structure, path, dt) for structure, path in pairs])
    at = criterion(theta)
    if at is None:
        return best
    larger = criterion.minimum(at, max_iterations)
    return min(best, _hopped(criterion, larger, max_iterations), key=_cost)


def _polished(criterion: OutputError, starts: Sequence[FloatArray], max_iterations: int) -> Minimum:
    """The lowest minimum from initial estimates, each screened by a few steps."""
    screened = []
    for start in starts:
        at = criterion(start)
        if at is not None:
            screened.append(criterion.minimum(at, 2 * SCREENING_STEPS))
    if not screened:
        raise SysidError("no initial estimate is stable: try fewer poles, or other delays")
    screened.sort(key=_cost)
    # the best after a few steps is not always the best in the end
    finished = [criterion.minimum(minimum.at, max_iterations) for minimum in screened[:POLISHED]]
    return min(finished, key=_cost)


def _starts(criterion: OutputError) -> list[FloatArray]:
    """Initial estimates, of held inputs from rest too."""
    structures, longest, offset = criterion.structures, criterion.longest, criterion.offset
    first = [criterion.first(e) for e in criterion.experiments]
    if not criterion.held:
        return initial_estimates(criterion.experiments, structures, first, longest, free=criterion.free, offset=offset)
    # the response to a first value that stays is a constant, which the estimates may have in place of it
    offset = offset or any(e.u[0].any() for e in criterion.experiments)
    moving = [e.subtract(u=e.u[0]) for e in criterion.experiments]
    from_rest = initial_estimates(moving, structures, first, longest, free=False, offset=offset)
    return from_rest + initial_estimates(moving, structures, first, longest, free=True, offset=offset)


def _hopped(criterion: OutputError, best: Minimum, max_iterations: int) -> Minimum:
    """The lowest minimum reached from the middles of sampling intervals around each delay.

    A held input makes kinks at delays of whole samples, and often a minimum in each interval between them.
    """
    dt = criterion.experiments[0].dt
    for k in criterion.delays():
        tried: set[float] = set()
        while True:
            cell = math.ceil(best.at.theta[k] / dt - TIGHT)
            middles = {(cell + hop - 0.5) * dt for hop in (-2, -1, 0, 1, 2)} - tried
            tried |= middles
            cost_before = best.at.cost
            for middle in sorted(middles):
                at = _at_delay(criterion, best.at.theta, k, middle)
                if at is not None:
                    candidate = criterion.minimum(at, max_iterations)
                    best = min(best, candidate, key=_cost)
            if best.at.cost >= cost_before:
                break
    return best


def _at_delay(criterion: OutputError, theta: FloatArray, k: int, delay: float) -> Linearisation | None:
    """The criterion with another delay as parameter k; None beyond the limits."""
    if not 0.0 < delay < criterion.longest:
        return None
    moved = theta.copy()
    moved[k] = delay
    return criterion(moved)


def _cost(minimum: Minimum) -> float:
    return minimum.at.cost
