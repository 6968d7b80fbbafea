"""Chapter III is judged by the thesis' own estimates, and what they cannot know is said."""

from dataclasses import replace

import control
import numpy as np
import pytest

from scenarios.thesis import findings_chapter_3 as chapter
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.nonparametric import GRID
from sysid import FrequencyResponse, c2d, simulate


def _gain(values: np.ndarray) -> FrequencyResponse:
    return FrequencyResponse(GRID.copy(), np.asarray(values, dtype=complex)[:, None, None], 0.02, "model")


def test_slope_is_that_of_the_order() -> None:
    for order in (1, 2):
        falling = _gain((GRID / 0.8) ** -order / np.sqrt(2))
        assert chapter._slope(falling) == pytest.approx(-20.0 * order, abs=0.5)
    assert np.isnan(chapter._slope(_gain(np.where(GRID < 3.0, 1.0, 0.1)))), "the cutoff lies above 10 rad/s"
    assert np.isnan(chapter._slope(_gain(np.ones(len(GRID)))))


def test_resonances_are_peaks_above_10_rad_per_second() -> None:
    smooth = 1.0 / (1.0 + GRID)
    low, high = (1.0 + 3.0 * np.exp(-(((GRID - at) / 0.2) ** 2)) for at in (1.0, 6.0))
    assert chapter._resonances(_gain(smooth)) == 0
    assert chapter._resonances(_gain(smooth * low)) == 0
    assert chapter._resonances(_gain(smooth * high)) == 1
    assert chapter._resonances(_gain(smooth * (1.0 + 0.1 * high))) == 0, "less than 3 dB"


def test_the_two_sines_cannot_show_the_cutoff_but_the_prbs_does(study: Comparison) -> None:
    found = chapter.gain_and_cutoff(study)
    assert found.verdict == "partly"
    assert isinstance(found.value, dict)
    for name, entry in study.joints.items():
        near = found.value[f"{name}, PRBS lines"]
        assert near == pytest.approx(2 * np.pi * entry.truth.bandwidth_hz, rel=0.15)
        tones = found.value.get(f"{name}, two sines", 0.0)
        assert abs(tones - near) > 0.2 * near


def test_peaks_of_the_two_sines_are_leakage(study: Comparison) -> None:
    found = chapter.slope(study)
    assert "the truth has 0 resonances" in found.why
    assert found.verdict == "partly"


def test_the_command_is_white_only_when_made_so(study: Comparison) -> None:
    found = chapter.prbs_looks_white(study)
    assert isinstance(found.value, dict)
    for name in study.joints:
        assert found.value[f"{name}, as recorded"] > chapter.WHITE > found.value[f"{name}, made white"]
    assert found.verdict == "partly"


def test_known_disturbances_are_those_put_in(study: Comparison) -> None:
    for entry in study.joints.values():
        measurement, departure, random = chapter.disturbances(study, entry)
        assert 5e-5 < measurement < 2e-4, "resolver noise and rounding, rad"
        assert random < departure


def test_what_departs_from_the_truth_is_told_into_what_repeats_and_what_does_not(study: Comparison) -> None:
    """A joint that is the truth itself, with a known wave and known noise added."""
    entry = study.joints["elbow_pitch"]
    test = entry.data[study.estimation_test]
    log = study.logs[test.name]
    column = 3
    rng = np.random.default_rng(2)
    ticks = np.arange(len(log.commanded))
    angle = simulate(entry.truth.model, log.commanded[:, column] - log.commanded[0, column])[:, 0]
    angle = angle + 1e-3 * np.sqrt(2) * np.sin(2 * np.pi * ticks / 100) + 2e-4 * rng.standard_normal(len(ticks))
    true, measured = log.true_angles.copy(), log.measured.copy()
    true[:, column] = angle
    measured[:, column] = angle + 5e-4 * rng.standard_normal(len(ticks))
    other = replace(log, true_angles=true, measured=measured)
    campaign = replace(study.campaign, logs={**study.logs, test.name: other})
    found = chapter.disturbances(replace(study, campaigns=(campaign, *study.campaigns[1:])), entry)
    assert found == pytest.approx((5e-4, np.hypot(1e-3, 2e-4), 2e-4), rel=0.1)


def test_a_second_order_servo_has_no_40_decibel_near_its_break() -> None:
    servo = c2d(control.tf([6.5], [1.0, 6.5]) * control.tf([35.0], [1.0, 35.0]), 0.02)
    assert -20.0 < chapter._slope(_gain(np.abs(servo.frequency_response(GRID)[:, 0, 0]))) < -10.0
