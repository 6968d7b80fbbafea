"""What the records say without a model is what is known of the twin."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin.parameters.values import HAND_CONTROLLER, SAMPLE_RATE
from scenarios.experiments.registry import load
from scenarios.files.errors import MissingRecordError
from scenarios.record_figures.period_spectra import excited_lines, period_spectra
from scenarios.thesis.nonparametric import GRID, PULSE, SINES, half_power, nonparametric, summary
from sysid import FrequencyResponse, IOData, StateSpace, simulate
from tests.refusals import refused

SERVO = StateSpace(
    np.array([[0.9, 0.1], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)), None, 0.02
)
"""One pole and two samples of delay."""


def _record(tones, noise=1e-4, wires=1e-3):
    rng = np.random.default_rng(5)
    time = 0.02 * np.arange(6000)
    u = sum(np.sin(2 * np.pi * f * time + k) for k, f in enumerate(tones)) + wires * rng.standard_normal(6000)
    y = simulate(SERVO, u)[:, 0] + noise * rng.standard_normal(6000)
    return IOData(u, y, 0.02)[200:].detrend()


def test_the_gain_between_the_tones_is_told_by_the_noise_of_the_wires():
    response = period_spectra(_record((2.5, 10.0), wires=0.03)).reliable_response()
    assert len(response.frequencies) > 20
    true = np.abs(SERVO.frequency_response(response.frequencies)[:, 0, 0])
    np.testing.assert_allclose(response.magnitude[:, 0, 0], true, rtol=0.2)
    silent = period_spectra(_record((2.5, 10.0), wires=0.0)).reliable_response()
    np.testing.assert_allclose(silent.frequencies, [2.5, 10.0])


def test_long_blocks_bring_the_gain_and_the_disturbance_near_what_is_put_in():
    """Between the tones the joint answers noise of before the block; a short block counts that as disturbance."""
    data = _record((2.5, 10.0), wires=0.03)
    long, short = period_spectra(data), period_spectra(data[:1100])
    assert (long.periods, short.periods) == (56, 11)
    floor = 1e-8 * 0.02
    low = long.frequencies < 2.0
    assert floor < long.disturbance[low].mean() < 0.4 * short.disturbance[low].mean()


def test_intervals_of_the_told_gain_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(8)
    u = np.tile(rng.standard_normal(100), 60)
    held = []
    for _ in range(20):
        y = simulate(SERVO, u)[:, 0] + 0.3 * rng.standard_normal(6000)
        response = period_spectra(IOData(u, y, 0.02)[200:]).reliable_response()
        low, high = response.magnitude_ci95()
        true = np.abs(SERVO.frequency_response(response.frequencies)[:, 0, 0])
        held.append(np.mean((low[:, 0, 0] < true) & (true < high[:, 0, 0])))
    assert 0.90 < np.mean(held) < 0.99


def test_power_is_where_the_tones_and_their_images_by_the_hold_are(study):
    held = SAMPLE_RATE / HAND_CONTROLLER.hold
    images = np.array([2.5, 10.0])[:, None] + held * np.arange(HAND_CONTROLLER.hold)
    tones = np.abs((images.ravel() + SAMPLE_RATE / 2) % SAMPLE_RATE - SAMPLE_RATE / 2)
    for estimates in study.nonparametric.values():
        near = np.min(np.abs(GRID[:, None] - tones), axis=1) <= 1.5 * estimates.resolution_hz[SINES]
        played = np.isclose(GRID, 2.5) | np.isclose(GRID, 10.0)
        assert excited_lines(estimates.spectra[SINES])[played].all()
        power = estimates.spectra[SINES].input_spectrum[:, 0, 0].real
        assert power[played].min() > 30.0 * np.median(power[~near]), "elsewhere there are leakage and noise"


def test_pulse_response_is_that_of_the_truth_where_nothing_rubs(study):
    for joint, entry in study.joints.items():
        true = entry.truth.model.markov(20)[:, 0, 0]
        rough, smooth = (
            np.sqrt(np.mean((nonparametric(joint, campaign, summaries=False).pulse.response[:20, 0, 0] - true) ** 2))
            for campaign in study.campaigns
        )
        assert smooth < 0.15 * true.max()
        assert smooth < rough


def test_every_record_that_repeats_often_enough_has_a_row(study):
    names = {name for name in study.logs if name.startswith("mimo-")}
    assert len(names) == 15
    for joint, estimates in study.nonparametric.items():
        own = {f"siso-{n}-{joint}" for n in range(1, 9)}
        enough = {name for name in names | own if len(study.campaign.record(name, joint)) >= 3 * load(name).period}
        assert set(estimates.tests) == enough
        row = estimates.tests[f"siso-5-{joint}"]
        assert row.half_power_hz == pytest.approx(study.joints[joint].models["oe_high"].half_power_hz, rel=0.35)
        assert 0.0 < row.disturbance_percent < 1.0


def test_periods_are_those_of_the_waveforms_as_the_hold_samples_them():
    assert load("siso-5-shoulder_yaw").period == np.lcm(100, HAND_CONTROLLER.hold)
    assert load("siso-2-shoulder_yaw").period == np.lcm(200, HAND_CONTROLLER.hold), "1.25 Hz takes 4 s for five cycles"


def test_a_row_says_what_was_put_in():
    record = _record((0.5, 1.0, 1.5, 2.0, 3.0), noise=0.01, wires=0.0)
    row = summary(record)
    true = SERVO.bandwidth()[0, 0]
    assert row.half_power_hz == pytest.approx(true, rel=0.1)
    assert len(period_spectra(record).reliable_response().frequencies) == 5
    tone = summary(_record((5.0,), wires=0.0))
    turn = -np.angle(SERVO.frequency_response(np.array([5.0]))[0, 0, 0]) / (2 * np.pi * 5.0 * 0.02)
    assert tone.peak_lag == round(turn % 10)
    assert tone.half_power_hz is None


def test_a_crossing_needs_known_lines_close_by():
    def response(f, gain):
        return FrequencyResponse(np.array(f), np.array(gain, dtype=complex)[:, None, None], 0.02, "etfe")

    assert half_power(response([0.5, 1.0, 2.0], [0.9, 0.8, 0.5])) == pytest.approx(1.2, abs=0.1)
    assert half_power(response([0.5, 5.0], [0.9, 0.1])) is None
    assert half_power(response([2.5, 10.0], [0.4, 0.1])) is None
    assert half_power(response([0.5, 1.0], [0.9, 0.8])) is None


def test_a_missing_record_is_left_out_and_only_the_prbs_is_needed(study):
    joint = "elbow_pitch"
    kept = {name: log for name, log in study.logs.items() if name in (f"siso-5-{joint}", f"siso-4-{joint}")}
    estimates = nonparametric(joint, replace(study.campaign, logs=kept), summaries=False)
    assert set(estimates.spectra) == {SINES}
    assert PULSE not in estimates.repeated
    assert not estimates.tests
    with pytest.raises(MissingRecordError, match="siso-5-elbow_pitch"):
        nonparametric(joint, replace(study.campaign, logs={}))


def test_period_spectra_refuse_several_channels():
    refused("given 2 and 1", period_spectra, IOData(np.zeros((600, 2)), np.zeros(600), 0.02))
