"""Findings of chapter VI, F16 to F26: what the three-joint models are and how they follow data.

The thesis compares with K = -G as a residual filter and shows the residuals beside the fits (VI.1, VI.4, VI.5): F18 to
F20 are decided one step ahead. Its summary (VI.6) does not say which fits it means: F21 to F24 are read both ways.
"""

import warnings
from collections.abc import Mapping
from statistics import median

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM, single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, finding_by_reading, words
from scenarios.thesis.multi_input import pushed_by_others
from scenarios.thesis.multivariable import FAST_CHIRP, LAGS, LEVEL, WAYS, Kind, Multivariable, ThreeJointModel, Way
from scenarios.thesis.record_fits import fits_to_records, held_out_fit, shortfall, ties, within_reach
from scenarios.thesis.reference_fits import COUPLED, DIAGONAL
from scenarios.thesis.robustness import CONSTANT, DETRENDED, OUTLIERS
from scenarios.thesis.verdicts import (
    WORDS,
    ahead,
    beyond_yaw,
    dependence,
    largest_correlation,
    outside_share,
    without_noise_model,
)
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


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    _, okid = study.multivariable.pair()
    counts, printed = (root_counts(study.multivariable, printed=printed) for printed in (False, True))
    size = np.abs(finite(okid.model.zeros()))
    direct = max(float(np.abs(block.D).max()) for block in okid.blocks.values())
    return decided_finding(
        "F16",
        {
            "no OKID pole complex": counts["OKID complex poles"] == 0,
            "all OKID zeros complex": 0 < counts["OKID zeros"] == counts["OKID complex zeros"],
            "a SysID pole complex": counts["SysID complex poles"] > 0,
        },
        counts,
        f"OKID's zeros, two states with a direct term of at most {direct:.2g}, have moduli of "
        f"{size.min(initial=np.inf):.2g} to {size.max(initial=0.0):.2g}; the arm, with its delay, has no direct term. "
        f"As printed: {', '.join(f'{name} {count:.0f}' for name, count in printed.items())}",
    )


def root_counts(models: Multivariable, *, printed: bool = False) -> dict[str, float]:
    """Count poles and zeros with an imaginary part of the two three-joint models."""
    own, okid = models.pair(printed=printed)
    zeros = finite(okid.model.zeros())
    return {
        "OKID complex poles": float(complex_roots(okid.model.poles())),
        "OKID zeros": float(len(zeros)),
        "OKID complex zeros": float(complex_roots(zeros)),
        "SysID complex poles": float(complex_roots(own.model.poles())),
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
    own, okid = study.multivariable.pair()
    differences = ", ".join(
        f"{gain:.1f} dB and {phase:.0f} degrees on {words(joint)}" for joint, (gain, phase) in printed.items()
    )
    return decided_finding(
        "F17",
        {
            words(joint): gain < limits["decibel"] and phase < limits["degrees"]
            for joint, (gain, phase) in apart.items()
        },
        {
            **{f"{joint}, gain": gain for joint, (gain, _) in apart.items()},
            **{f"{joint}, phase": phase for joint, (_, phase) in apart.items()},
        },
        f"The printed pair differs by {differences}. The twin's are off the truth by {100 * own.diagonal_error:.1f} "
        f"(SysID) and {100 * okid.diagonal_error:.1f} % (OKID)",
    )


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
    own, okid = study.multivariable.pair()
    lead = {way: _lead(own, okid, RPCM, way) for way in WAYS}
    parts = {
        way: {
            **{f"OKID ahead on {words(joint)}": ahead(points) for joint, points in lead[way].items()},
            "SysID worst on shoulder pitch": all(
                ahead(fit - own.fit(RPCM).of(way)[SHOULDER])
                for joint, fit in own.fit(RPCM).of(way).items()
                if joint != SHOULDER
            ),
        }
        for way in WAYS
    }
    return decided_finding(
        "F18",
        parts["one_step"],
        _values_by_name(lead),
        f"In simulation {sum(parts['simulation'].values())} of {len(parts['simulation'])} parts hold; "
        f"{ties(_values_by_name(lead))}; {without_noise_model(own)}. {within_reach(study, (RPCM,))}",
    )


def exchange_residuals(study: Comparison) -> Finding:
    """F19: which residuals of the exchange are white, and how long yaw's depend on the input."""
    study.campaign.log(RPCM)
    white = CLAIMS["F19"].limits["white"]
    tests = dict(zip(KINDS, (entry.residual_test(RPCM) for entry in study.multivariable.pair()), strict=True))
    own, okid = (outside_share(test) for test in tests.values())
    lags = {kind: dependence(test) for kind, test in tests.items()}
    return decided_finding(
        "F19",
        {
            "SysID white on yaw": own[YAW] <= white,
            "SysID white on elbow pitch": own[ELBOW] <= white,
            "SysID not white on shoulder pitch": own[SHOULDER] > white,
            "OKID white on yaw": okid[YAW] <= white,
            "OKID white on shoulder pitch": okid[SHOULDER] <= white,
            "OKID less white on elbow pitch": okid[ELBOW] > max(okid[YAW], okid[SHOULDER]),
            **{f"{kind} yaw and its input": early > 0 and late <= white for kind, (early, late) in lags.items()},
        },
        {
            **{f"SysID {joint}": 100 * share for joint, share in own.items()},
            **{f"OKID {joint}": 100 * share for joint, share in okid.items()},
            **{
                f"{kind} yaw and its input, lags {which}": 100 * share
                for kind, shares in lags.items()
                for which, share in zip(("1 to 14", "15 to 25"), shares, strict=True)
            },
        },
        f"{len(tests['OKID'].residuals)} samples make bounds of {tests['OKID'].whiteness_bound:.3f}",
        cause=_without_friction(study),
    )


def _without_friction(study: Comparison) -> str:
    """Describe the whiteness of residuals without friction, of models identified without it; empty where not played."""
    smooth = study.campaigns[1]
    if RPCM not in smooth.logs:
        return ""
    outside = []
    for okid in (False, True):
        blocks = []
        for joint, entry in study.joints.items():
            name = single_joint_test(study.estimation_test, joint)
            model = study.frictionless[joint].find(name, "okid" if okid else entry.chosen.method)
            if model is None:
                return ""
            blocks.append(model.model)
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
    data = study.campaign.several(FAST_CHIRP)
    own, okid = study.multivariable.pair()
    lead = {way: _lead(own, okid, FAST_CHIRP, way) for way in WAYS}
    parts = {f"OKID ahead on {words(joint)}": ahead(points) for joint, points in lead["one_step"].items()}
    value = _values_by_name(lead)
    limits = CLAIMS["F20"].limits
    shares = {}
    for entry, inputs in ((own, [1]), (okid, [1, 2])):
        beyond, share = beyond_yaw(data.u, inputs)
        shares[entry.kind] = share
        if share >= limits["own"]:
            correlation, bound = largest_correlation(residuals(entry.model, data)[:, 0], beyond, data.dt)
            value[f"yaw residual, {entry.kind}"] = correlation
            parts[f"slight coupling, {entry.kind}"] = bound < correlation <= np.sqrt(limits["slight"])
    unmoved = data.u.copy()
    unmoved[:, 0] = 0.0
    coupled = 100 * float(np.std(sysid.simulate(study.multivariable.truth, unmoved)[:, 0]) / np.std(data.y[:, 0]))
    return decided_finding(
        "F20",
        parts,
        value,
        f"{ties(_values_by_name(lead))}. {within_reach(study, (FAST_CHIRP,))}. The axes share a waveform: the pitch "
        f"commands have {100 * min(shares.values()):.2g} % of their variance beyond what follows from yaw's. In truth "
        f"they make {coupled:.1f} % of yaw's motion",
    )


def slow_data(study: Comparison) -> Finding:
    """F21: on data of low frequency SysID is ahead on yaw and the hybrid model is best."""
    study.campaign.log(SLOW)
    own, okid = study.multivariable.pair()
    hybrid = study.multivariable.model("hybrid").fit(SLOW)
    yaw = {way: -_lead(own, okid, SLOW, way)[YAW] for way in WAYS}
    best = {way: hybrid.mean(way) - max(entry.fit(SLOW).mean(way) for entry in (own, okid)) for way in WAYS}
    value = {f"{what}, {words(way)}": points[way] for what, points in (("yaw", yaw), ("hybrid", best)) for way in WAYS}
    gains = [np.abs(entry.blocks[YAW].frequency_response(np.array([0.05]))[0, 0, 0]) for entry in (own, okid)]
    return finding_by_reading(
        "F21",
        {WORDS[way]: {"SysID ahead on yaw": ahead(yaw[way]), "hybrid best": ahead(best[way])} for way in WAYS},
        value,
        f"{ties(value)}; {without_noise_model(own)}. {within_reach(study, (SLOW,))}. At 0.05 Hz, where no model was "
        f"excited, their gains on yaw are {gains[0]:.2f} (SysID) and {gains[1]:.2f} (OKID), truth "
        f"{study.joints[YAW].truth.dc_gain:.2f} at 0 Hz",
    )


def follows_5_hz(study: Comparison) -> Finding:
    """F22: cutoff about 1 Hz, yet the models follow 3 to 5 Hz content."""
    fits = {
        way: {
            joint: {
                (kind, name): fit
                for kind in KINDS
                for name, fit in fits_to_records(study, kind, joint, MIDDLE, way).items()
            }
            for joint in study.joints
        }
        for way in WAYS
    }
    worst = {way: {joint: min(entry.values()) for joint, entry in fits[way].items()} for way in WAYS}
    shares = []
    for joint, entry in fits["simulation"].items():
        (kind, name), fit = min(entry.items(), key=lambda item: item[1])
        shares.append(f"{words(joint)} of {kind} on {name} {fit:.0f} %: {shortfall(study, joint, name, fit)}")
    bands = (f"{e.chosen.bandwidth_hz:.2f} and {e.models['okid'].bandwidth_hz:.2f}" for e in study.joints.values())
    return finding_by_reading(
        "F22",
        {WORDS[way]: {words(joint): fit > FOLLOWS for joint, fit in worst[way].items()} for way in WAYS},
        _values_by_name(worst),
        f"The cutoffs are {', '.join(bands)} Hz for SysID and OKID",
        cause=f"worst in simulation, with where the points of fit go: {'; '.join(shares)}",
    )


def above_5_hz(study: Comparison) -> Finding:
    """F23: above 5 Hz OKID is slightly better."""
    lead: dict[Way, dict[str, float]] = {}
    for way in WAYS:
        for joint in study.joints:
            own, okid = (fits_to_records(study, kind, joint, FAST, way) for kind in KINDS)
            lead.setdefault(way, {})[joint] = median(okid[name] - own[name] for name in own)
    most = CLAIMS["F23"].limits["slightly"]
    return finding_by_reading(
        "F23",
        {
            WORDS[way]: {words(joint): ahead(points) and points <= most for joint, points in lead[way].items()}
            for way in WAYS
        },
        _values_by_name(lead),
        f"{ties(_values_by_name(lead))}; {without_noise_model(study.multivariable.pair()[0])}. "
        f"{within_reach(study, FAST[1])}",
    )


def parsimony(study: Comparison) -> Finding:
    """F24: two states each do as well as five, two and three."""
    apart = {
        way: {
            joint: held_out_fit(study, "OKID", joint, way) - held_out_fit(study, "SysID", joint, way)
            for joint in study.joints
        }
        for way in WAYS
    }
    most = CLAIMS["F24"].limits["points"]
    orders = ("/".join(str(block.order) for block in entry.blocks.values()) for entry in study.multivariable.pair())
    return finding_by_reading(
        "F24",
        {WORDS[way]: {words(joint): points >= -most for joint, points in apart[way].items()} for way in WAYS},
        _values_by_name(apart),
        f"The orders are {' (SysID) and '.join(orders)} (OKID); {ties(_values_by_name(apart))}",
    )


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: with a bias or outliers left in, SysID needs hardly more states, OKID needs more."""
    limits = CLAIMS["F25"].limits
    joints = tuple(study.robustness.judged_by)
    if not joints:
        raise MissingRecordError("no joint has a PRBS record and one of another waveform to judge by")
    entries = {(entry.joint, entry.method, entry.record): entry for entry in study.robustness.orders}
    value: dict[str, float] = {}
    parts: dict[str, bool] = {}
    for kind, record in (("bias", CONSTANT), ("outliers", OUTLIERS)):
        more: dict[str, list[int]] = {}
        for joint in joints:
            for method in KINDS:
                clean = entries[joint, method, DETRENDED]
                best = max(clean.fits.values())
                disturbed = entries[joint, method, record].sufficient(best, limits["points"])
                extra = disturbed - clean.sufficient(best, limits["points"])
                more.setdefault(method, []).append(extra)
                value[f"{kind}: {method} on {words(joint)}"] = float(extra)
        robust = sum(extra <= limits["more"] for extra in more["SysID"])
        sensitive = sum(okid > own for own, okid in zip(more["SysID"], more["OKID"], strict=True))
        parts[f"SysID robust to {kind}"] = 2 * robust > len(joints)
        parts[f"OKID sensitive to {kind}"] = 2 * sensitive > len(joints)
    return decided_finding(
        "F25",
        parts,
        value,
        "SysID is output error with as many states as OKID here, up to the largest orders of the thesis; one more than "
        "the largest tried counts where none suffices",
    )


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
    return decided_finding(
        "F26",
        {words(joint): points < limits["points"] for joint, points in worth.items()},
        {**{f"{joint}, points in the exchange": points for joint, points in worth.items()}, **gains},
        f"Beside the exchange, the gains of the other joints' commands are at most {max(gains.values()):.0f} % of the "
        "own command's up to 10 Hz",
    )


def _lead(own: ThreeJointModel, okid: ThreeJointModel, record: str, way: Way) -> dict[str, float]:
    mine, other = own.fit(record).of(way), okid.fit(record).of(way)
    return {joint: other[joint] - mine[joint] for joint in mine}


def _values_by_name(values: Mapping[Way, Mapping[str, float]]) -> dict[str, float]:
    return {f"{name}, {words(way)}": value for way in WAYS for name, value in values[way].items()}
