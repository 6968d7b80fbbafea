"""Findings on prediction-error structures, F40 to F49: noise, orders, fits and responses [Morris1996, ch. IV]."""

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.files.errors import MissingRecordError
from scenarios.thesis.campaign import OTHER_WAVEFORMS
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.estimates import estimate, simulation_fit
from scenarios.thesis.every_data_set import DataSetModel
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, words
from scenarios.thesis.findings_chapter_4 import COMPARED, DISMISSED, best, comparison_text, flexibility, friction_text
from scenarios.thesis.nonparametric import SINES
from scenarios.thesis.response_differences import (
    agree,
    best_linear_at,
    differences_by_name,
    largest_differences,
    logarithmic_grid,
    response_of,
)
from scenarios.thesis.robustness import DETRENDED
from scenarios.thesis.simulated_outputs import crossing_distance, peak_share, simulated
from scenarios.thesis.verdicts import ahead

YAW = "shoulder_yaw"

WITHOUT_THE_PAIR = (4, 2, 3, 2)
"""na, nb, nc, nk of the thesis' ARMAX of yaw with one pole and one zero less."""

SINE_FREQUENCIES = np.array([2.5, 10.0])
"""Frequencies of the two sines of test 4, Hz."""


def _estimation_model(study: Comparison, joint: str, method: str) -> DataSetModel:
    """The model of a method from the estimation test; raises `MissingRecordError` where there is none."""
    model = study.data_sets[joint].find(single_joint_test(study.estimation_test, joint), method)
    if model is None:
        raise MissingRecordError(f"{words(joint)}: no {method.upper()} model from the estimation test")
    return model


def noise_characterized(study: Comparison) -> Finding:
    """F40: ARX and IV4 do not characterize the noise sufficiently, ARMAX does."""
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint in study.joints:
        for method in (*DISMISSED, "armax"):
            test = _estimation_model(study, joint, method).residual_test
            white = bool(test.white[0])
            if method == "armax":
                verdict_parts[f"ARMAX white on {joint}"] = white
            else:
                verdict_parts[f"{method.upper()} not white on {joint}"] = not white
            values[f"{joint}, {method.upper()}"] = float(test.whiteness_p[0])
    return decided_finding("F40", verdict_parts, values, {})


def better_structures(study: Comparison) -> Finding:
    """F41: on yaw only ARMAX and OE fit better among many data sets."""
    fits = flexibility(study, YAW)
    verdict_parts: dict[str, bool] = {}
    for method in COMPARED:
        for rival in DISMISSED:
            name, rival_name = method.upper(), rival.upper()
            verdict_parts[f"{name} ahead of {rival_name}"] = best(fits, name, rival_name)
    return decided_finding("F41", verdict_parts, fits, {"compared": comparison_text(fits, "ARMAX")})


def yaw_most_nonlinear(study: Comparison) -> Finding:
    """F42: yaw is the most nonlinear joint, and needs a higher order for it."""
    distortion = {joint: result.best_linear.distortion_percent for joint, result in study.joints.items()}
    states: dict[str, int] = {}
    for fits in study.robustness.orders:
        if (fits.method, fits.record) == ("SysID", DETRENDED):
            states[fits.joint] = fits.sufficient(max(fits.fits.values()), CLAIMS["F42"].limits["points"])
    missing = [words(joint) for joint in study.joints if joint not in states]
    if missing:
        raise MissingRecordError(f"no record of {', '.join(missing)} to judge orders by")
    # Distortion does not depend on the seed; the orders that suffice do.
    pitches = [joint for joint in study.joints if joint != YAW]
    verdict_parts = {"most nonlinear": distortion[YAW] > max(distortion[joint] for joint in pitches)}
    for joint in pitches:
        verdict_parts[f"more states than on {joint}"] = states[YAW] > states[joint]
    values = {f"{joint}, distortion": percent for joint, percent in distortion.items()}
    values |= {f"{joint}, states": count for joint, count in states.items()}
    return decided_finding("F42", verdict_parts, values, {})


def yaw_armax_best(study: Comparison) -> Finding:
    """F43: on yaw ARMAX does not follow its own record very well, but is the best on other data sets."""
    fits = flexibility(study, YAW)
    # Figure 42 compares the model output, not a prediction from the measurement.
    own = _estimation_model(study, YAW, "armax").own.simulation
    verdict_parts = {
        "own record not followed": own <= CLAIMS["F43"].limits["follows"],
        "best on others": best(fits, "ARMAX", "OE"),
    }
    values = {"own record": own, **fits}
    return decided_finding("F43", verdict_parts, values, {"compared": comparison_text(fits, "ARMAX")})


def yaw_without_the_pair(study: Comparison) -> Finding:
    """F44: without the close pole and zero the yaw ARMAX does not characterize the joint sufficiently."""
    data = study.joints[YAW].data
    judges = [data[test] for test in OTHER_WAVEFORMS if test in data]
    if not judges:
        raise MissingRecordError("no record of yaw of another waveform than the estimation test")
    smaller = estimate(data[study.estimation_test], "armax", WITHOUT_THE_PAIR)
    # Both by the same function and on the same records, so that only the pair differs.
    with_pair = simulation_fit(study.joints[YAW].models["armax"].estimate, judges)
    without = simulation_fit(smaller, judges)
    # Two unstable models are level; their difference would be NaN.
    lead = with_pair - without if with_pair != without else 0.0
    facts = {"with_pair": with_pair, "without": without}
    return decided_finding("F44", {"behind without the pair": ahead(lead)}, {"points": lead}, facts)


def yaw_oe_independent(study: Comparison) -> Finding:
    """F45: the residuals of the yaw OE stay within the bounds of independence of the input."""
    test = study.joints[YAW].models["oe"].residual_test
    facts = {
        "outside": int(test.outside_independence[0, 0]),
        "friction": friction_text(study, YAW, "oe", "independence_p"),
    }
    values = {"independence p": float(test.independence_p[0, 0])}
    return decided_finding("F45", {"independent": bool(test.independent[0, 0])}, values, facts)


def yaw_oe_follows_the_mean(study: Comparison) -> Finding:
    """F46: the yaw OE follows the mean of the PRBS record, not its peaks, and fits it better than ARMAX."""
    result = study.joints[YAW]
    record = result.data[study.estimation_test]
    share = peak_share(record.y[:, 0], simulated(result.models["oe"].estimate.model, record))
    fits = {method: result.models[method].fits[study.estimation_test].simulation for method in COMPARED}
    # An unstable ARMAX has a fit of minus infinity, far behind.
    verdict_parts = {
        "peaks missed": share <= CLAIMS["F46"].limits["peaks"],
        "better than ARMAX": ahead(fits["oe"] - fits["armax"]),
    }
    values = {"share of the peaks": share, "OE less ARMAX": fits["oe"] - fits["armax"]}
    return decided_finding("F46", verdict_parts, values, {"share": share, **fits})


def yaw_oe_at_10_hz(study: Comparison) -> Finding:
    """F47: on two sines the yaw OE is right at zero crossings and misses the peaks, as its gain is below one."""
    study.campaign.log(single_joint_test(SINES, YAW))
    limits = CLAIMS["F47"].limits
    result = study.joints[YAW]
    record, model = result.data[SINES], result.models["oe"].estimate.model
    output = simulated(model, record)
    distance, share = crossing_distance(record.y[:, 0], output), peak_share(record.y[:, 0], output)
    gains = np.abs(response_of(model, SINE_FREQUENCIES))
    verdict_parts = {
        "right at crossings": distance <= limits["sample"],
        "peaks missed": share <= limits["peaks"],
        "gain below one": bool((gains < 1.0).all()),
    }
    values = {
        "samples from a crossing": distance,
        "share of the peaks": share,
        "gain at 2.5 Hz": gains[0],
        "gain at 10 Hz": gains[1],
    }
    true = np.abs(best_linear_at(result, SINE_FREQUENCIES)).tolist()
    return decided_finding("F47", verdict_parts, values, {"true": true, "distance": distance, "share": share})


def structures_agree(study: Comparison) -> Finding:
    """F48: the Bode plots of ARMAX, OE and ARX agree."""
    limits = CLAIMS["F48"].limits
    f = logarithmic_grid(limits["low"], limits["high"])
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint in study.joints:
        armax = response_of(_estimation_model(study, joint, "armax").estimate.model, f)
        for method in ("oe", "arx"):
            response = response_of(_estimation_model(study, joint, method).estimate.model, f)
            differences = largest_differences(response, armax)
            verdict_parts[f"{method.upper()} on {joint}"] = agree(differences, limits)
            values |= differences_by_name(f"{joint}, {method.upper()}", differences)
    return decided_finding("F48", verdict_parts, values, {})


def linear_enough(study: Comparison) -> Finding:
    """F49: about the operating point the joints are linear enough for linear models."""
    distortion = {joint: result.best_linear.distortion_percent for joint, result in study.joints.items()}
    limit = 100 * CLAIMS["F49"].limits["small"]
    verdict_parts = {joint: percent <= limit for joint, percent in distortion.items()}
    return decided_finding("F49", verdict_parts, distortion, {"percent": list(distortion.values())})
