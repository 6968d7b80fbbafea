"""Findings on the models of three joints, F58 to F67 and F69: truth, fits and residuals [Morris1996, ch. VI, VII]."""

import numpy as np

import sysid
from hmtb_twin import STUDIED_JOINTS, linearize, load_arm
from scenarios.experiments.campaign import RPCM
from scenarios.thesis.campaign import plays_identified_sequence
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import fits
from scenarios.thesis.finding import CLAIMS, Finding, Parts, decided_finding, finding_by_reading, words
from scenarios.thesis.multivariable import FAST_CHIRP, LAGS, LEVEL, WAYS
from scenarios.thesis.record_fits import remarks, ties, within_reach
from scenarios.thesis.response_differences import (
    agree,
    best_linear_at,
    differences_by_name,
    error_percent,
    largest_differences,
    logarithmic_grid,
    response_of,
)
from scenarios.thesis.simulated_outputs import peak_share, simulated
from scenarios.thesis.verdicts import WORDS, ahead, dependence, outside_share

YAW, SHOULDER, ELBOW = STUDIED_JOINTS


def captured_the_truth(study: Comparison) -> Finding:
    """F58: both models captured the true frequency characteristics of each joint."""
    limits = CLAIMS["F58"].limits
    f = logarithmic_grid(limits["low"], limits["high"])
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    excited = f >= limits["excited"]
    held = 0
    for joint, result in study.joints.items():
        truth = best_linear_at(result, f)
        for model in study.multivariable.pair():
            response = response_of(model.blocks[joint], f)
            differences = largest_differences(response, truth)
            verdict_parts[f"{model.kind} on {joint}"] = agree(differences, limits)
            values |= differences_by_name(f"{joint}, {model.kind}", differences)
            held += agree(largest_differences(response[excited], truth[excited]), limits)
    return decided_finding("F58", verdict_parts, values, {"held": held, "count": len(verdict_parts)})


def near_the_origin(study: Comparison) -> Finding:
    """F59: a pole and a zero near the origin show the SysID model to be unnecessarily complex."""
    prediction_error, _ = study.multivariable.pair()
    near = CLAIMS["F59"].limits["near"]
    with_pole: list[str] = []
    with_zero: list[str] = []
    pole_count = zero_count = 0
    for joint, block in prediction_error.blocks.items():
        poles, zeros = int((np.abs(block.poles()) <= near).sum()), int((np.abs(block.zeros()) <= near).sum())
        pole_count, zero_count = pole_count + poles, zero_count + zeros
        if poles:
            with_pole.append(words(joint))
        if zeros:
            with_zero.append(words(joint))
    # The map of the three joints shows roots of all of them: only within a joint do they cancel.
    both = [joint for joint in with_pole if joint in with_zero]
    verdict_parts = {
        "pole and zero near the origin": bool(with_pole and with_zero),
        "of the same joint": bool(both),
    }
    values = {"poles": pole_count, "zeros": zero_count, "joints with both": len(both)}
    where = f"Poles there: {', '.join(with_pole) or 'none'}; zeros there: {', '.join(with_zero) or 'none'}"
    return decided_finding("F59", verdict_parts, values, {"where": where})


def exchange_matched(study: Comparison) -> Finding:
    """F60: which outputs of the exchange each model matches."""
    return _matched(study, "F60", RPCM)


def chirp_matched(study: Comparison) -> Finding:
    """F62: which outputs of the chirp from 5 to 10 Hz each model matches."""
    return _matched(study, "F62", FAST_CHIRP)


def _matched(study: Comparison, key: str, record_name: str) -> Finding:
    """Decide a claim on the fits of both models to a record, in simulation and one step ahead."""
    limits = CLAIMS[key].limits
    record = study.campaign.record(record_name, SHOULDER)
    prediction_error, okid = study.multivariable.pair()
    share = peak_share(record.y[:, 0], simulated(prediction_error.blocks[SHOULDER], record))
    readings: dict[str, Parts] = {}
    values: dict[str, float] = {}
    for way in WAYS:
        of_prediction_error, of_okid = prediction_error.fit(record_name).of(way), okid.fit(record_name).of(way)
        parts = {f"SysID on {joint}": of_prediction_error[joint] > limits["quite"] for joint in (YAW, ELBOW)}
        # With K = 0 the output one step ahead is the simulated one.
        parts[f"SysID misses peaks on {SHOULDER}"] = share <= limits["peaks"]
        for joint, fit in of_okid.items():
            parts[f"OKID on {joint}"] = fit >= limits["very"]
        readings[WORDS[way]] = parts
        for kind, fits_by_joint in (("SysID", of_prediction_error), ("OKID", of_okid)):
            values |= {f"{kind} on {joint}, {words(way)}": fit for joint, fit in fits_by_joint.items()}
    values[f"SysID on {SHOULDER}, share of the peaks"] = share
    facts = {"reach": within_reach(study, (record_name,))}
    return finding_by_reading(key, readings, values, facts | remarks(study, {}))


def due_to_output_error(study: Comparison) -> Finding:
    """F61: the residuals of SysID's shoulder pitch come from the OE structure."""
    record = study.campaign.record(RPCM, SHOULDER)
    models = {method: study.joints[SHOULDER].models[method].estimate.model for method in ("armax", "oe")}
    outside: dict[str, int] = {}
    simulation: dict[str, float] = {}
    for method, model in models.items():
        outside[method] = int(sysid.resid(model, record, lags=LAGS, level=LEVEL).outside_whiteness[0])
        simulation[method] = fits(model, record).simulation
    # Simulated, neither is helped by a noise model: what is left is how well each structure holds the dynamics.
    lead = simulation["armax"] - simulation["oe"]
    verdict_parts = {
        "ARMAX whiter": outside["armax"] < outside["oe"],
        "ARMAX ahead in simulation": ahead(lead),
    }
    values = {
        "ARMAX less OE, simulation": lead,
        "ARMAX, lags outside": 100 * outside["armax"] / LAGS,
        "OE, lags outside": 100 * outside["oe"] / LAGS,
    }
    return decided_finding("F61", verdict_parts, values, {"lead": lead, **outside})


def chirp_residuals(study: Comparison) -> Finding:
    """F63: which residuals of the chirp are white, how large they are, and whether yaw's depend on the input."""
    # Raises with the reason where the record failed.
    study.campaign.log(FAST_CHIRP)
    white = CLAIMS["F63"].limits["white"]
    tests = {model.kind: model.residual_test(FAST_CHIRP) for model in study.multivariable.pair()}
    outside = {kind: outside_share(test) for kind, test in tests.items()}
    prediction_error, okid = outside["SysID"], outside["OKID"]
    # As figure 83 shows them: in angle, not relative to how far each joint moves.
    sizes = 1000 * tests["SysID"].residuals.std(axis=0)
    size_of = dict(zip(STUDIED_JOINTS, map(float, sizes), strict=True))
    verdict_parts = {
        f"SysID white on {YAW}": prediction_error[YAW] <= white,
        f"SysID white on {ELBOW}": prediction_error[ELBOW] <= white,
        f"SysID not white on {SHOULDER}": prediction_error[SHOULDER] > white,
        f"SysID's largest residual on {SHOULDER}": size_of[SHOULDER] > max(size_of[YAW], size_of[ELBOW]),
        f"OKID white on {SHOULDER}": okid[SHOULDER] <= white,
        f"OKID white on {ELBOW}": okid[ELBOW] <= white,
        f"OKID less white on {YAW}": okid[YAW] > max(okid[SHOULDER], okid[ELBOW]),
    }
    values: dict[str, float] = {}
    for kind, shares in outside.items():
        values |= {f"{kind} {joint}": 100 * share for joint, share in shares.items()}
    for kind, test in tests.items():
        early, _ = dependence(test)
        verdict_parts[f"{kind} yaw depends on the input"] = early > 0
        values[f"{kind} yaw and its input, lags 1 to 14"] = 100 * early
    values |= {f"SysID {joint}, mrad": size for joint, size in size_of.items()}
    # Both models were tested on the same record, hence with the same bounds.
    facts = {"samples": len(test.residuals), "bound": test.whiteness_bound}
    return decided_finding("F63", verdict_parts, values, facts)


def yaw_near_10_hz(study: Comparison) -> Finding:
    """F64: neither model characterizes yaw near 10 Hz."""
    limits = CLAIMS["F64"].limits
    f = logarithmic_grid(limits["low"], limits["high"])
    truth = best_linear_at(study.joints[YAW], f)
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    facts: dict[str, object] = {}
    for name, model in zip(("prediction_error", "okid"), study.multivariable.pair(), strict=True):
        differences = largest_differences(response_of(model.blocks[YAW], f), truth)
        verdict_parts[model.kind] = not agree(differences, limits)
        values |= differences_by_name(model.kind, differences)
        facts[name] = differences
    return decided_finding("F64", verdict_parts, values, facts)


def okid_more_accurate(study: Comparison) -> Finding:
    """F65: OKID is more accurate than SysID."""
    limits = CLAIMS["F65"].limits
    f = logarithmic_grid(limits["low"], limits["high"])
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, result in study.joints.items():
        truth = best_linear_at(result, f)
        errors = {}
        for model in study.multivariable.pair():
            errors[model.kind] = error_percent(response_of(model.blocks[joint], f), truth)
        verdict_parts[joint] = errors["OKID"] < errors["SysID"]
        values |= {f"{joint}, {kind}": error for kind, error in errors.items()}
    facts = {
        "prediction_error": [values[f"{joint}, SysID"] for joint in study.joints],
        "okid": [values[f"{joint}, OKID"] for joint in study.joints],
    }
    return decided_finding("F65", verdict_parts, values, facts)


def majority_of_records(study: Comparison) -> Finding:
    """F66: OKID fits a majority of the multi-input data sets better."""
    # The exchange has a verdict of its own, F18.
    names = [name for name in study.multivariable.records if name != RPCM and not plays_identified_sequence(name)]
    prediction_error, okid = study.multivariable.pair()
    readings: dict[str, Parts] = {}
    values: dict[str, float] = {}
    counted: list[str] = []
    for way in WAYS:
        leads = [okid.fit(name).mean(way) - prediction_error.fit(name).mean(way) for name in names]
        better, worse = sum(map(ahead, leads)), sum(ahead(-lead) for lead in leads)
        readings[WORDS[way]] = {"majority": 2 * better > len(names)}
        values |= {
            f"OKID ahead, {words(way)}": better,
            f"of, {words(way)}": len(names),
            f"SysID ahead, {words(way)}": worse,
        }
        counted.append(f"{WORDS[way]} OKID is ahead on {better} and SysID on {worse} of {len(names)} records")
    return finding_by_reading("F66", readings, values, {"counted": "; ".join(counted)})


def better_overall(study: Comparison) -> Finding:
    """F67: overall OKID gives the better multivariable model."""
    names = [name for name in study.multivariable.records if not plays_identified_sequence(name)]
    prediction_error, okid = study.multivariable.pair()
    errors = {"response error, SysID": 100 * prediction_error.error, "response error, OKID": 100 * okid.error}
    readings: dict[str, Parts] = {}
    leads: dict[str, float] = {}
    for way in WAYS:
        lead = np.mean([okid.fit(name).mean(way) - prediction_error.fit(name).mean(way) for name in names])
        leads[f"mean fit, {words(way)}"] = float(lead)
        readings[WORDS[way]] = {
            "better fit": ahead(float(lead)),
            "better response": okid.error < prediction_error.error,
        }
    return finding_by_reading("F67", readings, leads | errors, {"ties": ties(leads)})


def valid_locally(study: Comparison) -> Finding:
    """F69: the models are valid in a localized region and with one loading only."""
    limits = CLAIMS["F69"].limits
    f = logarithmic_grid(limits["low"], limits["high"])
    # Small-signal truths take milliseconds, and no friction hides what changes with pose and loading.
    arm = study.campaign.condition.arm()
    elsewhere = {
        "another loading": linearize(load_arm(arm.variant, "none"), amplitudes=()),
        "another pose": linearize(arm, "home", amplitudes=()),
    }
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    gains: list[float] = []
    phases: list[float] = []
    for joint, result in study.joints.items():
        truth = response_of(result.truth.model, f)
        for change, other_truth in elsewhere.items():
            differences = largest_differences(response_of(other_truth.joint(joint).model, f), truth)
            verdict_parts[f"{change} on {joint}"] = not agree(differences, limits)
            values |= differences_by_name(f"{joint}, {change}", differences)
            gains.append(differences[0])
            phases.append(differences[1])
    facts = {"decibel_found": max(gains), "degrees_found": max(phases)}
    return decided_finding("F69", verdict_parts, values, facts)
