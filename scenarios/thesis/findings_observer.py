"""Findings on OKID, F50 to F57 and F68: its observer, its fits and its order [Morris1996, ch. V]."""

import numpy as np

from scenarios.experiments.campaign import single_joint_test
from scenarios.thesis.comparison import Comparison, JointResult, ModelResult
from scenarios.thesis.finding import CLAIMS, Finding, Parts, decided_finding, finding_by_reading
from scenarios.thesis.findings_chapter_5 import markov_parameters_needed
from scenarios.thesis.multivariable import WAYS
from scenarios.thesis.observer_analysis import ORDER, P, Share, observer, observer_poles
from scenarios.thesis.response_differences import (
    agree,
    best_linear_at,
    differences_by_name,
    largest_differences,
    logarithmic_grid,
    response_of,
)
from scenarios.thesis.simulated_outputs import unchanged_fit
from scenarios.thesis.verdicts import WORDS, ahead
from sysid import Estimate, StateSpace

YAW, *PITCHES = ("shoulder_yaw", "shoulder_pitch", "elbow_pitch")

FADED = 2000
"""Lags after which a system with a pole of 0.99 has faded by nine orders of magnitude."""

CHIRP = 8
"""Number of the single-joint test with the chirp from 5 to 10 Hz [Morris1996, table 1]."""


def _okid(result: JointResult) -> ModelResult:
    return result.models["okid"]


def deadbeat(study: Comparison) -> Finding:
    """F50: OKID makes a deadbeat observer, all its eigenvalues at the origin."""
    values: dict[str, float] = {}
    printed: list[float] = []
    for joint, result in study.joints.items():
        values[joint] = _farthest_eigenvalue(_okid(result).estimate.model)
        for model in result.published:
            if model.method == "okid":
                printed.append(_farthest_eigenvalue(model.model))
    verdict_parts = {joint: modulus <= CLAIMS["F50"].limits["modulus"] for joint, modulus in values.items()}
    return decided_finding("F50", verdict_parts, values, {"moduli": list(values.values()), "printed": printed})


def _farthest_eigenvalue(model: StateSpace) -> float:
    return float(np.abs(observer_poles(model)).max())


def observer_decays_faster(study: Comparison) -> Finding:
    """F51: the observer's Markov parameters decay much faster than the system's."""
    limits = CLAIMS["F51"].limits
    many = int(limits["many"])
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, result in study.joints.items():
        record = study.campaign.own(joint)
        for p, model in ((P, _okid(result).estimate), (many, observer(record, ORDER, many))):
            ratio = decay_ratio(model)
            verdict_parts[f"with p = {p} on {joint}"] = ratio >= limits["times"]
            values[f"{joint}, p = {p}"] = ratio
    facts = {
        "cut": [values[f"{joint}, p = {P}"] for joint in study.joints],
        "ratios": [values[f"{joint}, p = {many}"] for joint in study.joints],
    }
    return decided_finding("F51", verdict_parts, values, facts)


def decay_ratio(model: Estimate) -> float:
    """Mean lag of the system's Markov parameters over the larger mean lag of its observer's, of input and output."""
    of_observer = []
    # Figure 50 shows both; the slower decides, since both are needed to realise the model.
    for name in ("observer_markov_u", "observer_markov_y"):
        of_observer.append(mean_lag(np.asarray(model.diagnostics[name])[:, 0, 0]))
    # Without the direct term, which stands at lag 0 in both.
    return mean_lag(model.model.markov(FADED)[1:, 0, 0]) / max(of_observer)


def mean_lag(parameters: np.ndarray) -> float:
    """Mean lag of parameters at lags 1, 2, ... (n,), weighted by their magnitudes: the inverse of a rate of decay."""
    magnitudes = np.abs(parameters)
    return float(np.sum(np.arange(1, len(magnitudes) + 1) * magnitudes) / np.sum(magnitudes))


def many_parameters(study: Comparison) -> Finding:
    """F52: the many independent Markov parameters of yaw come from its nonlinearity."""
    # Without friction nothing of weight is left that is not linear: what needs fewer there needed them for it.
    needed = {joint: markov_parameters_needed(study.campaign.own(joint)) for joint in study.joints}
    smooth = {joint: markov_parameters_needed(study.campaigns[1].own(joint)) for joint in study.joints}
    verdict_parts = {f"more than {joint}": needed[YAW] > needed[joint] for joint in PITCHES}
    verdict_parts["fewer without friction"] = smooth[YAW] < needed[YAW]
    values = {joint: float(count) for joint, count in needed.items()}
    values |= {f"{joint}, without friction": float(count) for joint, count in smooth.items()}
    facts = {"needed": [str(count) for count in needed.values()], "smooth": [str(count) for count in smooth.values()]}
    return decided_finding("F52", verdict_parts, values, facts)


def valid_below_1_hz(study: Comparison) -> Finding:
    """F53: the OKID estimate of yaw is valid below 1 Hz only."""
    limits = CLAIMS["F53"].limits
    result = study.joints[YAW]
    differences = {}
    bands = {"below 1 Hz": (limits["low"], limits["middle"]), "above 1 Hz": (limits["middle"], limits["high"])}
    for name, band in bands.items():
        f = logarithmic_grid(*band)
        response = response_of(_okid(result).estimate.model, f)
        differences[name] = largest_differences(response, best_linear_at(result, f))
    verdict_parts = {
        "valid below": agree(differences["below 1 Hz"], limits),
        "not above": not agree(differences["above 1 Hz"], limits),
    }
    values: dict[str, float] = {}
    for name, difference in differences.items():
        values |= differences_by_name(name, difference)
    facts = {"below": differences["below 1 Hz"], "above": differences["above 1 Hz"]}
    return decided_finding("F53", verdict_parts, values, facts)


def predicts_own_record(study: Comparison) -> Finding:
    """F54: OKID predicts its own record of yaw extremely well."""
    result = study.joints[YAW]
    fit = _okid(result).fits[study.estimation_test]
    still = unchanged_fit(result.data[study.estimation_test])
    well = CLAIMS["F54"].limits["well"]
    readings = {
        WORDS["simulation"]: {"extremely well": fit.simulation >= well},
        WORDS["one_step"]: {
            "extremely well": fit.one_step >= well,
            # A prediction one step ahead is good by itself where the angle moves little in a sample.
            "better than no motion": ahead(fit.one_step - still),
        },
    }
    values = {"simulation": fit.simulation, "one step": fit.one_step, "no motion": still}
    return finding_by_reading("F54", readings, values, {"still": still, "fits": (fit.simulation, fit.one_step)})


def follows_the_chirp(study: Comparison) -> Finding:
    """F55: OKID follows the chirp of yaw from 5 to 10 Hz well, with very low residuals."""
    study.campaign.log(single_joint_test(CHIRP, YAW))
    limits = CLAIMS["F55"].limits
    result = study.joints[YAW]
    fit = _okid(result).fits[CHIRP]
    values = {"simulation": fit.simulation, "one step": fit.one_step}
    readings = {}
    for way in WAYS:
        percent = getattr(fit, way)
        readings[WORDS[way]] = {"good": percent > limits["good"], "very low residuals": percent >= limits["low"]}
    facts = {"still": unchanged_fit(result.data[CHIRP]), "fits": (fit.simulation, fit.one_step)}
    return finding_by_reading("F55", readings, values, facts)


def not_the_kalman_filter(study: Comparison) -> Finding:
    """F56: the identified observer is not the Kalman filter, since its residuals are not white."""
    tests = {joint: _okid(result).residual_test for joint, result in study.joints.items()}
    verdict_parts = {joint: not test.white[0] for joint, test in tests.items()}
    values = {joint: float(test.whiteness_p[0]) for joint, test in tests.items()}
    return decided_finding("F56", verdict_parts, values, {"p": list(values.values())})


def higher_orders_fit_better(study: Comparison) -> Finding:
    """F57: higher orders of OKID would fit the pitches better."""
    readings: dict[str, Parts] = {}
    values: dict[str, float] = {}
    for way in WAYS:
        parts: dict[str, bool] = {}
        for joint in PITCHES:
            fits = _fits_by_order(study.observers[joint].shares, way)
            # The best of them: the thesis says that some higher order may fit better, not which.
            lead = max(fit for order, fit in fits.items() if order > ORDER) - fits[ORDER]
            parts[joint] = ahead(lead)
            values[f"{joint}, {way.replace('_', ' ')}"] = lead
        readings[WORDS[way]] = parts
    return finding_by_reading("F57", readings, values, {})


def second_order_suffices(study: Comparison) -> Finding:
    """F68: second-order systems describe each joint, and no less."""
    points = CLAIMS["F68"].limits["points"]
    readings: dict[str, Parts] = {}
    values: dict[str, float] = {}
    for way in WAYS:
        parts: dict[str, bool] = {}
        for joint, analysis in study.observers.items():
            fits = _fits_by_order(analysis.shares, way)
            best = max(fits.values())
            name = f"{joint}, {way.replace('_', ' ')}"
            parts[f"two suffice on {joint}"] = best - fits[ORDER] <= points
            parts[f"one does not on {joint}"] = best - fits[1] > points
            values |= {f"{name}, best less two": best - fits[ORDER], f"{name}, two less one": fits[ORDER] - fits[1]}
        readings[WORDS[way]] = parts
    return finding_by_reading("F68", readings, values, {})


def _fits_by_order(shares: tuple[Share, ...], way: str) -> dict[int, float]:
    """Fits to the own record by number of states, percent."""
    return {share.order: float(getattr(share, way)) for share in shares}
