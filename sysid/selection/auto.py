"""Choice of delay, structure and orders from the data alone."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.frequency.delayest import delayest
from sysid.models.estimate import Estimate
from sysid.polynomial import armax, arx, bj, oe
from sysid.records.arguments import shown, whole_number
from sysid.records.arrays import Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.printing import Part, Table
from sysid.selection.structure_search import ORDERS, Candidate, Experiments, StructureSearch, complete_parts
from sysid.subspace import n4sid, pem_ss
from sysid.validation.feedback import feedback_p, interchanged

LISTED = 8  # candidates that a printed choice lists

INTERCHANGED = "; nothing shows that it acts on them: are input and output interchanged?"

LEVEL = 0.01  # p-value below which an input counts as fed back
STRETCHES = 2  # parts of a long experiment on which candidates are compared, spread over it
FEW = 5  # samples per parameter below which chance decides between candidates

DIRECT = "a direct term, which would be that of the controller"


@dataclass(frozen=True, eq=False, repr=False)
class StructureChoice(Locked):
    """The best of many structures, and the others.

    Attributes:
        estimate: The chosen model, estimated from all data.
        candidates: Every candidate, the best first; unstable ones last.
        delays: Delays in samples of each input at which the search begins, by `delayest`; empty for several outputs.
        samples: Samples on which the candidates are compared.
        reason: Why this one, in words.
    """

    estimate: Estimate
    candidates: tuple[Candidate, ...]
    delays: tuple[int, ...]
    samples: int
    reason: str

    def _parts(self) -> list[Part]:
        best, listed = self.candidates[0], self.candidates[:LISTED]
        columns = [
            ("candidate", [str(candidate) for candidate in listed]),
            ("parameters", [str(candidate.parameters) for candidate in listed]),
            ("loss", [f"{candidate.loss:.4g}" for candidate in listed]),
            ("EBIC above", [f"{candidate.ebic - best.ebic:.1f}" for candidate in listed]),
        ]
        if np.isfinite(best.validation):
            columns.append(("validation", [f"{candidate.validation:.4g}" for candidate in listed]))
        columns.append(("", [candidate.remark for candidate in listed]))
        unlisted = len(self.candidates) - len(listed)
        remainder = f"and {unlisted} more" if unlisted else ""
        return [self.reason, Table(columns), remainder]


def auto(
    data: IOData | Sequence[IOData],
    *,
    methods: Sequence[str] | None = None,
    validation: IOData | Sequence[IOData] | None = None,
    largest: int = 10,
    longest: int = 4000,
) -> StructureChoice:
    """Choose delay, structure and orders, and estimate the model.

    With one output the delays start at those of `delayest`; arx, oe, armax and bj rise in order until the criterion of
    each gets worse twice; then single orders of the best ones, the delays among them, change by one as long as that
    helps. With several outputs it is the order of a state-space model, `n4sid` refined by `pem_ss`. Beside feedback
    (`sysid.feedback`) there is no direct term, which would be that of the controller, and oe does not take part, which
    only a white disturbance would leave unbiased.

    The criterion is the extended BIC [ChenChen2008] on the same samples for all, or the error of the simulated
    validation outputs where there are such data. Unstable models are chosen only if all are unstable.

    Args:
        data: One experiment, or several that share the model; means removed (`IOData.detrend`). Outputs may be
            missing.
        methods: Estimators to try, some of arx, oe, armax, bj; by default all, or all but oe beside feedback. One
            output only.
        validation: Data to judge on, means removed.
        largest: Largest order tried.
        longest: Samples on which candidates are compared; of longer records `STRETCHES` parts are used. The model
            itself is estimated from all.

    Returns:
        The model with the table of candidates and the reason.

    Raises:
        SysidError: Data without input, unknown methods, or no candidate that could be fitted.

    Warns:
        SysidWarning: What the estimator says about the chosen model.
    """
    experiments = as_experiments(data, missing=True)
    validation_data = () if validation is None else as_experiments(validation, missing=True)
    # no record determines more orders than it has samples
    largest = whole_number("largest", largest, 1, max(map(len, experiments)))
    longest = whole_number("longest", longest, 100)
    names = tuple(ORDERS) if methods is None else methods
    if not isinstance(names, Iterable):
        raise SysidError(f"methods: expected some of {', '.join(ORDERS)}, got {shown(names)}")
    names = tuple(names)
    if not names or not all(isinstance(name, str) and name in ORDERS for name in names):
        raise SysidError(f"methods: expected some of {', '.join(ORDERS)}, got {', '.join(map(str, names)) or 'none'}")
    search = StructureSearch(_stretches(experiments, longest), validation_data, largest, names)
    delays, p = tuple[int, ...](), _feedback_p(experiments)
    fed_back = p < LEVEL
    excluded = DIRECT
    with warnings.catch_warnings():
        # candidates that are too large give many warnings; the fit of the chosen one repeats its own
        warnings.simplefilter("ignore", SysidWarning)
        if experiments[0].ny == 1:
            delays = _delays(search.experiments, largest)
            if fed_back:
                delays = tuple(max(delay, 1) for delay in delays)
            if fed_back and methods is None:
                search.methods = tuple(name for name in names if name != "oe")
                excluded = f"oe, which only a white disturbance leaves unbiased, and {DIRECT}"
            search.climb_structures(delays)
        elif methods is not None:
            raise SysidError(f"methods are of one output, the data have {experiments[0].ny}: pem_ss is tried alone")
        else:
            search.direct = not fed_back
            search.climb_states()
    best = search.ranked()[0]
    reason = _reason(search, delays, sum(map(len, experiments)))
    if fed_back:
        reason += (
            f"; by `feedback` (p = {p:.2g}) the input depends on past outputs, or the system is nonlinear: without "
            f"{excluded}{_interchange_question(experiments)}"
        )
    return StructureChoice(
        estimate=_estimate(experiments, best, search.direct),
        candidates=search.ranked(),
        delays=delays,
        samples=search.samples,
        reason=reason,
    )


def _interchange_question(experiments: Experiments) -> str:
    """Question whether input and output are interchanged, where only the input depends on the other one's past."""
    if not experiments[0].nu == experiments[0].ny == 1:
        return ""
    reverse_p = _feedback_p(interchanged(complete_parts(experiments)))
    return INTERCHANGED if reverse_p > LEVEL else ""


def _estimate(experiments: Experiments, chosen: Candidate, direct: bool) -> Estimate:
    """The chosen model, estimated from all data."""
    if chosen.method == "pem_ss":
        orders: Mapping[str, Any] = chosen.orders
        start = n4sid(complete_parts(experiments), orders["order"], direct=direct)
        return pem_ss(experiments, start, direct=direct)
    estimators: Mapping[str, Callable[..., Estimate]] = {"arx": arx, "armax": armax, "oe": oe, "bj": bj}
    return estimators[chosen.method](experiments, **chosen.orders)


def _delays(experiments: Experiments, largest: int) -> tuple[int, ...]:
    """Delay of each input; 1 where no lag is significant."""
    try:
        (lags,) = delayest(complete_parts(experiments), largest=2 * largest).arx
    except SysidError:
        return (1,) * experiments[0].nu
    # -1 stands for no significant lag
    return tuple(np.where(lags < 0, 1, lags).astype(int).tolist())


def _feedback_p(experiments: Experiments) -> float:
    """Least p-value of the hypothesis that no input depends on past outputs; 1 where no test can tell."""
    return float(np.nan_to_num(feedback_p(complete_parts(experiments)), nan=1.0).min())


def _reason(search: StructureSearch, delays: tuple[int, ...], total: int) -> str:
    """Reason in words why the best candidate is chosen."""
    ranked, validated = search.ranked(), bool(search.validation)
    best = ranked[0]
    criterion = "the least error in simulation of the validation data" if validated else "the lowest EBIC"
    reason = f"{best}: {criterion} of {len(ranked)} candidates, compared on {search.samples} of {total} samples"
    rival = next((candidate for candidate in ranked if candidate.method != best.method), None)
    if rival is not None and rival.radius < 1.0:
        gap = f"{rival.ebic - best.ebic:.1f} above"
        if validated:
            gap = f"{rival.validation / best.validation:.3g} times"
        reason += f"; the next method is {rival}, {gap}"
    if search.samples < max(len(ranked), FEW * best.parameters):
        reason += "; among so few samples chance decides"
    if delays:
        reason += f"; delays by delayest: {', '.join(map(str, delays))} samples"
    if best.radius >= 1.0:
        reason += "; every candidate is unstable"
    return reason


def _stretches(experiments: Experiments, longest: int) -> Experiments:
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
