"""Choice of orders: the thesis' search as an algorithm, and output-error models with more poles than it takes.

The thesis varies orders by hand, tests residuals, stability and the fit to other data sets, and prefers the simplest
structure that passes [Morris1996, sec. IV.3A]. Here a step adds a pole; within a step zeros and, while the model is
small, delays are varied. A structure passes when it is stable, its residuals are independent of the input and, where it
has a model of the disturbance, white (an output-error model has none: the thesis accepts its coloured residuals). The
search ends at the first step that passes and that the next does not improve on in cross-validation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.signal import lfilter

import sysid
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.thesis.campaign import ESTIMATION_TEST, OTHER_WAVEFORMS
from scenarios.thesis.estimates import estimate, simulation_fit
from scenarios.thesis.steps import NO_REPORT, Part
from sysid import IOData, SysidError
from sysid.validation import StructureTable

POLES = (1, 2, 3, 4, 5)
"""Steps of the search: numbers of poles. The thesis' largest has five."""

DELAYS = (1, 2, 3)
"""Delays tried, samples, while there are no more than `DELAYS_UP_TO` poles; then the best of them stays."""

DELAYS_UP_TO = 2

FEWER_ZEROS = 2
"""Differences between the number of poles and of numerator coefficients."""

IMPROVES = 0.1
"""Least gain of the median fit to other data sets that justifies another step, percentage points."""

MINUTE = 60.0
"""Length of every other data set that is simulated, s: they repeat every two seconds."""

ARX_GRID = (range(1, 7), range(1, 5), range(1, 5))
"""na, nb, nk that `selstruc` ranks."""


@dataclass(frozen=True)
class Iteration:
    """One structure of the search, with its fits and tests.

    Orders are na, nb, nc, nk of ARMAX or nb, nf, nk of OE; zeros at the origin do not count; the delay is in samples,
    the radius that of the farthest pole. `outside` counts the lags out of 25 at which the autocorrelation is outside
    its 99 % bounds; `held_out` is the median fit in simulation to the other data sets, percent; the reason says why
    none could be identified.
    """

    orders: tuple[int, ...]
    poles: int
    zeros: int
    delay: int
    radius: float = np.nan
    whiteness_p: float = np.nan
    independence_p: float = np.nan
    outside: int = 0
    held_out: float = -np.inf
    passes: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Search:
    """The iterations of one kind of structure on one joint.

    Attributes:
        method: `armax` or `oe`.
        iterations: Every structure tried, in sequence.
        chosen: The accepted one; where none passes, the simplest that cross-validation finds no better than `IMPROVES`
            below its best.
        thesis: Orders of the thesis.
    """

    method: str
    iterations: tuple[Iteration, ...]
    chosen: Iteration
    thesis: tuple[int, ...]

    @property
    def own(self) -> Iteration | None:
        """The iteration with the thesis' poles, zeros and delay; None where the search ended before it."""
        # The order of C does not count: an iteration has as many coefficients of C as of A.
        thesis_orders = (*self.thesis[:2], self.thesis[-1])
        for iteration in self.iterations:
            if (*iteration.orders[:2], iteration.delay) == thesis_orders:
                return iteration
        return None


@dataclass(frozen=True)
class Searches:
    """Choices of the searches for one joint.

    Attributes:
        armax: The iterations of ARMAX.
        oe: Those of OE.
        arx: Every ARX structure of a grid with its criteria, validated on the other data sets.
    """

    armax: Search
    oe: Search
    arx: StructureTable


def search_orders(joint: str, data: Mapping[int, IOData], part: Part = NO_REPORT) -> Searches:
    """Search for the orders of a joint on its records by test; `SysidError` without others to judge on or any model."""
    held_out = []
    for test in OTHER_WAVEFORMS:
        if test in data:
            # Every structure is simulated on all of them.
            held_out.append(data[test][: round(MINUTE / data[test].dt)])
    if not held_out:
        raise SysidError("a search for orders needs other data sets to judge on, got none")
    table = sysid.selstruc(data[ESTIMATION_TEST], *ARX_GRID, validation=held_out)
    structures = [structure for structure in STRUCTURES[joint] if structure.method in ("armax", "oe")]
    searches = []
    for structure, share in part.split(structures):
        searches.append(search(structure.method, data[ESTIMATION_TEST], held_out, structure.orders, share))
    armax, oe = searches
    return Searches(armax, oe, table)


def search(
    method: str, data: IOData, held_out: Sequence[IOData], thesis: tuple[int, ...], part: Part = NO_REPORT
) -> Search:
    """Try structures of ARMAX or OE until other data sets gain nothing more, and choose one; `SysidError` if none."""
    iterations: list[Iteration] = []
    best_of_steps: list[Iteration] = []
    delays: tuple[int, ...] = DELAYS
    for poles, share in part.split(POLES):
        # Fewer zeros than poles; the delay is varied apart from them.
        structures = list(product(range(max(poles - 1 - FEWER_ZEROS, 0), poles), delays))
        step = []
        for (zeros, delay), _ in share.split(structures):
            step.append(_iteration(method, poles, zeros, delay, data, held_out))
        iterations += step
        # A structure that passes is preferred to any that does not, however well it fits.
        best_of_steps.append(max(step, key=lambda iteration: (iteration.passes, iteration.held_out)))
        if poles >= DELAYS_UP_TO:
            # The delay belongs to the arm, not to the model's size: once found it need not be varied again.
            delays = (max(iterations, key=lambda iteration: iteration.held_out).delay,)
        if len(best_of_steps) > 1:
            before, latest = best_of_steps[-2:]
            if before.passes and latest.held_out < before.held_out + IMPROVES:
                return Search(method, tuple(iterations), before, thesis)
    chosen = best_of_steps[-1] if best_of_steps[-1].passes else _simplest_of_the_best(method, iterations)
    return Search(method, tuple(iterations), chosen, thesis)


def _simplest_of_the_best(method: str, iterations: Sequence[Iteration]) -> Iteration:
    """The structure with the fewest poles and zeros whose fit to other data sets is within `IMPROVES` of the best."""
    best_fit = max(iteration.held_out for iteration in iterations)
    if not np.isfinite(best_fit):
        raise SysidError(f"no {method} structure could be identified: {iterations[0].reason}")
    near = [iteration for iteration in iterations if iteration.held_out >= best_fit - IMPROVES]
    return min(near, key=lambda iteration: iteration.poles + iteration.zeros)


def _iteration(method: str, poles: int, zeros: int, delay: int, data: IOData, held_out: Sequence[IOData]) -> Iteration:
    """Identify one structure, test its residuals and compare it with the other data sets."""
    # B has one coefficient more than zeros; C has as many as A.
    orders = (poles, zeros + 1, poles, delay) if method == "armax" else (zeros + 1, poles, delay)
    iteration = Iteration(orders, poles, zeros, delay)
    try:
        model = estimate(data, method, orders)
        test = sysid.resid(model, data)
    except SysidError as error:
        return replace(iteration, reason=str(error))
    radius = float(np.abs(model.poles()).max())
    stable = radius < 1.0
    white, independent = bool(test.white[0]), bool(test.independent[0, 0])
    # The simulation of an unstable model diverges: its fit says nothing.
    fit = simulation_fit(model, held_out) if stable else -np.inf
    return replace(
        iteration,
        radius=radius,
        whiteness_p=float(test.whiteness_p[0]),
        independence_p=float(test.independence_p[0, 0]),
        outside=int(test.outside_whiteness[0]),
        held_out=fit,
        # An output-error model has no model of the disturbance to whiten it with.
        passes=stable and independent and (white or method == "oe"),
    )


ORDERS = ((2, 2), (2, 3), (3, 3), (2, 4), (4, 4), (2, 5), (5, 5), (2, 6), (6, 6))
"""nb, nf of output-error models: the orders of the thesis, more poles with its one zero, as many coefficients of B as
of F."""

EDGE = 1.0 - 1e-4
"""Stable models with a pole beyond this modulus are limited by the stability bound: the estimator warns there too."""

ROUNDS = 20
"""Rounds of repeated least squares at most."""

SETTLED = 1e-3
"""Change of the denominator, as a part of it, that ends them."""


@dataclass(frozen=True)
class MorePoles:
    """One structure.

    Attributes:
        orders: nb, nf, nk.
        radius: Largest modulus of a pole of the best stable model.
        free_radius: Largest modulus of a pole in the last round of repeated least squares without projection
            [SteiglitzMcBride1965]; a round that is unstable ends them.
        rounds: Rounds taken, the first being plain least squares (ARX).
        settled: Whether they came to rest.
    """

    orders: tuple[int, int, int]
    radius: float
    free_radius: float
    rounds: int
    settled: bool

    @property
    def barred(self) -> bool:
        """Whether the best stable model lies at the edge of stability."""
        return self.radius > EDGE

    @property
    def unstable(self) -> bool:
        """Whether one of the two estimates reaches the edge of stability."""
        return self.barred or self.free_radius >= 1.0


def more_poles(data: IOData, nk: int) -> tuple[MorePoles, ...]:
    """Identify an output-error model of each of `ORDERS` with a delay of nk samples, stable and left free."""
    models = []
    for nb, nf in ORDERS:
        radius = float(np.abs(estimate(data, "oe", (nb, nf, nk)).poles()).max())
        models.append(MorePoles((nb, nf, nk), radius, *_repeated_least_squares(data, nb, nf, nk)))
    return tuple(models)


def _repeated_least_squares(data: IOData, nb: int, nf: int, nk: int) -> tuple[float, int, bool]:
    """Largest modulus of a pole, rounds and whether they settled.

    Each round fits F y/F' = B u/F' by least squares, with F' the F of the round before, not projected onto stable
    polynomials [SteiglitzMcBride1965].
    """
    # The first round filters nothing: plain least squares.
    f = np.ones(1)
    radius = 0.0
    for iteration in range(1, ROUNDS + 1):
        u, y = (lfilter([1.0], f, channel[:, 0]) for channel in (data.u, data.y))
        polynomials = sysid.arx(IOData(u, y, data.dt), nf, nb, nk).polynomials
        assert polynomials is not None  # noqa: S101 - ARX has them
        before, f = f, polynomials.A
        radius = float(np.abs(np.roots(f)).max())
        # An unstable F cannot filter the next round: its outputs grow without bound.
        if radius >= 1.0:
            return radius, iteration, False
        # After the first round there is no denominator of the same order to compare with.
        if len(before) == len(f) and np.abs(f - before).max() <= SETTLED * np.abs(f).max():
            return radius, iteration, True
    return radius, ROUNDS, False
