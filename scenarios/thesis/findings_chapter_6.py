"""Findings of chapter VI, F16 to F26: what the three-joint models are and how they follow data.

The thesis compares with K = -G as a residual filter and shows the residuals beside the fits (VI.1, VI.4, VI.5): F18 to
F20 are decided one step ahead, but for F18 on shoulder pitch, where K = 0. Its summary (VI.6) does not say which fits
it means: F21 to F24 are read both ways.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
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
"""Numbers of the joints, in simulation and one step ahead."""


def real_poles(study: Comparison) -> Finding:
    """F16: OKID has real poles and complex zeros, the SysID model has complex poles."""
    _, okid = study.multivariable.pair()
    counts = root_counts(study.multivariable)
    printed_counts = root_counts(study.multivariable, printed=True)
    verdict_parts = {
        "no OKID pole complex": counts["OKID complex poles"] == 0,
        "all OKID zeros complex": 0 < counts["OKID zeros"] == counts["OKID complex zeros"],
        "a SysID pole complex": counts["SysID complex poles"] > 0,
    }
    zero_moduli = np.abs(finite(okid.model.zeros()))
    facts = {
        "direct": max(float(np.abs(block.D).max()) for block in okid.blocks.values()),
        "smallest": zero_moduli.min(initial=np.inf),
        "largest": zero_moduli.max(initial=0.0),
        "printed": [f"{name} {count}" for name, count in printed_counts.items()],
    }
    return decided_finding("F16", verdict_parts, counts, facts)


def root_counts(models: Multivariable, *, printed: bool = False) -> dict[str, int]:
    """Count poles and zeros with an imaginary part of the two three-joint models."""
    prediction_error, okid = models.pair(printed=printed)
    zeros = finite(okid.model.zeros())
    return {
        "OKID complex poles": complex_roots(okid.model.poles()),
        "OKID zeros": len(zeros),
        "OKID complex zeros": complex_roots(zeros),
        "SysID complex poles": complex_roots(prediction_error.model.poles()),
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
    verdict_parts = {}
    gains, phases = {}, {}
    twin_texts, printed_texts = [], []
    for joint in study.joints:
        gain, phase = bode_differences(study.multivariable, joint)
        verdict_parts[joint] = gain < limits["decibel"] and phase < limits["degrees"]
        gains[f"{joint}, gain"] = gain
        phases[f"{joint}, phase"] = phase
        twin_texts.append(f"{gain:.1f} dB and {phase:.0f} degrees on {words(joint)}")
        gain, phase = bode_differences(study.multivariable, joint, printed=True)
        printed_texts.append(f"{gain:.1f} dB and {phase:.0f} degrees on {words(joint)}")
    prediction_error, okid = study.multivariable.pair()
    facts = {
        "twin": twin_texts,
        "printed": printed_texts,
        "own": 100 * prediction_error.diagonal_error,
        "okid": 100 * okid.diagonal_error,
    }
    return decided_finding("F17", verdict_parts, gains | phases, facts)


def bode_differences(models: Multivariable, joint: str, *, printed: bool = False) -> tuple[float, float]:
    """Largest difference of gain, dB, and of phase, degrees, between the SysID and the OKID model of a joint."""
    limits = CLAIMS["F17"].limits
    f = np.geomspace(limits["low"], limits["high"], 100)
    prediction_error, okid = models.pair(printed=printed)
    # The angle of the ratio lies within half a turn, where the difference of two unwrapped phases may be off by turns.
    ratio = prediction_error.blocks[joint].frequency_response(f) / okid.blocks[joint].frequency_response(f)
    decibel = float(20 * np.abs(np.log10(np.abs(ratio[:, 0, 0]))).max())
    degrees = float(np.abs(np.degrees(np.angle(ratio[:, 0, 0]))).max())
    return decibel, degrees


def exchange_fit(study: Comparison) -> Finding:
    """F18: OKID follows the exchange better on every joint, SysID is worst on shoulder pitch."""
    # Without a record of the exchange it raises, and the finding cannot be told.
    study.campaign.log(RPCM)
    prediction_error, _ = study.multivariable.pair()
    lead = _okid_lead(study, RPCM)
    verdict_parts: dict[str, bool] = {}
    # Simulated, SysID's shoulder pitch with its K of zero is on equal terms; one step ahead it loses by construction.
    judged: dict[Way, tuple[str, ...]] = {"one_step": STUDIED_JOINTS, "simulation": (SHOULDER,)}
    for way, joints in judged.items():
        does = "predicts" if way == "one_step" else "simulates"
        for joint in joints:
            verdict_parts[f"OKID {does} better on {joint}"] = ahead(lead[way][joint])
        fits = prediction_error.fit(RPCM).of(way)
        leads_over_shoulder = [fits[joint] - fits[SHOULDER] for joint in (YAW, ELBOW)]
        verdict_parts[f"SysID {does} worst on {SHOULDER}"] = all(map(ahead, leads_over_shoulder))
    values = _values_by_name(lead)
    facts = {"reach": within_reach(study, (RPCM,))}
    return decided_finding("F18", verdict_parts, values, facts | remarks(study, values))


def exchange_residuals(study: Comparison) -> Finding:
    """F19: which residuals of the exchange are white, and how long yaw's depend on the input."""
    study.campaign.log(RPCM)
    white = CLAIMS["F19"].limits["white"]
    tests = {model.kind: model.residual_test(RPCM) for model in study.multivariable.pair()}
    outside = {kind: outside_share(test) for kind, test in tests.items()}
    prediction_error, okid = outside["SysID"], outside["OKID"]
    verdict_parts = {
        "SysID white on yaw": prediction_error[YAW] <= white,
        "SysID white on elbow pitch": prediction_error[ELBOW] <= white,
        "SysID not white on shoulder pitch": prediction_error[SHOULDER] > white,
        "OKID white on yaw": okid[YAW] <= white,
        "OKID white on shoulder pitch": okid[SHOULDER] <= white,
        "OKID less white on elbow pitch": okid[ELBOW] > max(okid[YAW], okid[SHOULDER]),
    }
    values: dict[str, float] = {}
    for kind, shares in outside.items():
        values |= {f"{kind} {joint}": 100 * share for joint, share in shares.items()}
    for kind, test in tests.items():
        early, late = dependence(test)
        name = f"{kind} yaw and its input"
        verdict_parts[name] = early > 0 and late <= white
        values |= {f"{name}, lags 1 to 14": 100 * early, f"{name}, lags 15 to 25": 100 * late}
    # Both models were tested on the same record, hence with the same bounds.
    facts = {"samples": len(test.residuals), "bound": test.whiteness_bound, "friction": _without_friction(study)}
    return decided_finding("F19", verdict_parts, values, facts)


def _without_friction(study: Comparison) -> str:
    """Describe the whiteness of residuals without friction, of models identified without it; empty where not played."""
    frictionless = study.campaigns[1]
    if RPCM not in frictionless.logs:
        return ""
    chosen_methods = {joint: result.chosen.method for joint, result in study.joints.items()}
    lags_outside: list[int] = []
    for methods in (chosen_methods, dict.fromkeys(study.joints, "okid")):
        blocks = []
        for joint, method in methods.items():
            record = single_joint_test(study.estimation_test, joint)
            model = study.frictionless[joint].find(record, method)
            if model is None:
                return ""
            blocks.append(model.estimate.model)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            test = sysid.resid(block_diagonal(blocks), frictionless.several(RPCM), lags=LAGS, level=LEVEL)
        lags_outside += [round(LAGS * share) for share in outside_share(test).values()]
    return (
        f"models of the arm without friction, on its own exchange, have {min(lags_outside)} to {max(lags_outside)} of "
        f"{LAGS} lags outside"
    )


def fast_chirp(study: Comparison) -> Finding:
    """F20: OKID follows the 5 to 10 Hz chirp better; the pitch inputs couple slightly into yaw's residuals."""
    data, limits = study.campaign.several(FAST_CHIRP), CLAIMS["F20"].limits
    lead = _okid_lead(study, FAST_CHIRP)
    verdict_parts = {f"OKID ahead on {joint}": ahead(points) for joint, points in lead["one_step"].items()}
    leads = _values_by_name(lead)
    values = dict(leads)
    shares = []
    for model, inputs in zip(study.multivariable.pair(), ([1], [1, 2]), strict=True):
        beyond, share = beyond_yaw(data.u, inputs)
        shares.append(share)
        # The axes share a waveform: a pitch input with next to nothing of its own cannot show coupling.
        if share >= limits["own"]:
            correlation, bound = largest_correlation(residuals(model.model, data)[:, 0], beyond, data.dt)
            values[f"yaw residual, {model.kind}"] = correlation
            # The limit is a share of the residual's variance, which is the square of the correlation.
            verdict_parts[f"slight coupling, {model.kind}"] = bound < correlation <= np.sqrt(limits["slight"])
    # With the yaw's own command at rest, its motion is what the pitches push.
    pitch_commands = data.u * [0.0, 1.0, 1.0]
    yaw_from_pitches = sysid.simulate(study.multivariable.truth, pitch_commands)[:, 0]
    coupled = 100 * float(np.std(yaw_from_pitches) / np.std(data.y[:, 0]))
    facts = {"share": 100 * min(shares), "coupled": coupled, "reach": within_reach(study, (FAST_CHIRP,))}
    return decided_finding("F20", verdict_parts, values, facts | remarks(study, leads))


def slow_data(study: Comparison) -> Finding:
    """F21: on data of low frequency SysID is ahead on yaw and the hybrid model is best."""
    study.campaign.log(SLOW)
    pair, hybrid = study.multivariable.pair(), study.multivariable.model("hybrid").fit(SLOW)
    points: dict[Way, dict[str, float]] = {}
    readings = {}
    for way, okid_lead in _okid_lead(study, SLOW).items():
        yaw_lead = -okid_lead[YAW]
        hybrid_lead = hybrid.mean(way) - max(model.fit(SLOW).mean(way) for model in pair)
        points[way] = {"yaw": yaw_lead, "hybrid": hybrid_lead}
        readings[WORDS[way]] = {"SysID ahead on yaw": ahead(yaw_lead), "hybrid best": ahead(hybrid_lead)}
    # The sweep starts at 0 Hz, but no model was excited at 0.05 Hz: there they extrapolate.
    lowest = np.array([0.05])
    yaw_responses = [model.blocks[YAW].frequency_response(lowest) for model in pair]
    gains = [np.abs(response[0, 0, 0]) for response in yaw_responses]
    facts = {"gains": gains, "true": study.joints[YAW].truth.dc_gain, "reach": within_reach(study, (SLOW,))}
    values = _values_by_name(points)
    return finding_by_reading("F21", readings, values, facts | remarks(study, values))


def follows_5_hz(study: Comparison) -> Finding:
    """F22: cutoff about 1 Hz, yet the models follow 3 to 5 Hz content."""

    def fits(joint: str, way: Way) -> dict[tuple[Kind, str], float]:
        """Fits by kind of model and record."""
        by_model: dict[tuple[Kind, str], float] = {}
        for kind in KINDS:
            for record, fit in fits_to_records(study, kind, joint, MIDDLE, way).items():
                by_model[kind, record] = fit
        return by_model

    def worst_fit(joint: str, way: Way) -> float:
        return min(fits(joint, way).values())

    shares = []
    for joint in study.joints:
        (kind, record), fit = min(fits(joint, "simulation").items(), key=lambda item: item[1])
        missing = missing_fit_shares(study, joint, record, fit)
        listed = ", ".join(f"{cause} {minus(f'{points:z.1f}')}" for cause, points in missing.items())
        largest = max(missing, key=lambda cause: missing[cause])
        shares.append(f"{words(joint)} of {kind} on {record} {fit:.0f} %: {listed}, most of it {largest}")
    cutoffs = []
    for result in study.joints.values():
        cutoffs.append(f"{result.chosen.bandwidth_hz:.2f} and {result.models['okid'].bandwidth_hz:.2f}")
    facts = {"cutoffs": cutoffs, "shares": "; ".join(shares)}
    return _read_both_ways(study, "F22", worst_fit, lambda fit: fit > FOLLOWS, facts)


def above_5_hz(study: Comparison) -> Finding:
    """F23: above 5 Hz OKID is slightly better."""

    def lead(joint: str, way: Way) -> float:
        prediction_error = fits_to_records(study, "SysID", joint, FAST, way)
        okid = fits_to_records(study, "OKID", joint, FAST, way)
        return median(okid[record] - prediction_error[record] for record in prediction_error)

    def slightly_better(points: float) -> bool:
        return ahead(points) and points <= CLAIMS["F23"].limits["slightly"]

    return _read_both_ways(study, "F23", lead, slightly_better, {"reach": within_reach(study, FAST[1])})


def parsimony(study: Comparison) -> Finding:
    """F24: two states each do as well as five and three."""

    def lead(joint: str, way: Way) -> float:
        return held_out_fit(study, "OKID", joint, way) - held_out_fit(study, "SysID", joint, way)

    tolerated_loss = CLAIMS["F24"].limits["points"]
    prediction_error, okid = study.multivariable.pair()
    # With as many states on both sides nothing is saved, and a fit shows nothing of parsimony.
    saving = [joint for joint in study.joints if okid.blocks[joint].order < prediction_error.blocks[joint].order]
    by_way = _of_joints_by_way(study, lead)
    readings = {}
    for way in WAYS:
        parts = {"fewer states": okid.model.order < prediction_error.model.order}
        parts |= {joint: by_way[way][joint] >= -tolerated_loss for joint in saving}
        readings[WORDS[way]] = parts
    orders = []
    for model in (prediction_error, okid):
        orders.append("/".join(str(block.order) for block in model.blocks.values()))
    values = _values_by_name(by_way)
    return finding_by_reading("F24", readings, values, {"orders": orders, **remarks(study, values)})


def bias_and_outliers(study: Comparison) -> Finding:
    """F25: with a bias or outliers left in, SysID needs hardly more states, OKID needs more."""
    limits = CLAIMS["F25"].limits
    joints = tuple(study.robustness.judged_by)
    # A model has seen its own sequence: only other waveforms can judge how many states suffice.
    if not joints:
        raise MissingRecordError("no joint has a PRBS record and one of another waveform to judge by")
    fits_by_order = {(fits.joint, fits.method, fits.record): fits for fits in study.robustness.orders}

    def additional_states(joint: str, method: str, record: str) -> int:
        """States that suffice on a disturbed record beyond those of the detrended one."""
        clean, disturbed = fits_by_order[joint, method, DETRENDED], fits_by_order[joint, method, record]
        # Both are judged by the best fit of the clean record: a disturbance shall not lower the bar.
        best_fit = max(clean.fits.values())
        return disturbed.sufficient(best_fit, limits["points"]) - clean.sufficient(best_fit, limits["points"])

    values: dict[str, float] = {}
    verdict_parts: dict[str, bool] = {}
    for disturbance, record in (("bias", CONSTANT), ("outliers", OUTLIERS)):
        robust = sensitive = 0
        for joint in joints:
            prediction_error = additional_states(joint, "SysID", record)
            okid = additional_states(joint, "OKID", record)
            values[f"{disturbance}: SysID on {words(joint)}"] = prediction_error
            values[f"{disturbance}: OKID on {words(joint)}"] = okid
            robust += prediction_error <= limits["more"]
            sensitive += okid > prediction_error
        verdict_parts[f"SysID robust to {disturbance}"] = 2 * robust > len(joints)
        verdict_parts[f"OKID sensitive to {disturbance}"] = 2 * sensitive > len(joints)
    return decided_finding("F25", verdict_parts, values, {})


def coupling(study: Comparison) -> Finding:
    """F26: little coupling between the joints near the operating point."""
    study.campaign.log(RPCM)
    little = CLAIMS["F26"].limits["little"]
    _, faster = MIDDLE
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for statement, records in (("in the exchange", (RPCM,)), ("at 3 to 5 Hz", faster)):
        for joint, share in _largest_pushes(study, records).items():
            verdict_parts[f"{statement} on {joint}"] = share <= little
            values[f"{joint}, {statement}"] = 100 * share
    uncoupled, coupled = (study.multivariable.reference(kind, RPCM) for kind in (DIAGONAL, COUPLED))
    worth = max(coupled[joint] - uncoupled[joint] for joint in uncoupled)
    facts = {"worth": worth, **_largest_gain_ratio(study)}
    return decided_finding("F26", verdict_parts, values | _gain_ratios(study), facts)


def pushed_share(study: Comparison, record: str) -> dict[str, float]:
    """Share of each joint's motion in a record that the other joints' commands make by the truth, root mean square."""
    data = study.campaign.several(record)
    shares = {}
    for channel, joint in enumerate(STUDIED_JOINTS):
        commands = data.u.copy()
        # With its own command at rest, the motion of a joint is what the others push.
        commands[:, channel] = 0.0
        pushed = sysid.simulate(study.multivariable.truth, commands)[:, channel]
        shares[joint] = float(np.std(pushed) / np.std(data.y[:, channel]))
    return shares


def _largest_pushes(study: Comparison, records: Sequence[str]) -> dict[str, float]:
    """The largest `pushed_share` of each joint in some records; raises `MissingRecordError` without one of them."""
    largest = dict.fromkeys(STUDIED_JOINTS, 0.0)
    for record in records:
        for joint, share in pushed_share(study, record).items():
            largest[joint] = max(largest[joint], share)
    return largest


def _gain_ratios(study: Comparison) -> dict[str, float]:
    """Largest sums of the other commands' gains over the own one's, percent, band by band: coupling rises with it."""
    lowest_bandwidth = min(result.truth.bandwidth_hz for result in study.joints.values())
    bands = {
        "to the bandwidth": (CLAIMS["F26"].limits["from"], lowest_bandwidth),
        "3 to 5 Hz": (3.0, 5.0),
        "5 to 10 Hz": (5.0, 10.0),
    }
    ratios: dict[str, float] = {}
    for name, band in bands.items():
        for joint, share in pushed_by_others(study.multivariable.truth, band=band).items():
            ratios[f"{joint}, percent of the gain {name}"] = 100 * share
    return ratios


def _largest_gain_ratio(study: Comparison) -> dict[str, object]:
    """Where the others' gains are largest beside the own one, and what both are there."""
    low = CLAIMS["F26"].limits["from"]
    f = np.geomspace(low, 10.0, 200)
    gain = np.abs(study.multivariable.truth.frequency_response(f))
    own = np.diagonal(gain, axis1=1, axis2=2)
    others = gain.sum(axis=2) - own
    line, channel = np.unravel_index(int(np.argmax(others / own)), own.shape)
    return {
        "joint": words(STUDIED_JOINTS[channel]),
        "hz": float(f[line]),
        "ratio": float(100 * others[line, channel] / own[line, channel]),
        "own": float(own[line, channel]),
        "others": float(others[line, channel]),
        "own_low": float(own[0, channel]),
        "low": low,
    }


def _of_joints_by_way(study: Comparison, figure: Callable[[str, Way], float]) -> ByWay:
    by_way: dict[Way, dict[str, float]] = {}
    for way in WAYS:
        by_way[way] = {joint: figure(joint, way) for joint in study.joints}
    return by_way


def _okid_lead(study: Comparison, record: str) -> ByWay:
    """Fit of OKID less that of SysID to a record of several joints, percentage points."""
    prediction_error, okid = (model.fit(record) for model in study.multivariable.pair())
    return _of_joints_by_way(study, lambda joint, way: okid.of(way)[joint] - prediction_error.of(way)[joint])


def _values_by_name(values: ByWay) -> dict[str, float]:
    """The same numbers in one mapping, for a finding."""
    named: dict[str, float] = {}
    for way in WAYS:
        named |= {f"{name}, {words(way)}": value for name, value in values[way].items()}
    return named


def _read_both_ways(
    study: Comparison,
    key: str,
    figure: Callable[[str, Way], float],
    holds: Callable[[float], bool],
    facts: Mapping[str, object],
) -> Finding:
    """Decide a claim by a figure of every joint, in simulation and one step ahead."""
    by_way = _of_joints_by_way(study, figure)
    # The summary of the thesis (VI.6) does not say which fits it means.
    readings = {}
    for way in WAYS:
        readings[WORDS[way]] = {joint: holds(value) for joint, value in by_way[way].items()}
    values = _values_by_name(by_way)
    return finding_by_reading(key, readings, values, {**facts, **remarks(study, values)})
