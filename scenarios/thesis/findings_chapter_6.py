"""Findings of chapter VI, F16 to F26: what the three-joint models are and how they follow data.

The thesis compares with K = -G as a residual filter and shows the residuals beside the fits (VI.1, VI.4, VI.5): F18 to
F20 are decided one step ahead. Its summary (VI.6) does not say which fits it means: F21 to F24 are read both ways.
"""

import warnings
from collections.abc import Callable, Mapping
from statistics import median

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, finding_by_reading, words
from scenarios.thesis.multivariable import FAST_CHIRP, LAGS, LEVEL, WAYS, Kind, Multivariable, Way, pushed_by_others
from scenarios.thesis.number_text import minus
from scenarios.thesis.record_fits import fits_to_records, held_out_fit, missing_fit_shares, remarks, within_reach
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL
from scenarios.thesis.robustness import CONSTANT, DETRENDED, OUTLIERS
from scenarios.thesis.verdicts import WORDS, ahead, beyond_yaw, dependence, largest_correlation, outside_share
from sysid import SysidWarning, residuals
from sysid.models import block_diagonal

YAW, SHOULDER, ELBOW = STUDIED_JOINTS

SLOW = "mimo-10"
"""Data of low frequency: the sweep that stays below the bandwidth, 0 to 1 Hz."""

MIDDLE = ((1, 2, 3), ("mimo-1", "mimo-2", "mimo-4", "mimo-5", "mimo-11"))
"""Single-joint tests and records of several joints with content at 3 to 5 Hz, and none above."""

FAST = ((4, 8), ("mimo-3", "mimo-6", "mimo-12", "mimo-13"))
"""Tests with content above 5 Hz."""

FOLLOWS = CLAIMS["F22"].limits["follows"]
"""A model follows a record if its fit is larger than this, percent."""

KINDS: tuple[Kind, ...] = ("SysID", "OKID")

ROUNDING = 1e-6
"""A smaller imaginary part is rounding."""

ByWay = Mapping[Way, Mapping[str, float]]
"""Numbers in simulation and one step ahead, by joint."""


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    _, okid = study.multivariable.pair()
    counts, printed = (root_counts(study.multivariable, printed=printed) for printed in (False, True))
    size = np.abs(finite(okid.model.zeros()))
    parts = {
        "no OKID pole complex": counts["OKID complex poles"] == 0,
        "all OKID zeros complex": 0 < counts["OKID zeros"] == counts["OKID complex zeros"],
        "a SysID pole complex": counts["SysID complex poles"] > 0,
    }
    facts = {
        "direct": max(float(np.abs(block.D).max()) for block in okid.blocks.values()),
        "smallest": size.min(initial=np.inf),
        "largest": size.max(initial=0.0),
        "printed": [f"{name} {count}" for name, count in printed.items()],
    }
    return decided_finding("F16", parts, counts, facts)


def root_counts(models: Multivariable, *, printed: bool = False) -> dict[str, int]:
    """Count poles and zeros with an imaginary part of the two three-joint models."""
    own, okid = models.pair(printed=printed)
    zeros = finite(okid.model.zeros())
    return {
        "OKID complex poles": complex_roots(okid.model.poles()),
        "OKID zeros": len(zeros),
        "OKID complex zeros": complex_roots(zeros),
        "SysID complex poles": complex_roots(own.model.poles()),
    }


def finite(zeros: np.ndarray) -> np.ndarray:
    """Return the finite roots; very large ones are infinite roots that rounding made finite."""
    return np.asarray(zeros[np.abs(zeros) <= CLAIMS["F16"].limits["finite"]])


def complex_roots(roots: np.ndarray) -> int:
    """Count the complex roots."""
    return int((np.abs(roots.imag) > ROUNDING).sum())


def bode_agrees(study: Comparison) -> Finding:
    """F17: the Bode plots of the two three-joint models agree."""
    limits = CLAIMS["F17"].limits
    apart, printed = (
        {joint: bode_differences(study.multivariable, joint, printed=printed) for joint in study.joints}
        for printed in (False, True)
    )
    own, okid = (100 * entry.diagonal_error for entry in study.multivariable.pair())
    listed = {
        name: [f"{gain:.1f} dB and {phase:.0f} degrees on {words(joint)}" for joint, (gain, phase) in pairs.items()]
        for name, pairs in (("twin", apart), ("printed", printed))
    }
    parts = {joint: gain < limits["decibel"] and phase < limits["degrees"] for joint, (gain, phase) in apart.items()}
    value = {f"{joint}, {name}": pair[i] for i, name in enumerate(("gain", "phase")) for joint, pair in apart.items()}
    return decided_finding("F17", parts, value, {**listed, "own": own, "okid": okid})


def bode_differences(models: Multivariable, joint: str, *, printed: bool = False) -> tuple[float, float]:
    """Largest difference of gain, dB, and of phase, degrees, between the SysID and the OKID model of a joint."""
    limits = CLAIMS["F17"].limits
    f = np.geomspace(limits["low"], limits["high"], 100)
    first, second = (entry.blocks[joint].frequency_response(f)[:, 0, 0] for entry in models.pair(printed=printed))
    ratio = first / second
    return float(20 * np.abs(np.log10(np.abs(ratio))).max()), float(np.abs(np.degrees(np.angle(ratio))).max())


def exchange_fit(study: Comparison) -> Finding:
    """F18: OKID follows the exchange better on every joint, SysID is worst on shoulder pitch."""
    study.campaign.log(RPCM)
    own, _ = study.multivariable.pair()
    lead = _lead(study, RPCM)
    parts = {}
    for way in WAYS:
        fits = own.fit(RPCM).of(way)
        parts[way] = {f"OKID ahead on {joint}": ahead(points) for joint, points in lead[way].items()}
        others = [fit for joint, fit in fits.items() if joint != SHOULDER]
        parts[way]["SysID worst on shoulder pitch"] = all(ahead(fit - fits[SHOULDER]) for fit in others)
    simulated, value = parts["simulation"].values(), _values_by_name(lead)
    facts = {"holding": sum(simulated), "count": len(simulated), "reach": within_reach(study, (RPCM,))}
    return decided_finding("F18", parts["one_step"], value, facts | remarks(study, value))


def exchange_residuals(study: Comparison) -> Finding:
    """F19: which residuals of the exchange are white, and how long yaw's depend on the input."""
    study.campaign.log(RPCM)
    white = CLAIMS["F19"].limits["white"]
    tests = {entry.kind: entry.residual_test(RPCM) for entry in study.multivariable.pair()}
    outside = {kind: outside_share(test) for kind, test in tests.items()}
    own, okid = outside.values()
    parts = {
        "SysID white on yaw": own[YAW] <= white,
        "SysID white on elbow pitch": own[ELBOW] <= white,
        "SysID not white on shoulder pitch": own[SHOULDER] > white,
        "OKID white on yaw": okid[YAW] <= white,
        "OKID white on shoulder pitch": okid[SHOULDER] <= white,
        "OKID less white on elbow pitch": okid[ELBOW] > max(okid[YAW], okid[SHOULDER]),
    }
    value = {f"{kind} {joint}": 100 * share for kind, shares in outside.items() for joint, share in shares.items()}
    for kind, test in tests.items():
        early, late = dependence(test)
        name = f"{kind} yaw and its input"
        parts[name] = early > 0 and late <= white
        value |= {f"{name}, lags 1 to 14": 100 * early, f"{name}, lags 15 to 25": 100 * late}
    facts = {"samples": len(test.residuals), "bound": test.whiteness_bound, "friction": _without_friction(study)}
    return decided_finding("F19", parts, value, facts)


def _without_friction(study: Comparison) -> str:
    """Describe the whiteness of residuals without friction, of models identified without it; empty where not played."""
    smooth = study.campaigns[1]
    if RPCM not in smooth.logs:
        return ""
    outside = []
    for okid in (False, True):
        methods = {joint: "okid" if okid else entry.chosen.method for joint, entry in study.joints.items()}
        names = {joint: single_joint_test(study.estimation_test, joint) for joint in methods}
        found = [study.frictionless[joint].find(names[joint], method) for joint, method in methods.items()]
        blocks = [model.estimate.model for model in found if model is not None]
        if len(blocks) < len(found):
            return ""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            test = sysid.resid(block_diagonal(blocks), smooth.several(RPCM), lags=LAGS, level=LEVEL)
        outside += [round(LAGS * share) for share in outside_share(test).values()]
    return (
        f"models of the arm without friction, on its own exchange, have {min(outside)} to {max(outside)} of {LAGS} "
        "lags outside"
    )


def fast_chirp(study: Comparison) -> Finding:
    """F20: OKID follows the 5 to 10 Hz chirp better; the pitch inputs couple slightly into yaw's residuals."""
    data, limits = study.campaign.several(FAST_CHIRP), CLAIMS["F20"].limits
    lead = _lead(study, FAST_CHIRP)
    parts = {f"OKID ahead on {joint}": ahead(points) for joint, points in lead["one_step"].items()}
    value = _values_by_name(lead)
    shares = []
    for entry, inputs in zip(study.multivariable.pair(), ([1], [1, 2]), strict=True):
        beyond, share = beyond_yaw(data.u, inputs)
        shares.append(share)
        if share >= limits["own"]:
            correlation, bound = largest_correlation(residuals(entry.model, data)[:, 0], beyond, data.dt)
            value[f"yaw residual, {entry.kind}"] = correlation
            parts[f"slight coupling, {entry.kind}"] = bound < correlation <= np.sqrt(limits["slight"])
    unmoved = data.u * [0.0, 1.0, 1.0]
    coupled = 100 * float(np.std(sysid.simulate(study.multivariable.truth, unmoved)[:, 0]) / np.std(data.y[:, 0]))
    facts = {"share": 100 * min(shares), "coupled": coupled, "reach": within_reach(study, (FAST_CHIRP,))}
    return decided_finding("F20", parts, value, facts | remarks(study, _values_by_name(lead)))


def slow_data(study: Comparison) -> Finding:
    """F21: on data of low frequency SysID is ahead on yaw and the hybrid model is best."""
    study.campaign.log(SLOW)
    pair, hybrid = study.multivariable.pair(), study.multivariable.model("hybrid").fit(SLOW)
    points: dict[Way, dict[str, float]] = {}
    readings = {}
    for way, lead in _lead(study, SLOW).items():
        beyond = hybrid.mean(way) - max(entry.fit(SLOW).mean(way) for entry in pair)
        points[way] = {"yaw": -lead[YAW], "hybrid": beyond}
        readings[WORDS[way]] = {"SysID ahead on yaw": ahead(-lead[YAW]), "hybrid best": ahead(beyond)}
    facts = {
        "gains": [np.abs(entry.blocks[YAW].frequency_response(np.array([0.05]))[0, 0, 0]) for entry in pair],
        "true": study.joints[YAW].truth.dc_gain,
        "reach": within_reach(study, (SLOW,)),
    }
    value = _values_by_name(points)
    return finding_by_reading("F21", readings, value, facts | remarks(study, value))


def follows_5_hz(study: Comparison) -> Finding:
    """F22: cutoff about 1 Hz, yet the models follow 3 to 5 Hz content."""

    def fits(joint: str, way: Way) -> dict[tuple[str, str], float]:
        of_kinds = {kind: fits_to_records(study, kind, joint, MIDDLE, way) for kind in KINDS}
        return {(kind, name): fit for kind, known in of_kinds.items() for name, fit in known.items()}

    shares = []
    for joint in study.joints:
        (kind, name), fit = min(fits(joint, "simulation").items(), key=lambda item: item[1])
        missing = missing_fit_shares(study, joint, name, fit)
        listed = ", ".join(f"{what} {minus(f'{points:z.1f}')}" for what, points in missing.items())
        largest = max(missing, key=lambda what: missing[what])
        shares.append(f"{words(joint)} of {kind} on {name} {fit:.0f} %: {listed}, most of it {largest}")
    facts = {
        "cutoffs": [
            f"{entry.chosen.bandwidth_hz:.2f} and {entry.models['okid'].bandwidth_hz:.2f}"
            for entry in study.joints.values()
        ],
        "shares": "; ".join(shares),
    }
    return _read_both_ways(
        study, "F22", lambda joint, way: min(fits(joint, way).values()), lambda fit: fit > FOLLOWS, facts
    )


def above_5_hz(study: Comparison) -> Finding:
    """F23: above 5 Hz OKID is slightly better."""

    def lead(joint: str, way: Way) -> float:
        own, okid = (fits_to_records(study, kind, joint, FAST, way) for kind in KINDS)
        return median(okid[name] - own[name] for name in own)

    most, facts = CLAIMS["F23"].limits["slightly"], {"reach": within_reach(study, FAST[1])}
    return _read_both_ways(study, "F23", lead, lambda points: ahead(points) and points <= most, facts)


def parsimony(study: Comparison) -> Finding:
    """F24: two states each do as well as five, two and three."""

    def lead(joint: str, way: Way) -> float:
        return held_out_fit(study, "OKID", joint, way) - held_out_fit(study, "SysID", joint, way)

    most = CLAIMS["F24"].limits["points"]
    orders = ["/".join(str(block.order) for block in entry.blocks.values()) for entry in study.multivariable.pair()]
    return _read_both_ways(study, "F24", lead, lambda points: points >= -most, {"orders": orders})


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: with a bias or outliers left in, SysID needs hardly more states, OKID needs more."""
    limits = CLAIMS["F25"].limits
    joints = tuple(study.robustness.judged_by)
    if not joints:
        raise MissingRecordError("no joint has a PRBS record and one of another waveform to judge by")
    entries = {(entry.joint, entry.method, entry.record): entry for entry in study.robustness.orders}

    def more_states(joint: str, method: str, record: str) -> int:
        clean, disturbed = (entries[joint, method, name] for name in (DETRENDED, record))
        best = max(clean.fits.values())
        return disturbed.sufficient(best, limits["points"]) - clean.sufficient(best, limits["points"])

    value: dict[str, float] = {}
    parts: dict[str, bool] = {}
    for kind, record in (("bias", CONSTANT), ("outliers", OUTLIERS)):
        more = {joint: [more_states(joint, method, record) for method in KINDS] for joint in joints}
        for joint, states in more.items():
            value |= {f"{kind}: {method} on {words(joint)}": n for method, n in zip(KINDS, states, strict=True)}
        robust = sum(own <= limits["more"] for own, _ in more.values())
        sensitive = sum(okid > own for own, okid in more.values())
        parts[f"SysID robust to {kind}"] = 2 * robust > len(joints)
        parts[f"OKID sensitive to {kind}"] = 2 * sensitive > len(joints)
    return decided_finding("F25", parts, value, {})


def coupling(study: Comparison) -> Finding:
    """F26: little coupling between the joints near the operating point."""
    study.campaign.log(RPCM)
    limits = CLAIMS["F26"].limits
    lowest = min(entry.truth.bandwidth_hz for entry in study.joints.values())
    alone, whole = (study.multivariable.reference(kind, RPCM) for kind in (DIAGONAL, COUPLED))
    worth = {joint: whole[joint] - alone[joint] for joint in alone}
    bands = {(limits["from"], lowest): "to the bandwidth", (3.0, 5.0): "3 to 5 Hz", (5.0, 10.0): "5 to 10 Hz"}
    gains = {
        f"{joint}, percent of the gain {name}": 100 * share
        for band, name in bands.items()
        for joint, share in pushed_by_others(study.multivariable.truth, band=band).items()
    }
    parts = {joint: points < limits["points"] for joint, points in worth.items()}
    value = {f"{joint}, points in the exchange": points for joint, points in worth.items()} | gains
    return decided_finding("F26", parts, value, {"worth": max(worth.values()), "gain": max(gains.values())})


def _by_way(study: Comparison, number: Callable[[str, Way], float]) -> ByWay:
    return {way: {joint: number(joint, way) for joint in study.joints} for way in WAYS}


def _lead(study: Comparison, record: str) -> ByWay:
    """Fit of OKID less that of SysID to a record of several joints, percentage points."""
    own, okid = (entry.fit(record) for entry in study.multivariable.pair())
    return _by_way(study, lambda joint, way: okid.of(way)[joint] - own.of(way)[joint])


def _values_by_name(values: ByWay) -> dict[str, float]:
    return {f"{name}, {words(way)}": value for way in WAYS for name, value in values[way].items()}


def _read_both_ways(
    study: Comparison,
    key: str,
    number: Callable[[str, Way], float],
    holds: Callable[[float], bool],
    facts: Mapping[str, object],
) -> Finding:
    """Decide on a number of every joint, in simulation and one step ahead."""
    values = _by_way(study, number)
    readings = {WORDS[way]: {joint: holds(value) for joint, value in values[way].items()} for way in WAYS}
    named = _values_by_name(values)
    return finding_by_reading(key, readings, named, {**facts, **remarks(study, named)})
