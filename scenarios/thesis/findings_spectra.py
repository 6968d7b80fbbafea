"""Findings on nonparametric estimates, F32 to F39, and on models beside them [Morris1996, ch. III, sec. IV.1]."""

import numpy as np
from scipy.signal import find_peaks

from scenarios.experiments.campaign import single_joint_test
from scenarios.experiments.model_structures import SUFFICIENT
from scenarios.experiments.registry import load
from scenarios.record_figures.period_spectra import excited_lines
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import CLAIMS, Finding, decided_finding, finding_by_reading
from scenarios.thesis.findings_chapter_3 import (
    LINES,
    SHORT,
    TONES,
    response_estimates,
    spectrum_of,
)
from scenarios.thesis.findings_chapter_4 import COMPARED
from scenarios.thesis.nonparametric import GRID, PRBS, PULSE, SINES, period_spectra
from scenarios.thesis.response_differences import (
    agree,
    best_linear_at,
    differences_by_name,
    error_percent,
    largest_differences,
    response_of,
)
from sysid import FrequencyResponse
from sysid.models.bandwidth import HALF_POWER, gain_crossing

TEST_NAMES = {SINES: "two sines", PRBS: "PRBS", PULSE: "pulse"}
"""Waveforms of the tests that chapter III rests on."""

RELIABLE = "averaged over the periods of the PRBS"
"""Reading of claims on nonparametric estimates, beside the thesis' own."""

NAMES = {TONES: SHORT[TONES], RELIABLE: "PRBS periods"}
"""Short names of the readings, used in keys of numbers."""


def other_modes(study: Comparison) -> Finding:
    """F32: lobes of the cross-spectra show other modes of the system."""
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    powered_lobes = lobe_count = resonance_count = 0
    for joint, result in study.joints.items():
        resonances = GRID[_peaks(np.abs(response_of(result.truth.model, GRID)))]
        resonance_count += len(resonances)
        for test in (PULSE, SINES):
            spectrum = spectrum_of(study, test, joint)
            resolution = study.nonparametric[joint].resolution_hz[test]
            lobes, powered = cross_spectrum_lobes(spectrum)
            # A window widens a line by its resolution: a lobe may lie that far from the mode that makes it.
            modes = _near(lobes, resonances, resolution)
            lobe_count += len(lobes)
            powered_lobes += int(powered.sum())
            name = TEST_NAMES[test]
            verdict_parts[f"lobes of the {name} on {joint}"] = len(lobes) > 0
            verdict_parts[f"modes by the {name} on {joint}"] = bool(modes.any())
            values |= {f"{joint}, {name}, at a resonance": modes.sum(), f"of {joint}, {name}": len(lobes)}
    facts = {"resonances": resonance_count, "own": powered_lobes, "lobes": lobe_count}
    return decided_finding("F32", verdict_parts, values, facts)


def cross_spectrum_lobes(spectrum: FrequencyResponse) -> tuple[np.ndarray, np.ndarray]:
    """Return the frequencies, Hz, of the peaks of the cross-spectrum above 5 Hz, and whether the input has power there.

    Power is what stands above the side lobes of the window.
    """
    if spectrum.input_spectrum is None:
        raise ValueError("the spectral estimate has no input spectrum")
    input_power = spectrum.input_spectrum[:, 0, 0].real
    # The response is the ratio of the two; where a lag window leaves no input power there is none.
    told = np.isfinite(spectrum.response[:, 0, 0]) & (input_power > 0.0)
    cross = np.abs(spectrum.response[told, 0, 0]) * input_power[told]
    # Densities are powers: their roots have the decibels of a gain.
    lobes = _peaks(np.sqrt(cross))
    above = spectrum.frequencies[told][lobes] > CLAIMS["F32"].limits["above"]
    return spectrum.frequencies[told][lobes][above], excited_lines(spectrum)[told][lobes][above]


def _peaks(magnitude: np.ndarray) -> np.ndarray:
    """Indices of the peaks of a magnitude that stand out by the claim's limit, dB."""
    decibel = 20 * np.log10(np.maximum(magnitude, np.finfo(float).tiny))
    peaks, _ = find_peaks(decibel, prominence=CLAIMS["F32"].limits["resonance"])
    return np.asarray(peaks, dtype=int)


def _near(frequencies: np.ndarray, marks: np.ndarray, resolution: float) -> np.ndarray:
    """Whether each frequency (n,) lies within the resolution of one of the marks."""
    return np.asarray((np.abs(frequencies[:, None] - marks[None, :]) <= resolution).any(axis=1))


def order_from_correlation(study: Comparison) -> Finding:
    """F33: the peak of the correlation lies at as many samples as the joint has poles."""
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, estimates in study.nonparametric.items():
        peak = int(np.argmax(estimates.delay.correlations[:, 0, 0]))
        # Chosen on records without friction and of other seeds: not by the correlations that it is laid beside.
        _, poles, _ = SUFFICIENT[joint]
        verdict_parts[joint] = peak == poles
        values |= {f"{joint}, peak": peak, f"{joint}, poles": poles}
    facts = {
        "own": [result.truth.delay_samples for result in study.joints.values()],
        "peaks": [str(values[f"{joint}, peak"]) for joint in study.joints],
        "poles": [str(values[f"{joint}, poles"]) for joint in study.joints],
    }
    return decided_finding("F33", verdict_parts, values, facts)


def moderate_disturbances(study: Comparison) -> Finding:
    """F34: process and measurement disturbances are minor to moderate."""
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, estimates in study.nonparametric.items():
        for test, name in TEST_NAMES.items():
            # Raises without a record.
            study.campaign.log(single_joint_test(test, joint))
            share = estimates.repeated[test].disturbance_share
            verdict_parts[f"{name} on {joint}"] = share <= CLAIMS["F34"].limits["moderate"]
            values[f"{joint}, {name}"] = 100 * share
    return decided_finding("F34", verdict_parts, values, {"least": min(values.values()), "most": max(values.values())})


def bandwidth_needed(study: Comparison) -> Finding:
    """F35: models need a bandwidth of 1 to 5 Hz."""
    limits = CLAIMS["F35"].limits
    readings: dict[str, dict[str, bool]] = {TONES: {}, LINES: {}}
    values: dict[str, float] = {}
    for joint in study.joints:
        for reading, response in response_estimates(study, joint).items():
            cutoff = gain_crossing(response, HALF_POWER)
            readings[reading][joint] = limits["low"] <= cutoff <= limits["high"]
            values[f"{joint}, {SHORT[reading]}"] = cutoff
    return finding_by_reading("F35", readings, values, {})


def error_sources(study: Comparison) -> Finding:
    """F36: random errors come from nonlinearities, bias errors from the resolution of the spectra."""
    limits = CLAIMS["F36"].limits
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, result in study.joints.items():
        # The same sequence and the same noise, played on the arm without friction.
        smooth = study.campaigns[1].own(joint)
        left = period_spectra(smooth, load(single_joint_test(PRBS, joint)).period).disturbance.sum()
        ratio = float(left / study.nonparametric[joint].repeated[PRBS].disturbance.sum())
        response = response_estimates(study, joint)[TONES]
        estimate, truth = response.response[:, 0, 0], best_linear_at(result, response.frequencies)
        powered = excited_lines(response)
        # Between the two lines the estimate is leakage of the window, which is what resolution means here.
        weak_error = error_percent(estimate[~powered], truth[~powered])
        times = weak_error / error_percent(estimate[powered], truth[powered])
        verdict_parts[f"random errors on {joint}"] = ratio <= limits["half"]
        verdict_parts[f"bias errors on {joint}"] = times >= limits["times"]
        values |= {f"{joint}, random": ratio, f"{joint}, bias": times}
    return decided_finding("F36", verdict_parts, values, {})


def coloured_noise(study: Comparison) -> Finding:
    """F37: what models of the dynamics alone leave is coloured."""
    tests = {joint: result.models["oe_high"].residual_test for joint, result in study.joints.items()}
    verdict_parts = {joint: not test.white[0] for joint, test in tests.items()}
    values = {joint: float(test.whiteness_p[0]) for joint, test in tests.items()}
    return decided_finding("F37", verdict_parts, values, {"p": list(values.values())})


def nonparametric_estimates(study: Comparison, joint: str) -> dict[str, FrequencyResponse]:
    """The thesis' own estimate, and the best there is: averaged over the periods of the PRBS, at reliable lines."""
    return {
        TONES: response_estimates(study, joint)[TONES],
        RELIABLE: study.nonparametric[joint].repeated[PRBS].reliable_response(),
    }


def parametric_more_accurate(study: Comparison) -> Finding:
    """F38: parametric models are more accurate than nonparametric estimates."""
    limits = CLAIMS["F38"].limits
    readings: dict[str, dict[str, bool]] = {TONES: {}, RELIABLE: {}}
    values: dict[str, float] = {}
    for joint, result in study.joints.items():
        models = {"SysID": result.chosen, "OKID": result.models["okid"]}
        for reading, response in nonparametric_estimates(study, joint).items():
            band = (response.frequencies >= limits["low"] - 1e-9) & (response.frequencies <= limits["high"] + 1e-9)
            f = response.frequencies[band]
            truth = best_linear_at(result, f)
            nonparametric = error_percent(response.response[band, 0, 0], truth)
            values[f"{joint}, {NAMES[reading]}"] = nonparametric
            for kind, model in models.items():
                error = error_percent(response_of(model.estimate.model, f), truth)
                readings[reading][f"{kind} on {joint}"] = error < nonparametric
                values[f"{joint}, {kind} there, {NAMES[reading]}"] = error
    return finding_by_reading("F38", readings, values, {})


def agrees_with_nonparametric(study: Comparison) -> Finding:
    """F39: the ARMAX and OE models agree with the nonparametric results."""
    limits = CLAIMS["F39"].limits
    verdict_parts: dict[str, bool] = {}
    values: dict[str, float] = {}
    for joint, result in study.joints.items():
        response = nonparametric_estimates(study, joint)[RELIABLE]
        band = (response.frequencies >= limits["low"] - 1e-9) & (response.frequencies <= limits["high"] + 1e-9)
        f, estimate = response.frequencies[band], response.response[band, 0, 0]
        for method in COMPARED:
            differences = largest_differences(response_of(result.models[method].estimate.model, f), estimate)
            verdict_parts[f"{method.upper()} on {joint}"] = agree(differences, limits)
            values |= differences_by_name(f"{joint}, {method.upper()}", differences)
    return decided_finding("F39", verdict_parts, values, {})
