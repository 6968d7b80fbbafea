"""Finding F25: sensitivity of OKID and the prediction-error models to a bias and to outliers."""

from dataclasses import dataclass
from statistics import median

from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import DISTURBANCES, OUTLIER_SIZE
from scenarios.thesis.finding import Finding, decided_finding, verdict
from scenarios.thesis.robustness import CORE, sysid_method
from scenarios.thesis.robustness_outcome import (
    COMPARABLE,
    CONSTANT,
    DETRENDED,
    NO_BANDWIDTH,
    RobustnessOutcome,
    clean,
    comparable,
    shift,
)

NEAR_ONE = 0.001
"""A pole that near z = 1, or beyond it, acts as a constant over a record of 40 s."""


@dataclass(frozen=True)
class Statement:
    """One of the four statements of finding F25.

    Attributes:
        key: Its name among the numbers of the finding.
        words: What it says.
        joints: On how many joints it holds.
        of: How many there are.
    """

    key: str
    words: str
    joints: int
    of: int

    @property
    def holds(self) -> bool:
        """Whether it holds on most joints."""
        return 2 * self.joints > self.of


def statements(study: Comparison) -> tuple[Statement, ...]:
    """Test the four statements on every joint that has the records."""
    joints = tuple(study.robustness.judged_by)
    own, okid = _methods(joints).values()
    entries = []
    for kind, what in (("bias", "a constant left in the output"), ("outliers", "outliers")):
        comparable = sum(_comparable(study, kind, joint) for joint in joints)
        worse = sum(
            _median_shift(study, kind, joint, okid[joint]) > _median_shift(study, kind, joint, own[joint])
            for joint in joints
        )
        degrees = ", ".join(f"{degree:g}" for degree in CORE[kind] if degree)
        unit = DISTURBANCES[kind].unit
        entries += [
            Statement(
                f"{kind}: joints with SysID comparable",
                f"SysID models stay comparable with {what} ({degrees} {unit})",
                comparable,
                len(joints),
            ),
            Statement(
                f"{kind}: joints with OKID moved more",
                f"OKID’s bandwidth moves more than SysID’s with {what} ({degrees} {unit})",
                worse,
                len(joints),
            ),
        ]
    return tuple(entries)


def _methods(joints: tuple[str, ...]) -> dict[str, dict[str, str]]:
    return {"SysID": {joint: sysid_method(joint) for joint in joints}, "OKID": dict.fromkeys(joints, "okid")}


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: the prediction-error models are robust to bias and outliers, OKID is sensitive.

    Four statements, from the thesis' two sentences: with each of the two disturbances, SysID models stay comparable,
    and OKID's bandwidth moves more than SysID's. A statement holds when it does on most joints, at every degree (the
    first) or in the median over the degrees (the second).
    """
    joints = tuple(study.robustness.judged_by)
    if not joints:
        raise MissingRecordError("no joint has a PRBS record and one of another waveform to judge by")
    for methods in _methods(joints).values():
        for joint, method in methods.items():
            failure = clean(study.robustness, joint, method).failure
            if failure:
                raise MissingRecordError(
                    f"the part of the PRBS record of {joint} that is disturbed gives {method} no bandwidth to compare "
                    f"with even as it is ({failure})"
                )
    value: dict[str, float] = {}
    for kind in CORE:
        for name, methods in _methods(joints).items():
            value[f"{kind}: {name}"] = median(_median_shift(study, kind, joint, methods[joint]) for joint in joints)
    entries = statements(study)
    value |= {entry.key: float(entry.joints) for entry in entries}
    orders = {(entry.joint, entry.method, entry.record): entry.needed for entry in study.robustness.orders}
    for method in ("SysID", "OKID"):
        value[f"orders that detrending saves: {method}"] = float(
            max(orders[joint, method, CONSTANT] - orders[joint, method, DETRENDED] for joint in joints)
        )
    return decided_finding(
        "F25", verdict(sum(entry.holds for entry in entries), len(entries)), value, _unit(), _why(study, joints, value)
    )


def _unit() -> str:
    bias, outliers = (", ".join(f"{degree:g}" for degree in CORE[kind] if degree) for kind in ("bias", "outliers"))
    return (
        f"percent that the bandwidth moves, median over degrees, draws and joints ({NO_BANDWIDTH:g} where none is "
        f"left); constants of {bias} standard deviations left in the output, outliers of {OUTLIER_SIZE:g} on "
        f"{outliers} % of its samples; joints for each statement; orders saved, at most"
    )


def _why(study: Comparison, joints: tuple[str, ...], value: dict[str, float]) -> str:
    all_of = len(joints)
    methods = _methods(joints)
    slow, total = {}, {}
    for name in methods:
        ends = [
            entry.slowest
            for joint in joints
            for entry in _draws(study, "bias", joint, methods[name][joint])
            if entry.degree == max(CORE["bias"]) and entry.failure != "refused"
        ]
        slow[name], total[name] = sum(pole > 1 - NEAR_ONE for pole in ends), len(ends)
    share = min(CORE["outliers"])
    fits = {}
    for name in methods:
        values = [
            entry.fit
            for joint in joints
            for entry in _draws(study, "outliers", joint, methods[name][joint])
            if entry.degree == share and entry.failure != "refused"
        ]
        fits[name] = f"{median(values):.1f} %" if values else "not known"
    percent, points = COMPARABLE
    return (
        f"four statements, each to hold on most of {all_of} joints: SysID stays comparable (bandwidth within "
        f"{percent:g} %, median fit in simulation to records of other waveforms within {points:g} points of the clean "
        f"record's, at every degree) with bias "
        f"({value['bias: joints with SysID comparable']:g}) and outliers "
        f"({value['outliers: joints with SysID comparable']:g}), OKID moves more with bias "
        f"({value['bias: joints with OKID moved more']:g}) and outliers "
        f"({value['outliers: joints with OKID moved more']:g}). Most likely a constant left in costs a model "
        "without one a pole near z = 1, that of a sum, and outliers, which stand in OKID's regressors, bias it: at "
        f"{max(CORE['bias']):g} standard deviations {slow['SysID']} of {total['SysID']} SysID and {slow['OKID']} of "
        f"{total['OKID']} OKID models have such a pole, and at {share:g} % of outliers the median fit in simulation "
        f"is {fits['OKID']} (OKID) and {fits['SysID']} (SysID)"
    )


def _draws(study: Comparison, kind: str, joint: str, method: str) -> list[RobustnessOutcome]:
    """Joints, methods and disturbances that finding F25 rests on."""
    outcomes = study.robustness.of(kind, joint, method)
    return [entry for degree in CORE[kind] if degree for entry in outcomes[degree]]


def _median_shift(study: Comparison, kind: str, joint: str, method: str) -> float:
    reference = clean(study.robustness, joint, method)
    return median(shift(entry, reference) for entry in _draws(study, kind, joint, method))


def _comparable(study: Comparison, kind: str, joint: str) -> bool:
    """Whether the SysID model stays comparable at every degree."""
    method = sysid_method(joint)
    outcomes = study.robustness.of(kind, joint, method)
    reference = clean(study.robustness, joint, method)
    return all(comparable(outcomes[degree], reference) for degree in CORE[kind] if degree)
