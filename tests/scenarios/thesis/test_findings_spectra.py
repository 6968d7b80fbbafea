"""F32 to F39: verdicts on nonparametric estimates, on studies of which the claim is true and of which it is not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import cont2discrete

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.model_structures import SUFFICIENT
from scenarios.thesis import findings_spectra as findings
from scenarios.thesis.findings_chapter_3 import LINES, TONES
from scenarios.thesis.nonparametric import GRID, PRBS, PULSE, SINES
from sysid import FrequencyResponse, StateSpace
from tests.scenarios.thesis.altered import whiteness, with_joints, with_model_of_joints, with_nonparametric

YAW = STUDIED_JOINTS[0]


def _resonant(hz):
    """A joint with a resonance of 14 dB, or none."""
    w = 2 * np.pi * hz
    damping = 0.1 if hz else 1.0
    w = w or 2 * np.pi
    matrices = ([[0, 1], [-(w**2), -2 * damping * w]], [[0], [w**2]], [[1, 0]], [[0]])
    a, b, c, d, _ = cont2discrete(tuple(map(np.array, matrices)), 0.02)
    return StateSpace(a, b, c, d, None, 0.02)


def _spectra(study, response, power):
    """The study with the same response and input spectrum in the two tests of chapter III."""

    def change(joint, estimates):
        spectra = {}
        for test in (PULSE, SINES):
            spectra[test] = replace(
                estimates.spectra[test], response=response[:, None, None] + 0j, input_spectrum=power[:, None, None] + 0j
            )
        return {"spectra": spectra}

    return with_nonparametric(study, change)


@pytest.mark.parametrize(
    ("lobe", "resonance", "verdict"),
    [(8.0, 8.0, "reproduced"), (8.0, 0.0, "partly"), (None, 0.0, "not reproduced"), (12.0, 8.0, "partly")],
)
def test_a_lobe_is_a_mode_where_the_truth_has_a_resonance(study, lobe, resonance, verdict):
    response = 1.0 / (1.0 + GRID)
    if lobe:
        response = response * (1.0 + 5.0 * np.exp(-(((GRID - lobe) / 0.3) ** 2)))
    truths = with_joints(study, lambda result: {"truth": replace(result.truth, model=_resonant(resonance))})
    # A finer resolution than that of the small study, to which 8 and 12 Hz are apart all the same.
    decided = findings.other_modes(_spectra(truths, response, np.ones(len(GRID))))
    assert decided.verdict == verdict
    if verdict == "partly":
        assert "6 of 6 lobes lie where the input stands above" in decided.why


def test_lobes_without_input_are_counted(study):
    """Of two lobes one lies where the input has a thousandth of its power, the other at the edge of that band."""
    power = np.where(np.abs(GRID - 9.0) < 2.0, 1e-3, 1.0)
    response = (1.0 + 5.0 * np.exp(-(((GRID - 9.0) / 0.3) ** 2))) / (1.0 + GRID)
    truths = with_joints(study, lambda result: {"truth": replace(result.truth, model=_resonant(0.0))})
    decided = findings.other_modes(_spectra(truths, response, power))
    assert decided.verdict == "partly"
    assert "6 of 12 lobes lie where the input stands above" in decided.why


def _peaks_at(study, lags):
    def change(joint, estimates):
        values = np.zeros_like(estimates.delay.correlations)
        values[lags[joint]] = 1.0
        return {"delay": replace(estimates.delay, correlations=values)}

    return with_nonparametric(study, change)


def test_the_peak_of_the_correlation_is_laid_beside_the_poles(study):
    poles = {joint: orders[1] for joint, orders in SUFFICIENT.items()}
    assert findings.order_from_correlation(_peaks_at(study, poles)).verdict == "reproduced"
    later = {joint: count + 1 for joint, count in poles.items()}
    assert findings.order_from_correlation(_peaks_at(study, later)).verdict == "not reproduced"
    assert findings.order_from_correlation(_peaks_at(study, {**later, YAW: poles[YAW]})).verdict == "partly"


@pytest.mark.parametrize(("share", "verdict"), [(0.02, "reproduced"), (0.5, "not reproduced")])
def test_a_tenth_of_the_power_is_moderate(study, share, verdict):
    def change(joint, estimates):
        repeated = {}
        for test, spectra in estimates.repeated.items():
            repeated[test] = replace(spectra, disturbance=share * spectra.output)
        return {"repeated": repeated}

    decided = findings.moderate_disturbances(with_nonparametric(study, change))
    assert decided.verdict == verdict
    assert decided.value[f"{YAW}, PRBS"] == pytest.approx(100 * share)


def _falling(cutoff):
    """A response that falls below 0.707 at a frequency, Hz."""
    f = np.arange(1, 50) * 0.2
    return FrequencyResponse(f, (1 / np.hypot(1, f / cutoff))[:, None, None] + 0j, 0.02, "spa")


@pytest.mark.parametrize(
    ("tones", "lines", "verdict"),
    [
        (1.0, 5.0, "reproduced by construction"),
        (0.5, 7.0, "not reproduced"),
        (1.5, 0.4, "depends on the reading"),
    ],
)
def test_cutoffs_decide_on_the_bandwidth_that_models_need(study, monkeypatch, tones, lines, verdict):
    estimates = {TONES: _falling(tones), LINES: _falling(lines)}
    monkeypatch.setattr(findings, "response_estimates", lambda study, joint: estimates)
    assert findings.bandwidth_needed(study).verdict == verdict


@pytest.mark.parametrize(
    ("left", "weak", "verdict"), [(0.1, 0.9, "reproduced"), (0.9, 0.9, "partly"), (0.9, 0.1, "not reproduced")]
)
def test_sources_of_error_are_told_by_switching_them(study, monkeypatch, left, weak, verdict):
    """Disturbance left without friction; relative error where the input is weak, 0.1 where it has power."""
    f = np.arange(1, 50) * 0.2
    power = np.where(f < 5.0, 1.0, 1e-6)
    response = np.where(f < 5.0, 1.1, 1.0 + weak)
    estimate = FrequencyResponse(f, response[:, None, None] + 0j, 0.02, "spa", input_spectrum=power[:, None, None] + 0j)
    monkeypatch.setattr(findings, "response_estimates", lambda study, joint: {TONES: estimate})
    monkeypatch.setattr(findings, "best_linear_at", lambda result, frequencies: np.ones(len(frequencies), complex))
    with_friction = {joint: entry.repeated[PRBS].disturbance for joint, entry in study.nonparametric.items()}
    monkeypatch.setattr(
        findings,
        "period_spectra",
        lambda record, period: SimpleNamespace(
            disturbance=left * with_friction[next(joint for joint in STUDIED_JOINTS if record.name.endswith(joint))]
        ),
    )
    decided = findings.error_sources(study)
    assert decided.verdict == verdict
    assert decided.value[f"{YAW}, random"] == pytest.approx(left)
    assert decided.value[f"{YAW}, bias"] == pytest.approx(10 * weak)


@pytest.mark.parametrize(("p", "verdict"), [(1e-5, "reproduced"), (0.3, "not reproduced")])
def test_residuals_of_the_dynamics_alone_decide_on_the_noise(study, p, verdict):
    assert findings.coloured_noise(with_model_of_joints(study, "oe_high", whiteness(p))).verdict == verdict


@pytest.mark.parametrize("better", [True, False])
def test_errors_to_the_best_linear_truth_decide_on_accuracy(study, monkeypatch, better):
    """The truth is the response of the models, or that of the estimate."""
    joint_models = {}

    def same_models(result):
        model = result.chosen
        joint_models[result.joint] = model.estimate.model
        okid = replace(result.models["okid"], estimate=model.estimate)
        return {"models": {**result.models, "okid": okid}}

    changed = with_joints(study, same_models)
    f = np.arange(1, 30) * 0.3
    flat = FrequencyResponse(f, np.full((len(f), 1, 1), 3.0 + 0j), 0.02, "spa")
    estimates = {TONES: flat, findings.RELIABLE: flat}
    monkeypatch.setattr(findings, "nonparametric_estimates", lambda study, joint: estimates)

    def truth(result, frequencies):
        of_model = joint_models[result.joint].frequency_response(frequencies)[:, 0, 0]
        return of_model if better else np.full(len(frequencies), 3.0 + 0j)

    monkeypatch.setattr(findings, "best_linear_at", truth)
    decided = findings.parametric_more_accurate(changed)
    assert decided.verdict == ("reproduced" if better else "not reproduced")


@pytest.mark.parametrize(("factor", "verdict"), [(1.2, "reproduced by construction"), (2.0, "not reproduced")])
def test_models_within_3_db_of_the_estimate_agree_with_it(study, monkeypatch, factor, verdict):
    f = np.arange(1, 12) * 0.5

    def estimates(study, joint):
        model = study.joints[joint].models["oe"].estimate.model
        return {findings.RELIABLE: FrequencyResponse(f, factor * model.frequency_response(f), 0.02, "spa")}

    monkeypatch.setattr(findings, "nonparametric_estimates", estimates)
    same = with_joints(
        study,
        lambda result: {
            "models": {**result.models, "armax": replace(result.models["armax"], estimate=result.models["oe"].estimate)}
        },
    )
    decided = findings.agrees_with_nonparametric(same)
    assert decided.verdict == verdict
    assert decided.value[f"{YAW}, OE, dB"] == pytest.approx(20 * np.log10(factor))
