"""Search for the structure, delay and orders of a model by a criterion, each candidate fitted in a few steps."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice
from typing import Any, TypeVar

import numpy as np

from sysid.models.estimate import mean_square
from sysid.models.polynomials import Polynomials, innovations_form, stabilised
from sysid.models.predict import predict
from sysid.models.state_space import StateSpace
from sysid.polynomial.arx import arx
from sysid.polynomial.error_jacobian import free_transients, jacobian_of_record, orthonormal
from sysid.polynomial.initial_conditions import InitialConditions
from sysid.polynomial.initial_estimates import (
    armax_initial_estimates,
    bj_initial_estimates,
    check_room_to_start,
    fill_gaps,
    oe_initial_estimates,
)
from sysid.polynomial.orders import NO_TREND, Orders
from sysid.polynomial.polynomial_estimate import check_enough_data, directions, trends_of_outputs
from sysid.polynomial.prediction_error import InitialEstimate, Linearisation, Minimum, minimise, search
from sysid.polynomial.trends import LINE, OFFSET, Levelled, level
from sysid.polynomial.weighted_output_errors import UNWEIGHTED
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, complete_parts
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.resolution import resolution
from sysid.selection.slow_modes import least_drive, slow_poles, slow_radius
from sysid.subspace import n4sid, pem_ss
from sysid.validation.structure_scan import Order, parameter_count

Experiments = tuple[IOData, ...]
Rung = TypeVar("Rung")

PATIENCE = 2  # orders in a row that are tried beyond the best of a structure

FAR = 100.0  # BIC above the best from which on a structure does not climb again from the shortest delays
LOW, PLAINEST = 3, "oe"  # orders of the method that climbs from the shortest delays in any case
NEAR = 30.0  # BIC above the best up to which a family is refined: some five superfluous parameters
REFINED = 8  # rounds of changes of single orders, at most
STEPS = 15  # iterations of a candidate, at most: those that are far too large take the most, and are not chosen
FURTHER_STEPS = 60  # iterations by which the search of one of the best candidates is continued, at most
FINISHED = 8  # best candidates whose search is continued, at most
UNTOLD = 0.02  # decrease of the criterion that a candidate may still have before it
STARTS = 2  # initial estimates of its own that a candidate may have, beside the nearest fits
FILLING = 4  # orders on which the length of the ARX model that fills gaps depends
FINER = 1e-3  # loss, relative to the variance of rounding, that no rounded record has
ROUNDED = 1.2  # variance of errors, relative to that of rounding, up to which nothing but rounding shows in them
EXACT_ORDER = 8  # of an ARX model that shows whether a record is rounded
EXACT = 1e-20  # loss, relative to the mean square output, that is rounding of data without noise

SILENT = "its disturbance has no power at some frequency: a root of C lies on the unit circle"
"""Doubt about an ARMAX model. Estimates of C have such roots often without reason, the shorter the record the more so
[SarganBhargava1983]; its path from the input shares the poles with that disturbance and suffers."""

ON_CIRCLE = 1e-4
"""Largest distance from the unit circle at which a root of C counts as lying on it."""

CANCELS = 1e-2
"""Distance of a pole from such a root up to which they cancel, as those of an integrator measured in white noise."""

LIMIT = 1.0 - 1e-6
"""Radius at which roots of starts are kept; roots of the input path beyond it are at the edge of stability."""

DRIVEN = 30.0
"""Evidence from which on a slow mode counts as driven by the input: that of a parameter worth 30 in BIC, far beyond
what the best of a hundred candidates reaches by chance."""

SLOW = 100.0
"""BIC by which a candidate with slow modes must be better than any without: models of the noise come within some tens
of one that follows a disturbance, and nowhere near a plant that integrates."""

FAR_LEVEL = 3.0
"""Distance of a constant in the output from the mean of its record, relative to the range of that, that is no level."""

BESIDE_ONE = 1.5
"""Distance of a slow pole from 1, relative to the largest of a real one, up to which it creeps."""

HARDLY_TOLD = 6.0
"""BIC above the best up to which the evidence against a candidate is positive and no more [KassRaftery1995]."""

DEVIATIONS = 4.0  # of the modulus of a pole outside the unit circle, from which on a plant counts as unstable

TREND_WORDS: Mapping[int, str] = {NO_TREND: "", OFFSET: " offset", LINE: " trend"}
"""Trends of candidates, as their text shows them."""

ORDERS: Mapping[str, tuple[str, ...]] = {
    "arx": ("na", "nb", "nk"),
    "oe": ("nb", "nf", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
}
"""Structures of one output with their orders, the simpler first."""

CONTINUED = 2  # best candidates of a family on parts of a long record that are fitted to all of it

FAMILIES = (("arx", "armax"), ("oe", "bj"))  # structures that pass into one another when single orders change

DISTURBANCE = 2
"""Orders of C and D in rising Box-Jenkins models: a resonance, which single steps from fewer poles do not reach."""


@dataclass(frozen=True)
class Candidate:
    """A structure with its orders, and how it fits.

    Attributes:
        method: Name of the estimator.
        orders: Its orders by name.
        parameters: Number of parameters.
        loss: Mean square of the one-step errors on the samples that all candidates share; with several outputs the
            ny-th root of the determinant of their covariance.
        bic: N log det(R) + p log(N) [Schwarz1978]: a difference of 10 is strong evidence
            [KassRaftery1995].
        validation: Mean square error of the simulated validation outputs, each over its variance; NaN without such
            data.
        radius: Largest modulus of the poles from input to output.
        drive: Least evidence that the input drives its slow modes, see `least_drive`; infinite where there are none.
        excess: Distance of the outermost pole beyond the unit circle, in its standard deviations; negative inside.
        transients: Parameters that its initial states are worth on the samples that are compared.
        trend: Degree of the trend of the output in it, see `Orders`.
        vague_offset: Whether its constant lies far outside the record: beside a slow mode it is a straight line, and no
            level.
        creeps: Whether it has slow modes, all with poles beside 1: they change the gain at 0 Hz, others oscillate.
        doubt: Another reason why it may not be chosen, in words; empty if there is none.
        weighting: Of oe the degrees of C and D of the model of the disturbance that weights its errors.
    """

    method: str
    orders: Mapping[str, Order]
    parameters: int
    loss: float
    bic: float
    validation: float
    radius: float
    drive: float = np.inf
    excess: float = -np.inf
    transients: float = 0.0
    trend: int = NO_TREND
    vague_offset: bool = False
    creeps: bool = False
    doubt: str = ""
    weighting: tuple[int, int] = UNWEIGHTED

    def __str__(self) -> str:
        """Method and orders."""
        orders = " ".join(f"{name}={order}" for name, order in self.orders.items())
        weighting = "" if self.weighting == UNWEIGHTED else f" weighting={self.weighting[0]},{self.weighting[1]}"
        return f"{self.method} {orders}{TREND_WORDS[self.trend]}{weighting}"

    @property
    def ebic(self) -> float:
        """`bic`, by the name that it had: the extended BIC of gamma = 0."""
        return self.bic

    @property
    def trend_options(self) -> dict[str, bool]:
        """Options of the estimator for the trend; none where it needs none."""
        options = {OFFSET: {"offset": True}, LINE: {"trend": True}}
        return options.get(self.trend, {})

    @property
    def remark(self) -> str:
        """Whether the model is unstable or nearly so, and whether the input drives its slow modes; empty if not."""
        if self.doubt:
            return self.doubt
        if self.vague_offset:
            return "a constant far outside the record: it stands for a drift"
        if not self.drive >= DRIVEN:
            return "follows a disturbance by a slow mode"
        if self.radius >= 1.0:
            return "unstable"
        return "edge of stability" if self.radius > LIMIT else ""

    @property
    def reservation(self) -> str:
        """Why it may make way for one with a larger BIC, in words; empty if it does not."""
        if self.doubt or self.vague_offset or not self.eligible:
            return self.remark
        if np.isfinite(self.drive):
            return "a mode slower than a third of the record may be a disturbance; a longer record would tell"
        return ""

    @property
    def eligible(self) -> bool:
        """Whether it may be chosen: its slow modes are driven by the input, and it is stable or surely unstable."""
        if self.doubt:
            return False
        return self.drive >= DRIVEN and (self.radius < 1.0 or self.excess > DEVIATIONS)


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a candidate with one output.

    Attributes:
        orders: Layout of the parameters.
        theta: The parameters (p,).
        candidate: How they fit.
        is_finished: Whether their search came to its end.
    """

    orders: Orders
    theta: FloatArray
    candidate: Candidate
    is_finished: bool = True


class StructureSearch:
    """Candidates fitted so far, all judged on the same samples.

    Attributes:
        experiments: Records to fit.
        validation: Records whose simulation decides; empty: the BIC decides.
        largest: Largest order tried.
        methods: Structures tried, of one output.
        candidates: Candidates so far, in the sequence of their fits.
        fits: Those of one output by their orders.
        refines: Whether single orders of the best candidates change too. Beside a nonlinearity no structure is the
            right one, and what such changes gain describes it one step ahead.
        failed: What could not be fitted, and why.
        exact: Whether a candidate fits but for rounding.
        direct: Whether state-space models have a direct term.
        samples: Samples on which all are compared.
        trends: Degrees of trends of the output that are tried, the first at the beginning.
    """

    def __init__(
        self,
        experiments: Experiments,
        validation: Experiments,
        largest: int,
        methods: Sequence[str],
        trends: Sequence[int] = (NO_TREND,),
        *,
        refines: bool = True,
    ) -> None:
        self.experiments, self.validation = experiments, validation
        self.trends = trends
        self.largest, self.methods = largest, methods
        self.refines = refines
        self.candidates: list[Candidate] = []
        self.fits: dict[Orders, Fit] = {}
        self.failed: list[str] = []
        self.exact = False
        self.direct = True
        self._output_power = mean_square(np.concatenate([e.y[e.known.all(axis=1)] for e in experiments]))
        self._floor = _variance_of_rounding(experiments)
        self._for_starts: dict[int, Experiments] = {}
        self.slow_radius = slow_radius(max(map(len, experiments)))
        # longest initial transient of all candidates
        transient = 2 * largest
        self._skipped = [min(max(e.window, transient), len(e) // 2) for e in experiments]
        self.samples = 0
        for experiment, skipped in zip(experiments, self._skipped, strict=True):
            self.samples += int(np.count_nonzero(experiment.known[skipped:].all(axis=1)))

    def anew(self, experiments: Experiments) -> "StructureSearch":
        """A search for the same on other experiments, or from the beginning on the same ones."""
        return StructureSearch(
            experiments, self.validation, self.largest, self.methods, self.trends, refines=self.refines
        )

    def climb_structures(self, delays: tuple[int, ...], shortest: tuple[int, ...], *, is_far: bool = False) -> None:
        """Try rising orders of every structure from two sets of delays, then change single orders of the best ones.

        A slow beginning of the response looks like a delay: those that fit well climb from the shortest one too. Behind
        a delay that is far, a record from rest keeps a constant in its output: with that they climb there first.
        """
        first = self.trends[0]
        rungs = [(nk, first) for nk in dict.fromkeys((delays, shortest))]
        if is_far and first != OFFSET and OFFSET in self.trends:
            rungs.insert(0, (delays, OFFSET))
        for nk, trend in rungs:
            limit = min(map(self.criterion, self.candidates), default=np.inf) + FAR
            if is_far:
                # what is far better behind one delay may be far worse behind the other: all methods climb from both
                limit = np.inf
            best_by_method = {name: min(self._criteria([name]), default=limit) for name in ORDERS}
            for name, best in best_by_method.items():
                # a delay that is far too long leaves no method near a true model of low order: that one is tried anyway
                largest = self.largest if best <= limit else LOW
                if name in self.methods and (best <= limit or name == PLAINEST):
                    ladder = [rising_orders(name, n, nk, trend) for n in range(1, largest + 1)]
                    self._climb(ladder, self.try_orders)
        for family in FAMILIES:
            # a direct term only where the data show one: a held input has none
            self._refine(family, tuple(min(delay, 1) for delay in delays))
        self._finish()

    def continue_from(self, other: "StructureSearch", shortest: tuple[int, ...]) -> None:
        """Fit the best candidates of a search on a part of the records, and change their single orders.

        Effects that the part hides in its noise show on the whole record.
        """
        for family in FAMILIES:
            fits = [fit for fit in other.fits.values() if fit.candidate.method in family]
            best = sorted(fits, key=other.criterion_of_fit)[:CONTINUED]
            for fit in best:
                self.try_orders(fit.orders, fit)
            for fit in best[:1]:
                # a pair of poles is no change of a single order
                degree = max(fit.orders.na, *fit.orders.nf)
                for n in range(degree + 1, min(degree + PATIENCE, self.largest) + 1):
                    rising = rising_orders(fit.candidate.method, n, fit.orders.nk, fit.orders.trend)
                    self.try_orders(rising)
        for family in FAMILIES:
            self._refine(family, shortest)

    def keep_input_paths(self) -> None:
        """Replace the candidates by output-error models of their input paths, judged beside the best noise model.

        Alone, an output-error model of a disturbance that the input does not cause gains by superfluous orders: they
        follow it. So the orders of a path are those that a Box-Jenkins model of the same data needs.
        """
        best_of_path: dict[Orders, Candidate] = {}
        for fit in sorted(self.fits.values(), key=self.criterion_of_fit):
            if fit.orders.na == 0:
                path = replace(fit.orders, nc=0, nd=0)
                best_of_path.setdefault(path, fit.candidate)
        candidates = []
        for path, beside_noise in best_of_path.items():
            candidate = self.try_orders(path)
            if candidate is not None:
                candidates.append(replace(candidate, bic=beside_noise.bic))
        self.candidates = candidates

    def climb_states(self, delays: tuple[int, ...] = ()) -> None:
        """Try rising orders of a state-space model, with known delays of the inputs in samples and without.

        Without them every sample of delay is a state more; a slow beginning of the response looks like a delay.
        """
        none = (0,) * self.experiments[0].nu
        for nk in dict.fromkeys((delays or none, none)):
            if self.exact:
                break
            exact_order = self._exact_order(nk)
            ladder = range(1, self.largest + 1)
            if exact_order is not None:
                # without noise every step of the search shows lower errors: too small orders take all that are allowed
                ladder = range(max(exact_order - 1, 1), exact_order + 1)
            self._climb(ladder, partial(self._try_states, nk=nk))

    def _exact_order(self, nk: tuple[int, ...]) -> int | None:
        """The least order with errors at rounding level, which `n4sid` finds without a search; None on noisy data."""
        if self._subspace_loss(self.largest, nk) > self._rounding:
            return None
        for order in range(1, self.largest):
            if self._subspace_loss(order, nk) <= self._rounding:
                return order
        return self.largest

    def _subspace_loss(self, order: int, nk: tuple[int, ...]) -> float:
        """Loss of an `n4sid` with delays; infinite if there is none."""
        try:
            estimate = n4sid(complete_parts(self.experiments), order, nk=nk, direct=self.direct)
        except SysidError:
            return np.inf
        return estimate.loss

    @property
    def _rounding(self) -> float:
        """Loss below which rounding decides: its logarithm would outweigh any number of parameters."""
        return max(EXACT * self._output_power, np.finfo(float).tiny)

    def _climb(self, ladder: Iterable[Rung], attempt: Callable[[Rung], Candidate | None]) -> None:
        """Raise the order until `PATIENCE` in a row are no better than the best."""
        best_criterion, best_place = np.inf, 0
        for n, rung in enumerate(ladder):
            if self.exact:
                # rounding alone would choose among the rest
                break
            criterion = self.criterion(attempt(rung))
            if criterion < best_criterion:
                best_criterion, best_place = criterion, n
            # while nothing could be fitted or is stable, a larger order may
            if n - best_place >= PATIENCE and np.isfinite(best_criterion):
                break

    def _refine(self, family: Sequence[str], shortest: Sequence[int]) -> None:
        """Change single orders of the best candidate of a family, if near the best of all, as long as that helps."""
        if not self.refines:
            return
        fits = [fit for fit in self.fits.values() if fit.candidate.method in family]
        best_of_all = min(self._criteria(ORDERS), default=np.inf)
        if not fits or min(self._criteria(family), default=np.inf) > best_of_all + NEAR:
            return
        best = min(fits, key=self.criterion_of_fit)
        names = set(chain.from_iterable(ORDERS[method] for method in family if method in self.methods))
        if len(self.trends) > 1:
            names.add("trend")
        for _ in range(REFINED):
            neighbours = []
            for orders in _neighbours(best.orders, names):
                allowed = _structure_of(orders, self.methods) in self.methods and orders.trend in self.trends
                if allowed and np.all(np.greater_equal(orders.nk, shortest)):
                    neighbours.append(orders)
            for orders in neighbours:
                self.try_orders(orders, best)
            fitted = [self.fits[orders] for orders in neighbours if orders in self.fits]
            better = min(fitted, key=self.criterion_of_fit, default=best)
            if self.criterion_of_fit(better) >= self.criterion_of_fit(best):
                break
            best = better

    def _try_states(self, order: int, nk: tuple[int, ...]) -> Candidate | None:
        try:
            start = n4sid(complete_parts(self.experiments), order, nk=nk, direct=self.direct)
            # further starts, of all candidates, would take most of the time of the choice
            estimate = pem_ss(self.experiments, start, direct=self.direct, search=False, max_iterations=2 * STEPS)
        except SysidError as error:
            self.failed.append(f"order {order}: {error}")
            return None
        ends = np.cumsum([len(e) for e in self.experiments])[:-1]
        errors = np.split(estimate.residuals, ends)
        path = estimate.model.input_path()
        orders: dict[str, Order] = {"order": order}
        if any(nk):
            orders["nk"] = nk
        return self._record_candidate("pem_ss", orders, parameter_count(estimate), errors, path)

    def try_orders(self, orders: Orders, base: Fit | None = None) -> Candidate | None:
        """Fit a candidate in few steps, unless that was done before; None if it cannot be fitted."""
        if orders in self.fits:
            return self.fits[orders].candidate
        try:
            check_enough_data(self.experiments, orders, max(orders.nc, orders.nd) + sum(orders.nf))
            check_room_to_start(self.experiments, orders)
            minimum = search(
                self.experiments,
                lambda structure: self._initial_estimates(structure, base),
                orders,
                smaller_too=False,
                thorough=False,
                max_iterations=STEPS,
                tolerance=UNTOLD / self.samples,
            ).best
        except SysidError as error:
            self.failed.append(f"{orders}: {error}")
            return None
        return self._record_fit(orders, minimum)

    def _record_fit(self, orders: Orders, minimum: Minimum) -> Candidate:
        """Record where the search of a candidate ended."""
        at = minimum.at
        theta = at.theta
        method = _structure_of(orders, self.methods)
        errors, levels = zip(*(_errors_and_trend(e, orders, theta) for e in self.experiments), strict=True)
        model = self._input_path(orders, theta)
        transients = sum(
            _compared_transients(orders, theta, len(e), skipped)
            for e, skipped in zip(self.experiments, self._skipped, strict=True)
        )
        candidate = self._record_candidate(
            method,
            orders.select(*ORDERS[method]),
            orders.count,
            errors,
            model,
            drive=least_drive(at, orders, errors, self.slow_radius),
            excess=_excess(at, orders),
            transients=transients,
            trend=orders.trend,
            vague_offset=orders.trend == OFFSET and self._lie_far(levels),
            creeps=self._creeps(orders, theta),
            doubt=SILENT if _is_silent_somewhere(orders, theta) else "",
        )
        self.fits[orders] = Fit(orders, theta, candidate, is_finished=minimum.converged)
        return candidate

    def _finish(self) -> None:
        """Continue the searches of the best candidates that ended by their limit of steps.

        They decide: poles that move slowly towards the unit circle, beside zeros there, follow a disturbance, which the
        end of a search alone shows, and a model of the disturbance with such poles is better than it seems before.
        """
        if not self.refines:
            return
        for _ in range(FINISHED):
            fits = sorted(self.fits.values(), key=self.criterion_of_fit)
            limit = self.criterion_of_fit(fits[0]) + FAR if fits else np.inf
            unfinished = [fit for fit in fits if not fit.is_finished and self.criterion_of_fit(fit) <= limit]
            if not unfinished or self.exact:
                return
            fit = unfinished[0]
            minimum = minimise(
                self.experiments,
                fit.orders,
                fit.theta,
                max_iterations=FURTHER_STEPS,
                tolerance=UNTOLD / self.samples,
            )
            self.candidates = [candidate for candidate in self.candidates if candidate is not fit.candidate]
            self._record_fit(fit.orders, minimum)
            # no search is continued twice
            self.fits[fit.orders] = replace(self.fits[fit.orders], is_finished=True)

    def _initial_estimates(self, orders: Orders, base: Fit | None) -> Iterator[InitialEstimate]:
        """The best smaller fit, the base of the change, and without a base some that do not depend on earlier fits."""
        smaller = [fit for fit in self.fits.values() if _is_nested(fit.orders, orders)]
        if smaller:
            best_smaller = min(smaller, key=lambda fit: fit.candidate.loss)
            yield InitialEstimate("smaller", _resized_parameters(best_smaller, orders))
        if base is not None:
            yield InitialEstimate("base", _resized_parameters(base, orders))
            return
        yield from islice(_independent_starts(self._records_for_starts(orders.trend), orders), STARTS)

    def _records_for_starts(self, trend: int) -> Experiments:
        """Complete records without trends of this degree: initial estimates know neither gaps nor trends."""
        if trend not in self._for_starts:
            experiments, nu = self.experiments, self.experiments[0].nu
            filling = Orders(FILLING, (FILLING,) * nu, 0, 0, (0,) * nu, (1,) * nu, trend)
            if trend != NO_TREND:
                experiments = level(experiments, trend).experiments
            self._for_starts[trend] = fill_gaps(experiments, filling)
        return self._for_starts[trend]

    def _record_candidate(
        self,
        method: str,
        orders: Mapping[str, Order],
        count: int,
        errors: Sequence[FloatArray],
        path: StateSpace,
        *,
        drive: float = np.inf,
        excess: float = -np.inf,
        transients: float = 0.0,
        trend: int = NO_TREND,
        vague_offset: bool = False,
        creeps: bool = False,
        doubt: str = "",
    ) -> Candidate:
        """Record a candidate with its criteria, from its one-step errors (N_i, ny) and the model of its input path."""
        compared = np.concatenate([e[skipped:] for e, skipped in zip(errors, self._skipped, strict=True)])
        loss = mean_square(compared[np.isfinite(compared).all(axis=1)])
        rounding = self._rounding
        self.exact = self.exact or loss <= rounding
        likelihood = self.samples * compared.shape[1] * np.log(max(loss, rounding, self._floor))
        counted = self._counted(count, transients, trend)
        bic = float(likelihood + counted * np.log(self.samples))
        radius = float(np.abs(path.poles()).max(initial=0.0))
        error = self._validation_error(path)
        candidate = Candidate(
            method,
            orders,
            count,
            loss,
            bic,
            error,
            radius,
            drive,
            excess,
            transients,
            trend,
            vague_offset=vague_offset,
            creeps=creeps,
            doubt=doubt,
        )
        self.candidates.append(candidate)
        return candidate

    def _creeps(self, orders: Orders, theta: FloatArray) -> bool:
        """Whether its slow poles lie beside 1: elsewhere on the circle one oscillates, and follows a disturbance."""
        reach = BESIDE_ONE * (1.0 - self.slow_radius)
        poles = slow_poles(orders, theta, self.slow_radius)
        return bool(poles) and all(abs(pole - 1.0) < reach for _, pole in poles)

    def _lie_far(self, levels: Sequence[FloatArray]) -> bool:
        """Whether a constant of an output (1,) lies far outside its record."""
        for experiment, constant in zip(self.experiments, levels, strict=True):
            known = experiment.y[experiment.known[:, 0], 0]
            if abs(constant[0] - known.mean()) > FAR_LEVEL * float(np.ptp(known)):
                return True
        return False

    def _validation_error(self, path: StateSpace) -> float:
        """Mean square error of the simulated validation outputs, each over its variance; NaN without such data."""
        if not self.validation:
            return np.nan
        errors = []
        for record in self.validation:
            relative = (record.y - predict(path, record, steps=None)) / np.nanstd(record.y, axis=0)
            errors.append(relative[record.window :])
        return float(np.nanmean(np.concatenate(errors) ** 2))

    def _criteria(self, methods: Iterable[str]) -> list[float]:
        return [self.criterion(candidate) for candidate in self.candidates if candidate.method in methods]

    def bic_behind(self, candidate: Candidate, samples: int) -> float:
        """BIC of a candidate with one output on the errors behind so many samples; infinite where there are none.

        A delay leaves the first errors of a record out: on the others its noise may be smaller.
        """
        fit = self._fit_of(candidate)
        if fit is None:
            return np.inf
        errors = []
        for experiment in self.experiments:
            of_record, _ = _errors_and_trend(experiment, fit.orders, fit.theta)
            errors.append(of_record[samples:])
        joined = np.concatenate(errors)
        joined = joined[np.isfinite(joined)]
        if not len(joined):
            return np.inf
        likelihood = len(joined) * np.log(max(float(np.mean(joined**2)), self._rounding, self._floor))
        counted = self._counted(candidate.parameters, candidate.transients, candidate.trend)
        return float(likelihood + counted * np.log(len(joined)))

    def _counted(self, parameters: int, transients: float, trend: int) -> float:
        """Number of parameters that the criterion counts: with those of initial states and trends."""
        return parameters + transients + (trend + 1) * len(self.experiments)

    def is_rounding(self, candidate: Candidate) -> bool:
        """Whether the errors of a candidate are no larger than the rounding of the outputs, as by an encoder."""
        return candidate.loss <= ROUNDED * self._floor

    def criterion_of_fit(self, fit: Fit) -> float:
        """Criterion of the candidate of a fit."""
        return self.criterion(fit.candidate)

    def criterion(self, candidate: Candidate | None) -> float:
        """Criterion, the less the better: the validation error, else BIC; infinite for what may not be chosen."""
        if candidate is None or not candidate.eligible:
            return np.inf
        if self.validation:
            return candidate.validation
        # it makes way for a straight line in its place, and for nothing else
        handicaps = float(np.isfinite(candidate.drive)) + float(candidate.vague_offset)
        return candidate.bic + SLOW * handicaps

    def disagreement(self, ranked: Sequence[Candidate]) -> tuple[float, float]:
        """Largest ratios of gain and bandwidth between the best candidate and those that are hardly worse.

        The interval of one model is that of its structure. Where another one that the data hardly tell from it says
        something else, the interval says less than it seems [Buckland1997].
        """
        best = ranked[0]
        gains, bandwidths = [], []
        for candidate in ranked:
            model = self.input_path_of(candidate)
            is_near = candidate is best or self.criterion(candidate) < self.criterion(best) + HARDLY_TOLD
            if model is None or not is_near:
                continue
            gains.append(np.abs(model.dc_gain()).ravel())
            bandwidths.append(model.bandwidth().ravel())
        return largest_ratio(gains), largest_ratio(bandwidths)

    def polynomials_of(self, candidate: Candidate) -> Polynomials | None:
        """Model of a candidate with one output as far as the search refined it."""
        fit = self._fit_of(candidate)
        return None if fit is None else fit.orders.polynomials(fit.theta)

    def input_path_of(self, candidate: Candidate) -> StateSpace | None:
        """Path from the input to the output of a candidate as far as the search refined it."""
        fit = self._fit_of(candidate)
        return None if fit is None else self._input_path(fit.orders, fit.theta)

    def input_path_on(self, records: Experiments, candidate: Candidate) -> StateSpace | None:
        """Path from the input to the output of a candidate with one output, refined on other complete records.

        Raises:
            SysidError: The records are too short for it.
        """
        fit = self._fit_of(candidate)
        if fit is None:
            return None
        orders = fit.orders
        samples = check_enough_data(records, orders, max(orders.nc, orders.nd) + sum(orders.nf))
        minimum = minimise(records, orders, fit.theta, tolerance=UNTOLD / samples)
        return self._input_path(orders, minimum.at.theta)

    def without_trends(self, records: Experiments, candidate: Candidate) -> Experiments:
        """Records without the trends of their outputs that a candidate with one output gives them."""
        fit = self._fit_of(candidate)
        if fit is None:
            return records
        trends = trends_of_outputs(records, fit.orders, fit.theta)
        return Levelled.of(records).subtract(trends).experiments

    def _input_path(self, orders: Orders, theta: FloatArray) -> StateSpace:
        """The model without C and D, which move no pole of the input path."""
        path = replace(orders.polynomials(theta), C=np.ones(1), D=np.ones(1))
        return innovations_form(path, self.experiments[0].dt, 1.0)

    def _fit_of(self, candidate: Candidate) -> Fit | None:
        """Fit of a candidate, by its method and orders."""
        for fit in self.fits.values():
            method, trend = fit.candidate.method, fit.orders.trend
            same_kind = (method, trend) == (candidate.method, candidate.trend)
            if same_kind and fit.orders.select(*ORDERS[method]) == dict(candidate.orders):
                return fit
        return None

    def ranked(self) -> tuple[Candidate, ...]:
        """All candidates, the best first, unstable ones last; `SysidError` if there are none."""
        if not self.candidates:
            raise SysidError(f"no candidate could be fitted: {'; '.join(self.failed[:3])}")
        ranked = sorted(self.candidates, key=lambda c: (self.criterion(c), c.bic, c.parameters))
        with_poles = self._with_poles_instead(ranked)
        if with_poles is not None:
            ranked.remove(with_poles)
            ranked.insert(0, with_poles)
        return tuple(ranked)

    def _with_poles_instead(self, ranked: Sequence[Candidate]) -> Candidate | None:
        """Candidate with poles that takes the place of a finite impulse response; None where that stays the best.

        Plants have poles: of two that the data hardly tell apart, with as many parameters, the one with them is more
        likely.
        """
        best = ranked[0]
        if self.validation or best.method not in ("oe", "bj") or np.max(best.orders["nf"]) or not best.eligible:
            return None
        for other in ranked[1:]:
            if self.criterion(other) >= self.criterion(best) + HARDLY_TOLD:
                break
            has_poles = other.method in ("oe", "bj") and np.max(other.orders["nf"]) > 0
            if has_poles and other.parameters <= best.parameters and other.radius < self.slow_radius:
                return other
        return None


def largest_ratio(values: Sequence[FloatArray]) -> float:
    """Largest ratio, 1 or more, of positive values (nu,) to the first of them; what is not finite is left out."""
    largest = 1.0
    for other in values[1:]:
        with np.errstate(all="ignore"):
            ratios = np.abs(np.log(other / values[0]))
        finite = ratios[np.isfinite(ratios)]
        largest = max(largest, float(np.exp(finite.max(initial=0.0))))
    return largest


def rising_orders(structure: str, n: int, nk: tuple[int, ...], trend: int) -> Orders:
    """Orders of a structure whose dynamics have degree n, with n coefficients of each B."""
    by_input, none = (n,) * len(nk), (0,) * len(nk)
    if structure == "arx":
        return Orders(n, by_input, 0, 0, none, nk, trend)
    if structure == "armax":
        return Orders(n, by_input, n, 0, none, nk, trend)
    if structure == "oe":
        return Orders(0, by_input, 0, 0, by_input, nk, trend)
    return Orders(0, by_input, DISTURBANCE, DISTURBANCE, by_input, nk, trend)


def _is_silent_somewhere(orders: Orders, theta: FloatArray) -> bool:
    """Whether C of an ARMAX model has a root on the unit circle that no pole cancels."""
    if not orders.na or not orders.nc:
        return False
    a, _, c, _, _ = orders.split(theta)
    roots, poles = np.roots(c), np.roots(a)
    on_circle = roots[np.abs(roots) > 1.0 - ON_CIRCLE]
    return any(np.abs(poles - root).min(initial=np.inf) > CANCELS for root in on_circle)


def _independent_starts(experiments: Experiments, orders: Orders) -> Iterator[InitialEstimate]:
    """Initial estimates from the data alone."""
    if orders.na:
        return armax_initial_estimates(experiments, orders)
    if orders.nc or orders.nd:
        return bj_initial_estimates(experiments, orders)
    return oe_initial_estimates(experiments, orders)


def _errors_and_trend(experiment: IOData, orders: Orders, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """One-step errors (N, 1), NaN where the output is missing, and the coefficients of the trend (k,)."""
    at = jacobian_of_record(experiment, orders, theta, InitialConditions.ESTIMATED)
    errors = at.columns[:, -1:]
    start = np.zeros((len(experiment) - len(errors), 1))
    return np.where(experiment.known, np.vstack((start, errors)), np.nan), at.trend


def _variance_of_rounding(experiments: Experiments) -> float:
    """Variance q^2/12 of the errors of rounding outputs to steps q, of several their geometric mean; 0 without steps.

    What is finer than the steps of a record is no dynamics. A finite impulse response to a binary input has steps too,
    but a model explains it far better than by them.
    """
    joined = np.concatenate([e.y for e in experiments])
    steps = np.array([resolution(column) for column in joined.T])
    if not steps.all():
        return 0.0
    variance = float(np.exp(np.mean(np.log(steps**2 / 12.0))))
    with suppress(SysidError), warnings.catch_warnings():
        # what this model is good for is no matter: it shows what is finer than the steps
        warnings.simplefilter("ignore", SysidWarning)
        loss = arx(complete_parts(experiments), EXACT_ORDER, EXACT_ORDER, 0).loss
        if loss < FINER * variance:
            return 0.0
    return variance


def _compared_transients(orders: Orders, theta: FloatArray, samples: int, skipped: int) -> float:
    """Degrees of freedom that free initial states take from the errors behind the skipped samples.

    A transient that has died out by then takes none, one on the unit circle nearly a whole one.
    """
    start = orders.first_error(0)
    transients = free_transients(orders, orders.split(theta), samples - start)
    if not transients.shape[1]:
        return 0.0
    basis, _ = orthonormal(transients, np.zeros(samples - start))
    return float(np.sum(basis[max(skipped - start, 0) :] ** 2))


def _excess(at: Linearisation, orders: Orders) -> float:
    """Distance of the outermost pole from input to output beyond the unit circle, in its standard deviations.

    Negative inside. A change of the denominator's coefficients moves a simple root p by -sum p^(n - i) da_i / a'(p).
    """
    a, _, _, _, f = orders.split(at.theta)
    of_a, _, _, _, of_f = orders.ranges
    worst = -np.inf
    half: FloatArray | None = None
    for denominator, positions in zip((a, *f), (of_a, *of_f), strict=True):
        roots = np.roots(denominator)
        if not (np.abs(roots) > 1.0).any():
            continue
        if half is None:
            half, _ = directions(at)
            half = half * np.sqrt(at.sum_of_squares / max(at.errors - orders.count - at.transients, 1))
        n = len(denominator) - 1
        slope = denominator[:n] * np.arange(n, 0, -1)
        for root in roots[np.abs(roots) > 1.0]:
            steepness = np.polyval(slope, root)
            if steepness == 0.0:
                # a multiple root moves without bound to first order
                worst = max(worst, 0.0)
                continue
            movement = -(root ** np.arange(n - 1, -1, -1)) / steepness
            of_modulus = (np.conj(root) * movement).real / abs(root)
            deviation = float(np.linalg.norm(of_modulus @ half[positions]))
            worst = max(worst, float(abs(root) - 1.0) / max(deviation, np.finfo(float).tiny))
    return worst


def _structure_of(orders: Orders, methods: Sequence[str]) -> str:
    """Name of the simplest structure, arx to bj, with every polynomial whose order is not zero, if possible of methods.

    Without any of them, arx and oe are the same.
    """
    used = {name for name in ("na", "nc", "nd", "nf") if np.any(getattr(orders, name))}
    able = [name for name, order_names in ORDERS.items() if used <= set(order_names)]
    return next((name for name in able if name in methods), able[0])


def _is_nested(small: Orders, large: Orders) -> bool:
    """Whether a structure is part of another one with the same delays."""
    if small.nk != large.nk:
        return False
    names = ("na", "nb", "nc", "nd", "nf")
    return all(np.all(np.less_equal(getattr(small, name), getattr(large, name))) for name in names)


def _resized_parameters(fit: Fit, orders: Orders) -> FloatArray:
    """Parameters of a fit in other orders (p,): coefficients cut off or filled with zeros, roots kept inside."""
    a, b, c, d, f = fit.orders.split(fit.theta)
    numerators, denominators = [], []
    for numerator, denominator, nb, nf, nk in zip(b, f, orders.nb, orders.nf, orders.nk, strict=True):
        numerators.append(_cut_or_filled(numerator, nk + nb))
        denominators.append(stabilised(_cut_or_filled(denominator, nf + 1), LIMIT))
    return orders.join(
        _cut_or_filled(a, orders.na + 1),
        numerators,
        stabilised(_cut_or_filled(c, orders.nc + 1), LIMIT),
        stabilised(_cut_or_filled(d, orders.nd + 1), LIMIT),
        denominators,
    )


def _cut_or_filled(coefficients: FloatArray, length: int) -> FloatArray:
    return np.pad(coefficients[:length], (0, max(length - len(coefficients), 0)))


def _neighbours(orders: Orders, names: Iterable[str]) -> Iterator[Orders]:
    """Orders that differ by one in one place, other delays with another number of lags, pole for zero, and fewer pairs.

    Of delays the last lag of the input stays where it is, or moves by one. A pole takes the place of a zero: either
    alone may cost more than it gains. C and D lose a root each together, where these cancel; a pair at one stands for a
    trend in their place.
    """
    steps = []
    for name in sorted(names):
        for channel in range(np.size(getattr(orders, name))):
            steps += [(name, channel, -1), (name, channel, 1)]
    neighbours = [_with_step(orders, *step) for step in steps]
    for name, channel, step in steps:
        if name == "nk":
            neighbours.append(_with_step(_with_step(orders, "nk", channel, step), "nb", channel, -step))
            # a first coefficient that stands for a slow beginning of the response hides a longer delay
            neighbours.append(_with_step(_with_step(orders, "nk", channel, 2 * step), "nb", channel, -step))
        if name in ("na", "nf") and step > 0:
            neighbours.append(_with_step(_with_step(orders, name, channel, 1), "nb", channel, -1))
    if {"nc", "nd"} <= set(names):
        fewer = replace(orders, nc=orders.nc - 1, nd=orders.nd - 1)
        neighbours.append(fewer)
        if "trend" in names:
            neighbours.append(_with_step(fewer, "trend", 0, 1))
    for neighbour in neighbours:
        smallest = min(neighbour.na, neighbour.nc, neighbour.nd, *neighbour.nf, *neighbour.nk)
        if smallest >= 0 and min(neighbour.nb) >= 1:
            yield neighbour


def _with_step(orders: Orders, name: str, channel: int, step: int) -> Orders:
    """Orders with a step added to one of them, to that of one input where each has its own."""
    value: Any = getattr(orders, name)
    if isinstance(value, int):
        changed: Any = value + step
    else:
        by_channel = list(value)
        by_channel[channel] += step
        changed = tuple(by_channel)
    return replace(orders, **{name: changed})
