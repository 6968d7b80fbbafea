"""Choice of delay, structure and orders from the data alone."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from enum import auto as auto_value
from typing import Any

import numpy as np

from sysid.frequency.delayest import AMBIGUOUS, DelayEstimate, IntArray, delayest
from sysid.frequency.far_delay import far_delay
from sysid.models.estimate import Estimate
from sysid.models.predict import predict
from sysid.polynomial import armax, arx, bj, oe
from sysid.polynomial.orders import NO_TREND
from sysid.polynomial.trends import LINE, OFFSET, best_degree, level
from sysid.polynomial.weighted_output_errors import UNWEIGHTED
from sysid.records.arguments import shown, truth_value, whole_number
from sysid.records.arrays import Locked
from sysid.records.data import IOData, as_experiments, complete_parts
from sysid.records.errors import Message, SysidError, SysidWarning
from sysid.records.printing import Part, Table
from sysid.selection.loop import Loop
from sysid.selection.simulation_ranking import SimulationRanking, better_in_simulation
from sysid.selection.structure_search import (
    HARDLY_TOLD,
    ORDERS,
    Candidate,
    Experiments,
    StructureSearch,
)
from sysid.subspace import n4sid, pem_ss
from sysid.validation.nonlinearity import NonlinearityTest, nonlinearity
from sysid.validation.resid import resid

LISTED = 8  # candidates that a printed choice lists

STRETCHES = 2  # parts of a long experiment on which candidates are compared, spread over it
TOLD = 0.05  # difference in BIC that a reason in words tells
TRIED = 5  # best candidates of which one may turn out unstable
HIGH_ORDER = 20  # of the autoregressive model that shows a nonlinearity before the search
NONLINEAR_LARGEST = 5  # order that is tried beside a nonlinearity, which buys any order
CERTAIN = 1e-6  # p-value below which a nonlinearity counts in the choice: a false one would cost all that orders gain
FEW = 5  # samples per parameter below which chance decides between candidates

Fitted = tuple[Estimate, list[warnings.WarningMessage]]
"""A model, and the warnings of its fit, which the reader gets of the chosen one alone."""

CONTROLLERS = "which would be that of the controller"

SAME_SAMPLE = (
    "the output depends on the input of the same sample, by a direct term or by feedback through a controller that "
    "computes the input from that output: a direct term is tried only where it is asked for (direct=True, --direct)"
)

WORSE_IN_SIMULATION = 1.2
"""Ratio of simulation errors from which on a model behind a long delay is none beside another one."""

EXACTLY = (
    "input and output follow from each other exactly, in the same sample: either of a plant without noise and with a "
    "direct term, or of feedback by a controller that alone moves the input; an input from outside would tell"
)


@dataclass(frozen=True, eq=False, repr=False)
class StructureChoice(Locked):
    """The best of many structures, and the others.

    Attributes:
        estimate: The chosen model, estimated from all data.
        candidates: Every candidate, the best first; unstable ones last.
        delays: Delays in samples of each input at which the search begins, by `delayest`: to the first
            of several outputs.
        samples: Samples on which the candidates are compared.
        reason: Why this one, in words.
        cautions: What the data cannot tell about it, in words.
        disagreement: Largest ratios, 1 or more, of gain at 0 Hz and of bandwidth between it and the candidates that the
            criterion hardly tells from it; 1 where there are none.
        slower: That of `cautions` on a slower model that fits better, in words; empty if there is none.
        same_sample: Whether input and output of the same sample depend on each other, and a direct term was left out
            because it could be that of a controller.
    """

    estimate: Estimate
    candidates: tuple[Candidate, ...]
    delays: tuple[int, ...]
    samples: int
    reason: str
    cautions: tuple[str, ...] = ()
    disagreement: tuple[float, float] = (1.0, 1.0)
    slower: str = ""
    same_sample: bool = False

    def _parts(self) -> list[Part]:
        best, listed = self.candidates[0], self.candidates[:LISTED]
        columns = [
            ("candidate", [str(candidate) for candidate in listed]),
            ("parameters", [str(candidate.parameters) for candidate in listed]),
            ("loss", [f"{candidate.loss:.4g}" for candidate in listed]),
            ("BIC above", [f"{candidate.bic - best.bic:.1f}" for candidate in listed]),
        ]
        if np.isfinite(best.validation):
            columns.append(("validation", [f"{candidate.validation:.4g}" for candidate in listed]))
        columns.append(("", [candidate.remark for candidate in listed]))
        unlisted = len(self.candidates) - len(listed)
        remainder = f"and {unlisted} more" if unlisted else ""
        return [self.reason, Table(columns), remainder, *self.estimate._parts()]


def auto(
    data: IOData | Sequence[IOData],
    *,
    methods: Sequence[str] | None = None,
    validation: IOData | Sequence[IOData] | None = None,
    direct: bool = False,
    offset: bool | None = None,
    trend: bool | None = None,
    largest: int = 10,
    longest: int = 4000,
) -> StructureChoice:
    """Choose delay, structure and orders, and estimate the model.

    With one output the delays start at those of `delayest`; arx, oe, armax and bj rise in order until the criterion of
    each gets worse twice, and again from the shortest delay that the likelihood allows; then single orders of the best
    ones, the delays among them, change by one as long as that helps. With several outputs it is the order of a state-
    space model, `n4sid` refined by `pem_ss`, with the delays of `delayest` as known ones and without them. Beside
    feedback (`sysid.feedback`) there is no direct term, which would be that of the controller, and oe does not take
    part, which only a white disturbance would leave unbiased. A held input has no direct term either: one is tried only
    on data without noise, or if asked for.

    Where oe is asked for alone, the model of the disturbance that the criterion would add weights its errors
    (`weighting=` of `oe`), unless the residuals object to the path.

    The criterion is the BIC [Schwarz1978] on the same samples for all, which counts the initial states, or
    the error of the simulated validation outputs where there are such data. Modes with a time constant above a third
    of the record are of the model only if the input drives them: else they follow a disturbance. A pole outside the
    unit circle must be surely outside.

    Args:
        data: One experiment, or several that share the model; means removed (`IOData.detrend`). Outputs may be
            missing.
        methods: Estimators to try, some of arx, oe, armax, bj; by default all, or all but oe beside feedback. One
            output only.
        validation: Data to judge on, means removed.
        direct: Whether the output may depend on the input of the same sample although the data have noise.
        offset: Whether the output has a constant of its own, as in `oe`; None decides by the criterion. One output
            only.
        trend: Whether it has a straight line, likewise.
        largest: Largest order tried.
        longest: Samples on which the search begins; of longer records `STRETCHES` parts are used, and the best
            candidates of them are continued on all samples. With several outputs all are compared on these parts.

    Returns:
        The model with the table of candidates and the reason.

    Raises:
        SysidError: Data without input, unknown methods, or no candidate that could be fitted.

    Warns:
        SysidWarning: What the estimator says about the chosen model.
    """
    experiments = as_experiments(data, missing=True)
    validation_data = () if validation is None else as_experiments(validation, missing=True)
    largest, samples = whole_number("largest", largest, 1), max(map(len, experiments))
    if samples < largest:
        advice = ", or a smaller largest"
        text = f"the longest experiment has {samples} samples, which determine no orders up to {largest}; expected more"
        raise SysidError(Message(f"{text}{advice}", "too-few-samples", largest=advice))
    longest = whole_number("longest", longest, 100)
    names = _methods_to_try(methods)
    direct = truth_value("direct", direct)
    trends = _trends(experiments, offset, trend)
    without_trend = _without_trend(experiments, trends[0])
    loop = Loop.of(without_trend, direct=direct)
    if methods is not None and experiments[0].ny > 1:
        raise SysidError(f"methods are of one output, the data have {experiments[0].ny}: pem_ss is tried alone")
    part = stretches(experiments, longest)
    answer: Answer | None = None
    if not validation_data and _is_nonlinear(without_trend, largest):
        small = min(largest, NONLINEAR_LARGEST)
        search = StructureSearch(part, validation_data, small, names, trends, refines=False)
        answer = _answered(experiments, search, loop, any_method=methods is None)
    if answer is None or answer.objection in (Objection.NONE, Objection.DEPENDENT):
        # the best of the small ones leaves no nonlinearity: a long regression lacks other things too
        search = StructureSearch(part, validation_data, largest, names, trends)
        answer = _answered(experiments, search, loop, any_method=methods is None)
    climb, ranked, fit, objection = answer.climb, answer.ranked, answer.fit, answer.objection
    simulated = None
    if objection in (Objection.DEPENDENT, Objection.NONLINEAR):
        if methods is None:
            climb.search.methods = names
        simulated = _ranked_by_simulation(experiments, climb.search, ranked[0], climb.delays, objection)
    if simulated is not None:
        ranking, fit = simulated
        climb = climb.told_by(ranking.candidate)
        reason = _reason_of_simulation(climb, ranking, ranked, sum(map(len, experiments)))
        ranked = _with_first(ranking.candidate, ranked)
    else:
        if objection in (Objection.NONE, Objection.UNTESTED) and climb.beside_noise is not None:
            weighted = _weighted(ranked[0], climb.beside_noise)
            if weighted != ranked[0]:
                ranked, fit = (weighted, *ranked[1:]), None
        climb = climb.told_by(ranked[0])
        reason = _reason(climb.search, ranked, climb.delays, sum(map(len, experiments)))
        if loop.is_closed:
            reason += _reason_of_feedback(experiments[0].ny, loop, any_method=methods is None, direct=direct)
    if loop.is_at_once:
        reason += f"; {SAME_SAMPLE}"
    if open_delay := _open_delay(climb.estimate_of_delays):
        # gain and bandwidth may be known all the same: no caution, which withholds a verdict
        reason += f"; {open_delay}"
    slower = _slower(climb, ranked)
    cautions = _cautions(climb, loop, ranked[0], slower)
    estimate, caught = fit or _fitted(experiments, ranked[0], climb.search)
    for warning in caught:
        warnings.warn(warning.message, stacklevel=2)
    return StructureChoice(
        estimate=estimate,
        candidates=ranked,
        delays=climb.delays,
        samples=climb.search.samples,
        reason="; ".join((reason, *cautions)),
        cautions=cautions,
        disagreement=climb.search.disagreement(ranked) if ranked[0].weighting == UNWEIGHTED else climb.disagreement,
        slower=slower,
        same_sample=loop.is_at_once,
    )


def _methods_to_try(methods: Sequence[str] | None) -> tuple[str, ...]:
    """Names of the methods that were asked for, all by default; `SysidError` for others."""
    if methods is None:
        return tuple(ORDERS)
    if not isinstance(methods, Iterable):
        raise SysidError(f"methods: expected some of {', '.join(ORDERS)}, got {shown(methods)}")
    names = tuple(methods)
    if not names or not all(isinstance(name, str) and name in ORDERS for name in names):
        raise SysidError(f"methods: expected some of {', '.join(ORDERS)}, got {', '.join(map(str, names)) or 'none'}")
    return names


@dataclass(frozen=True)
class Climb:
    """Candidates of a finished search, and the delays at which it began.

    Attributes:
        search: All candidates.
        delays: Delay of each input at which it began.
        estimate_of_delays: What they come from; None where the data are too few.
        beside_noise: Best candidate with a model of the noise, where output-error models alone are asked for.
        disagreement: Likewise the ratios of gain and bandwidth between it and those that are hardly worse.
        near: Estimate among the delays that are tested first, where that of `delays` is beyond them; None else.
    """

    search: StructureSearch
    delays: tuple[int, ...]
    estimate_of_delays: DelayEstimate | None
    beside_noise: Candidate | None = None
    disagreement: tuple[float, float] = (1.0, 1.0)
    near: DelayEstimate | None = None

    def told_by(self, best: Candidate) -> "Climb":
        """With the estimate of the delay that the best candidate has, where there are two of them."""
        if self.near is None or self.estimate_of_delays is None:
            return self
        nk = _delay_of(best)
        far, near = (int(estimate.arx[0, 0]) for estimate in (self.estimate_of_delays, self.near))
        if abs(nk - far) <= abs(nk - near):
            return self
        return replace(self, estimate_of_delays=self.near, delays=_delays(self.near, 1), near=None)


@dataclass(frozen=True)
class Answer:
    """Outcome of a search for a structure.

    Attributes:
        climb: The search.
        ranked: Its candidates, the best first.
        fit: Model of the best one, if it had to be estimated already.
        objection: What shows that the best one is not right.
    """

    climb: Climb
    ranked: tuple[Candidate, ...]
    fit: Fitted | None
    objection: "Objection"


def _answered(experiments: Experiments, search: StructureSearch, loop: Loop, *, any_method: bool) -> Answer:
    """Search, and what its best candidate leaves unexplained."""
    with warnings.catch_warnings():
        # candidates that are too large give many warnings; the fit of the chosen one repeats its own
        warnings.simplefilter("ignore", SysidWarning)
        if experiments[0].ny == 1:
            climb = _climbed(experiments, search, loop, any_method=any_method)
        else:
            climb = _climbed_states(search, loop)
    ranked, fit = _stable_first(experiments, climb.search)
    return Answer(climb, ranked, fit, _objection_to_best(experiments, climb, loop, ranked[0]))


def _climbed(experiments: Experiments, search: StructureSearch, loop: Loop, *, any_method: bool) -> Climb:
    """Candidates with one output, of long records on a part first.

    Args:
        experiments: Whole records.
        search: Search on them or on a part.
        loop: What the tests of feedback say.
        any_method: Whether the methods are free.
    """
    levelled = _without_trend(search.experiments, search.trends[0])
    estimate = _estimated_delays(levelled, search.largest)
    delays = _delays(estimate, experiments[0].nu)
    shortest = _shortest(estimate, delays)
    near, far = None, _estimated_far_delay(levelled, search.largest)
    if far is not None:
        # what the delays up to the limit explain stays a candidate: many lags resemble a long delay
        near, estimate, shortest = estimate, far, delays
        delays = _delays(far, experiments[0].nu)
    least = 0
    if not loop.allows_direct_term:
        least = 1
        if any_method:
            search.methods = tuple(name for name in search.methods if name != "oe")
    paths_alone = set(search.methods) == {"oe"} and not search.validation
    if paths_alone:
        search.methods = ("oe", "bj")
    delays, shortest = _at_least(least, delays), _at_least(least, shortest)
    search.climb_structures(delays, shortest, is_far=far is not None)
    if near is not None and _is_far_in_vain(search, largest_near=2 * search.largest):
        # a resonance resembles a long delay beside a disturbance: what simulates or predicts better stays
        near, estimate, delays = None, near, _at_least(least, _delays(near, experiments[0].nu))
        search = search.anew(search.experiments)
        search.climb_structures(delays, _at_least(least, _shortest(estimate, delays)))
    if sum(map(len, search.experiments)) < sum(map(len, experiments)):
        whole = search.anew(experiments)
        whole.continue_from(search, tuple(min(delay, 1) for delay in delays))
        search = whole
    if not paths_alone:
        return Climb(search, delays, estimate, near=near)
    ranked = search.ranked()
    disagreement = search.disagreement(ranked)
    search.keep_input_paths()
    return Climb(search, delays, estimate, ranked[0], disagreement, near)


def _climbed_states(search: StructureSearch, loop: Loop) -> Climb:
    """State-space models of rising order."""
    search.direct = loop.allows_direct_term
    estimate = _estimated_delays(search.experiments, search.largest)
    delays = _delays(estimate, search.experiments[0].nu)
    # with one sample left to the dynamics, as a held input has it
    search.climb_states(tuple(max(delay - 1, 0) for delay in delays))
    return Climb(search, delays, estimate)


def _objection_to_best(experiments: Experiments, climb: Climb, loop: Loop, best: Candidate) -> "Objection":
    """What shows that the best candidate is not right, where simulated errors may choose another."""
    if climb.search.validation or loop.is_at_once or climb.search.is_rounding(best):
        return Objection.UNTESTED
    objection = _objection(best, climb.search, experiments, loop.is_closed)
    if objection is Objection.DEPENDENT and climb.beside_noise is not None:
        # a slow disturbance resembles the input in any short record: a model of it tells the two apart
        return _objection(climb.beside_noise, climb.search, experiments, loop.is_closed)
    return objection


def _weighted(path: Candidate, beside_noise: Candidate) -> Candidate:
    """An output-error model, its errors weighted by the model of the disturbance that the criterion asks for beside it.

    Where residuals object to the path, no weighting is right: it would move the fit to other frequencies.
    """
    if beside_noise.method != "bj" or path.trend != beside_noise.trend:
        return path
    if any(order != beside_noise.orders[name] for name, order in path.orders.items()):
        return path
    nc, nd = (int(np.max(beside_noise.orders[name])) for name in ("nc", "nd"))
    return replace(path, weighting=(nc, nd))


def _reason_of_simulation(
    climb: Climb, simulated: SimulationRanking, ranked: tuple[Candidate, ...], samples: int
) -> str:
    """Reason in words for a candidate that simulates better than the first one of the ranking."""
    delays = ", ".join(map(str, climb.delays))
    # the simulation of an unstable model may overflow
    error = f"{simulated.ratio:.3g} times that" if simulated.ratio > 0.0 else "finite, unlike that"
    return (
        f"{simulated.candidate}: in simulation of a part that it was not fitted to, its error is "
        f"{error} of {ranked[0]}, which has the lowest BIC of {len(ranked)} candidates on "
        f"{climb.search.samples} of {samples} samples; delays by delayest: {delays} samples"
    )


def _reason_of_feedback(outputs: int, loop: Loop, *, any_method: bool, direct: bool) -> str:
    """What feedback leaves out of the choice, in words."""
    excluded = f"the direct term that was asked for, {CONTROLLERS}" if direct else f"a direct term, {CONTROLLERS}"
    if any_method and outputs == 1:
        excluded = f"oe, which only a white disturbance leaves unbiased, and {excluded}"
    return (
        f"; by `feedback` (p = {loop.p:.2g}) the input depends on past outputs, or the system is nonlinear: without "
        f"{excluded}{loop.question}"
    )


def _cautions(climb: Climb, loop: Loop, best: Candidate, slower: str) -> tuple[str, ...]:
    """What the data cannot tell about the best candidate, in words."""
    cautions = []
    if loop.is_exact:
        cautions.append(EXACTLY)
    if not best.eligible:
        cautions.append(best.remark)
    if slower:
        cautions.append(slower)
    if unlike := _unlike_delays(climb.estimate_of_delays, int(np.max(best.orders.get("order", 0)))):
        cautions.append(unlike)
    return tuple(cautions)


def _slower(climb: Climb, ranked: Sequence[Candidate]) -> str:
    """Candidate with a slow mode that was refused although it fits better than all without, in words; empty if none."""
    best_of_others = min((one.bic for one in ranked if np.isinf(one.drive) and one.eligible), default=-np.inf)
    slow = [one for one in ranked if one.creeps and not one.doubt]
    rival = min(slow, key=lambda one: one.bic, default=None)
    # the best may have such a mode itself, and was chosen with it
    if rival is None or np.isfinite(ranked[0].drive) or climb.search.validation or not ranked[0].eligible:
        return ""
    difference = best_of_others - rival.bic
    if difference <= HARDLY_TOLD:
        return ""
    return (
        f"{rival} fits better (BIC {difference:.0f} lower) by a mode slower than a third of the record: part of the "
        "response, which changes the gain at 0 Hz, or a disturbance; a longer record would tell"
    )


class Objection(Enum):
    """What the residuals of the best candidate show against it."""

    NONE = auto_value()
    UNTESTED = auto_value()
    """No test can tell: it is unstable, or follows something slow."""
    DEPENDENT = auto_value()
    """They depend on the input."""
    NONLINEAR = auto_value()
    """They depend on it nonlinearly, so much that it matters."""


def _is_nonlinear(experiments: Experiments, largest: int) -> bool:
    """Whether an autoregressive model of high order leaves residuals that depend nonlinearly on the input."""
    if experiments[0].ny > 1:
        return False
    parts, inputs = complete_parts(experiments), experiments[0].nu
    with warnings.catch_warnings(), suppress(SysidError):
        warnings.simplefilter("ignore", SysidWarning)
        if not _leaves_nonlinearity(parts, (1,) * inputs):
            return False
        # what acts after more lags than the model has is not nonlinear
        delays = _delays(_estimated_delays(experiments, largest), inputs)
        return max(delays) <= HIGH_ORDER // 2 or _leaves_nonlinearity(parts, delays)
    return False


def _leaves_nonlinearity(parts: Sequence[IOData], delays: tuple[int, ...]) -> bool:
    test = nonlinearity(arx(parts, HIGH_ORDER, (HIGH_ORDER,) * len(delays), delays), parts, named=False)
    return test is not None and _is_certain(test)


def _is_certain(test: NonlinearityTest) -> bool:
    """Whether the nonlinearity of some output matters and is beyond doubt."""
    return bool((test.material & (test.p_values < CERTAIN)).any())


def _objection(best: Candidate, search: StructureSearch, experiments: Experiments, fed_back: bool) -> Objection:
    """What shows that the best candidate is not right: then simulated errors may choose another.

    Beside feedback they would prefer a biased one, however right the best is. What looks like feedback is a
    nonlinearity where the residuals show one. Simulated integrators drift with their disturbances.
    """
    # the parameters of the search are as good as those of a whole estimate here, which costs many times as much
    model = search.polynomials_of(best)
    is_settling = best.eligible and not np.isfinite(best.drive) and best.radius < 1.0
    if model is None or not is_settling:
        return Objection.UNTESTED
    if best.trend != NO_TREND:
        # beside a predictor that forgets slowly, another line than its own would leave errors for the whole record
        experiments = search.without_trends(experiments, best)
    parts = complete_parts(experiments)
    test = nonlinearity(model, parts, named=False)
    if test is not None and _is_certain(test):
        return Objection.NONLINEAR
    if test is not None and (test.p_values < 1.0 - test.level).any():
        return Objection.DEPENDENT
    if fed_back:
        return Objection.NONE
    with suppress(SysidError):  # nothing is left to test
        if not resid(model, parts).independent.all():
            return Objection.DEPENDENT
    return Objection.NONE


def _ranked_by_simulation(
    experiments: Experiments,
    search: StructureSearch,
    best: Candidate,
    delays: tuple[int, ...],
    objection: Objection,
) -> tuple[SimulationRanking, Fitted] | None:
    """Candidate that simulates better than the best one, with its model, which is stable too; None if none does."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        ranking = better_in_simulation(search, best, delays, is_nonlinear=objection is Objection.NONLINEAR)
    if ranking is None:
        return None
    fit = _fitted(experiments, ranking.candidate, search)
    slowest = np.abs(fit[0].model.input_path().poles()).max(initial=0.0)
    return (ranking, fit) if slowest < search.slow_radius else None


def _stable_first(experiments: Experiments, search: StructureSearch) -> tuple[tuple[Candidate, ...], Fitted | None]:
    """Candidates, the best first, and the model of that one if it had to be estimated.

    Half of all estimates of a pole at one exceed one: a candidate whose model is unstable although it was not makes way
    for the next one that is what it was. Far inside the unit circle no model need be estimated to see that.
    """
    ranked = search.ranked()
    first = None
    for candidate in ranked[:TRIED]:
        if candidate.radius >= 1.0 or not candidate.eligible:
            break
        if candidate.radius < search.slow_radius:
            return _with_first(candidate, ranked), None
        fit = _fitted(experiments, candidate, search)
        first = first or fit
        if fit[0].model.input_path().is_stable():
            return _with_first(candidate, ranked), fit
    return ranked, first


def _with_first(candidate: Candidate, ranked: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
    """The candidates in their sequence, one of them first."""
    return (candidate, *(other for other in ranked if other is not candidate))


def _fitted(experiments: Experiments, candidate: Candidate, search: StructureSearch) -> Fitted:
    """The model of a candidate, estimated from all data."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", SysidWarning)
        return _estimate(experiments, candidate, search), caught


def _estimate(experiments: Experiments, chosen: Candidate, search: StructureSearch) -> Estimate:
    """The chosen model, estimated from all data."""
    if chosen.method == "pem_ss":
        orders: Mapping[str, Any] = chosen.orders
        nk = orders.get("nk", 0)
        start = n4sid(complete_parts(experiments), orders["order"], nk=nk, direct=search.direct)
        # as the candidates were compared: further starts hardly ever find a lower minimum and take most of the time
        return pem_ss(experiments, start, direct=search.direct, search=False)
    estimators: Mapping[str, Callable[..., Estimate]] = {"arx": arx, "armax": armax, "oe": oe, "bj": bj}
    # the search has found a minimum already: only arx, which needs none, starts from nothing
    options: dict[str, Any] = {} if chosen.method == "arx" else {"start": search.polynomials_of(chosen)}
    if chosen.weighting != UNWEIGHTED:
        options["weighting"] = chosen.weighting
    return estimators[chosen.method](experiments, **chosen.orders, **chosen.trend_options, **options)


def _trends(experiments: Experiments, offset: bool | None, trend: bool | None) -> tuple[int, ...]:
    """Degrees of trends of the output to try, the first at the beginning.

    Raises:
        SysidError: Options that are neither True, False nor None, or one of them True for several outputs.
    """
    tried = []
    for name, value, degree in (("offset", offset, OFFSET), ("trend", trend, LINE)):
        if value is not None and truth_value(name, value) and experiments[0].ny > 1:
            raise SysidError(
                f"{name}=True is of one output, the data have {experiments[0].ny}: remove means, detrend()"
            )
        if value is not False:
            tried.append(degree)
    if experiments[0].ny > 1:
        return (NO_TREND,)
    if trend:
        return (LINE,)
    if offset:
        return tuple(tried)
    tried.insert(0, NO_TREND)
    # a constant in the equation of an integrator is a line in its output: the search begins with that, and a line that
    # is not needed goes with the other superfluous parameters
    needs_none = best_degree(complete_parts(experiments)) == NO_TREND
    first = NO_TREND if needs_none else tried[-1]
    return (first, *(degree for degree in tried if degree != first))


def _without_trend(experiments: Experiments, degree: int) -> Experiments:
    """The experiments without trends of this degree in their outputs."""
    if degree == NO_TREND:
        return experiments
    return level(experiments, degree).experiments


def _estimated_delays(experiments: Experiments, largest: int) -> DelayEstimate | None:
    """Delays from every input to every output; None where the data are too few."""
    try:
        return delayest(complete_parts(experiments), largest=2 * largest)
    except SysidError:
        return None


def _delay_of(candidate: Candidate) -> int:
    """Delay of the first input of a candidate, samples."""
    return int(np.ravel(candidate.orders.get("nk", 0))[0])


def _is_far_in_vain(search: StructureSearch, *, largest_near: int) -> bool:
    """Whether the best candidate has a delay beyond a largest one, and one up to it is no worse.

    It simulates better, or it fits as well one step ahead on the samples that both have errors of.
    """
    ranked = search.ranked()
    best, near = ranked[0], next((one for one in ranked if _delay_of(one) <= largest_near), None)
    if near is None or _delay_of(best) <= largest_near:
        return False
    if _simulation_error(search, best) > WORSE_IN_SIMULATION * _simulation_error(search, near):
        return True
    reach = _delay_of(best) + search.largest
    return search.bic_behind(near, reach) < search.bic_behind(best, reach)


def _simulation_error(search: StructureSearch, candidate: Candidate) -> float:
    """Sum of squares that the path from the input leaves of the outputs; infinite if it cannot be simulated."""
    path = search.input_path_of(candidate)
    if path is None or not path.is_stable():
        return np.inf
    total = 0.0
    for part in complete_parts(search.without_trends(search.experiments, candidate)):
        total += float(np.sum((part.y - predict(path, part, steps=None)) ** 2))
    return total


def _estimated_far_delay(experiments: Experiments, largest: int) -> DelayEstimate | None:
    """Delay of one input beyond those that are tested first; None where nothing shows one."""
    parts = complete_parts(experiments)
    if experiments[0].nu * experiments[0].ny != 1 or not parts:
        return None
    tested = 2 * largest
    hint = far_delay(parts, tested)
    if hint is None or hint <= largest:
        return None
    # around it: the records begin later by the delays that are left out
    skipped = hint - largest
    later = []
    for part in parts:
        if len(part) > 2 * skipped:
            later.append(replace(part[skipped:], u=part.u[: len(part) - skipped], window=0))
    try:
        estimate = delayest(later, largest=tested)
    except SysidError:
        return None
    if estimate.arx[0, 0] < 0:
        return None
    return replace(estimate, arx=estimate.arx + skipped, interval=estimate.interval + skipped)


def _delays(estimate: DelayEstimate | None, inputs: int) -> tuple[int, ...]:
    """Delay of each input to the first output that it acts on; 1 where no lag is significant."""
    delays = []
    for lags in _significant_lags(estimate, inputs):
        delays.append(int(lags.min()) if len(lags) else 1)
    return tuple(delays)


def _at_least(least: int, delays: tuple[int, ...]) -> tuple[int, ...]:
    """Delays of the inputs, those below a least one raised to it."""
    return tuple(max(delay, least) for delay in delays)


def _shortest(estimate: DelayEstimate | None, delays: tuple[int, ...]) -> tuple[int, ...]:
    """Shortest delay of each input that the likelihood allows; none is 0 unless it is the best one."""
    shortest = []
    for j, delay in enumerate(delays):
        least = 0 if estimate is None else int(estimate.interval[0, 0, j])
        shortest.append(min(max(least, 1), delay))
    return tuple(shortest)


def _open_delay(estimate: DelayEstimate | None) -> str:
    """Caution on a delay that a lag may stand for; empty where the data tell it."""
    if estimate is None or estimate.interval.shape[2] > 1:
        return ""
    least, most = estimate.interval[:, 0, 0].tolist()
    if most - least < AMBIGUOUS:
        return ""
    return (
        f"the delay is between {least} and {most} samples: lag and delay cannot be told apart; an input that changes "
        f"within {most - least} samples, or a longer record, would tell"
    )


def _significant_lags(estimate: DelayEstimate | None, inputs: int) -> list[IntArray]:
    """Delays of each input to the outputs that it acts on (at most ny,); empty where none is significant."""
    if estimate is None:
        return [np.zeros(0, dtype=int)] * inputs
    # -1 stands for no significant lag
    return [of_input[of_input >= 0] for of_input in estimate.arx.T]


def _unlike_delays(estimate: DelayEstimate | None, order: int) -> str:
    """Caution on delays of an input to several outputs that differ by more samples than the model has states."""
    if estimate is None or len(estimate.arx) == 1:
        return ""
    lags = _significant_lags(estimate, estimate.arx.shape[1])
    differences = sum(int(np.ptp(of_input)) for of_input in lags if len(of_input))
    if differences <= order:
        return ""
    listed = "; ".join(str(of_input.tolist()) for of_input in lags)
    return (
        f"an input reaches the outputs after unlike delays ({listed} samples), which take {differences} states, more "
        "than the model has: gains may be wrong; tfest(data, np, nz, delay=None) estimates a delay of each path"
    )


def _reason(search: StructureSearch, ranked: tuple[Candidate, ...], delays: tuple[int, ...], total: int) -> str:
    """Reason in words why the best candidate is chosen."""
    best, validated = ranked[0], bool(search.validation)
    criterion = "the least error in simulation of the validation data" if validated else "the lowest BIC"
    lower = [] if validated else [one for one in ranked if one.bic < best.bic - TOLD]
    if lower:
        criterion += " of those that may be chosen"
    reason = f"{best}: {criterion} of {len(ranked)} candidates, compared on {search.samples} of {total} samples"
    rival = next((candidate for candidate in ranked if candidate.method != best.method), None)
    if lower:
        refused = min(lower, key=lambda one: one.bic)
        reason += f"; {refused}, {best.bic - refused.bic:.1f} lower, is refused: {refused.reservation}"
    elif rival is not None and rival.eligible:
        gap = f"{rival.bic - best.bic:.1f} above"
        if validated:
            gap = f"{rival.validation / best.validation:.3g} times"
        reason += f"; the next method is {rival}, {gap}"
    if search.samples < max(len(ranked), FEW * best.parameters):
        reason += "; among so few samples chance decides"
    if delays:
        reason += f"; delays by delayest: {', '.join(map(str, delays))} samples"
    if not best.eligible:
        reason += "; no candidate is better: each is unstable, or follows a disturbance by a slow mode"
    elif best.radius >= 1.0:
        reason += f"; the plant is unstable: a pole is {best.excess:.3g} standard deviations outside the unit circle"
    return reason


def stretches(experiments: Experiments, longest: int) -> Experiments:
    """At most `longest` samples or so: stretches spread over each experiment, of as many experiments as that needs."""
    total = sum(map(len, experiments))
    if total <= longest:
        return experiments
    # stretches shorter than a thousand samples would spend many of them on initial states
    kept = experiments[:: max(round(len(experiments) * STRETCHES * 1000 / longest), 1)]
    length = longest // (STRETCHES * len(kept))
    stretches: list[IOData] = []
    for experiment in kept:
        if len(experiment) <= STRETCHES * length:
            stretches.append(experiment)
            continue
        starts = np.linspace(0, len(experiment) - length, STRETCHES).astype(int)
        stretches += [experiment[int(start) : int(start) + length] for start in starts]
    return tuple(stretches)
