"""F25: what OKID and the prediction-error models make of a bias and of outliers in the record."""

from statistics import median

from scenarios.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.disturbances import OUTLIER_SIZE
from scenarios.thesis.finding import Finding, decided, verdict
from scenarios.thesis.orders_needed import CONSTANT, DETRENDED
from scenarios.thesis.robustness import CORE, sysid_method
from scenarios.thesis.robustness_outcome import Outcome

COMPARABLE = (10.0, 5.0)
"""A model is comparable to the one from the clean record when its bandwidth moves by at most so many percent and its
fit in simulation to a record not seen falls by at most so many points."""

NO_BANDWIDTH = 100.0
"""Percent that a bandwidth counts as moved by where the spoilt record gives none."""

NEAR_ONE = 0.001
"""A pole that near z = 1, or beyond it, acts as a constant over a record of 60 s."""


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: the prediction-error models are robust to bias and outliers, OKID is sensitive.

    Four statements, from the thesis' two sentences: with each of the two disturbances, SysID models stay comparable,
    and OKID's bandwidth moves more than SysID's. A statement holds when it does on most joints, at every degree (the
    first) or in the median over the degrees (the second).
    """
    joints = tuple(study.robustness.judged_by)
    if not joints:
        raise MissingRecordError("no joint has a PRBS record and another one to judge by")
    value: dict[str, float] = {}
    passed = 0
    for kind in CORE:
        kept = sum(_comparable(study, kind, joint) for joint in joints)
        moved = {
            name: [_moved(study, kind, joint, method) for joint, method in zip(joints, methods, strict=True)]
            for name, methods in (("SysID", [sysid_method(j) for j in joints]), ("OKID", ["okid"] * len(joints)))
        }
        worse = sum(one > other for one, other in zip(moved["OKID"], moved["SysID"], strict=True))
        passed += sum(2 * count > len(joints) for count in (kept, worse))
        value |= {f"{kind}: {name}": median(shares) for name, shares in moved.items()}
        value |= {f"{kind}: joints with SysID comparable": kept, f"{kind}: joints with OKID moved more": worse}
    orders = {(entry.joint, entry.method, entry.record): entry.needed for entry in study.robustness.orders}
    for method in ("SysID", "OKID"):
        value[f"orders that detrending saves: {method}"] = max(
            orders[joint, method, CONSTANT] - orders[joint, method, DETRENDED] for joint in joints
        )
    return decided("F25", verdict(passed, 4), value, _unit(), _why(study, joints, value))


def _unit() -> str:
    bias, outliers = (", ".join(f"{degree:g}" for degree in CORE[kind] if degree) for kind in ("bias", "outliers"))
    return (
        f"percent that the bandwidth moves, median over degrees, draws and joints ({NO_BANDWIDTH:g} where none is "
        f"left); constants of {bias} standard deviations left in the output, outliers of {OUTLIER_SIZE:g} on "
        f"{outliers} % of its samples; joints for each statement; orders saved, at most"
    )


def _why(study: Comparison, joints: tuple[str, ...], value: dict[str, float]) -> str:
    all_of = len(joints)
    spoilt = [
        entry
        for joint in joints
        for entry in _draws(study, "bias", joint, sysid_method(joint))
        if entry.degree == max(CORE["bias"])
    ]
    slow = sum(entry.slowest > 1 - NEAR_ONE for entry in spoilt)
    share = min(CORE["outliers"])
    fits = {
        name: median(
            entry.fit
            for joint in joints
            for entry in _draws(study, "outliers", joint, sysid_method(joint) if name == "SysID" else "okid")
            if entry.degree == share
        )
        for name in ("SysID", "OKID")
    }
    percent, points = COMPARABLE
    return (
        f"four statements, each to hold on most of {all_of} joints: SysID stays comparable (bandwidth within "
        f"{percent:g} %, simulation fit within {points:g} points of the clean record's, at every degree) with bias "
        f"({value['bias: joints with SysID comparable']:g}) and outliers "
        f"({value['outliers: joints with SysID comparable']:g}), OKID moves more with bias "
        f"({value['bias: joints with OKID moved more']:g}) and outliers "
        f"({value['outliers: joints with OKID moved more']:g}). A constant left in costs a model without one a pole "
        f"near z = 1: {slow} of {len(spoilt)} SysID models spend one at {max(CORE['bias']):g} standard deviations, "
        "the 10 lagged terms of OKID have some to spare. Outliers stand in OKID's regressors, where they bias it: at "
        f"{share:g} % the median fit in simulation is {fits['OKID']:.1f} %, SysID's {fits['SysID']:.1f} %"
    )


def _draws(study: Comparison, kind: str, joint: str, method: str) -> list[Outcome]:
    """What finding F25 rests on, whatever else was tried."""
    found = study.robustness.of(kind, joint, method)
    return [entry for degree in CORE[kind] if degree for entry in found[degree]]


def _clean(study: Comparison, joint: str, method: str) -> Outcome:
    return study.robustness.of("bias", joint, method)[0.0][0]


def _shift(entry: Outcome, clean: Outcome) -> float:
    return NO_BANDWIDTH if entry.failure else 100 * abs(entry.bandwidth_hz / clean.bandwidth_hz - 1)


def _moved(study: Comparison, kind: str, joint: str, method: str) -> float:
    clean = _clean(study, joint, method)
    return median(_shift(entry, clean) for entry in _draws(study, kind, joint, method))


def _comparable(study: Comparison, kind: str, joint: str) -> bool:
    """Whether the SysID model of the median draw stays comparable at every degree."""
    method = sysid_method(joint)
    clean = _clean(study, joint, method)
    percent, points = COMPARABLE
    found = study.robustness.of(kind, joint, method)
    return all(
        median(_shift(entry, clean) for entry in found[degree]) <= percent
        and median(clean.fit - entry.fit for entry in found[degree]) <= points
        for degree in CORE[kind]
        if degree
    )
