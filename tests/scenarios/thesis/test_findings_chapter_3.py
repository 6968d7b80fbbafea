"""Chapter III is judged by the thesis' own estimates, and what they cannot know is said."""

from dataclasses import replace

import control
import numpy as np
import pytest

from scenarios.thesis import findings_chapter_3 as chapter
from scenarios.thesis.nonparametric import GRID
from scenarios.thesis.outcome import numbers
from sysid import FrequencyResponse, c2d, simulate
from tests.scenarios.thesis.altered import with_log


def _gain(values):
    return FrequencyResponse(GRID.copy(), np.asarray(values, dtype=complex)[:, None, None], 0.02, "model")


def test_slope_is_that_of_the_order():
    for order in (1, 2):
        falling = _gain((GRID / 0.8) ** -order / np.sqrt(2))
        assert chapter._slope(falling) == pytest.approx(-20.0 * order, abs=0.5)
    assert np.isnan(chapter._slope(_gain(np.where(GRID < 3.0, 1.0, 0.1)))), "the cutoff lies above 10 rad/s"
    assert np.isnan(chapter._slope(_gain(np.ones(len(GRID)))))


def test_resonances_are_peaks_above_10_rad_per_second():
    smooth = 1.0 / (1.0 + GRID)
    low, high = (1.0 + 3.0 * np.exp(-(((GRID - at) / 0.2) ** 2)) for at in (1.0, 6.0))
    assert len(chapter._resonances(_gain(smooth))) == 0
    assert len(chapter._resonances(_gain(smooth * low))) == 0
    (peak,) = chapter._resonances(_gain(smooth * high))
    assert GRID[peak] == pytest.approx(6.0, abs=0.1)
    assert len(chapter._resonances(_gain(smooth * (1.0 + 0.1 * high)))) == 0, "less than 3 dB"


def test_the_two_sines_cannot_show_the_cutoff_but_the_prbs_does(study):
    decided = chapter.gain_and_cutoff(study)
    assert decided.verdict == "partly"
    assert "not reproduced by the thesis' own estimate from two sines" in decided.why
    assert "on the lines of the PRBS" in decided.why
    for name, entry in study.joints.items():
        near = numbers(decided)[f"{name}, PRBS lines"]
        assert near == pytest.approx(2 * np.pi * entry.truth.bandwidth_hz, rel=0.15)
        tones = numbers(decided).get(f"{name}, two sines", 0.0)
        assert abs(tones - near) > 0.2 * near


def test_peaks_of_the_two_sines_are_leakage(study):
    decided = chapter.slope(study)
    assert "the truth has 0 resonances" in decided.why
    assert decided.verdict == "partly"
    sines = decided.why.split("Peaks seen: two sines ")[1].split(";")[0]
    counts, weak = sines.split(" by joint (")
    total = sum(map(int, counts.split(", ")))
    assert f"{total} of {total} where the input is weak" in f"{weak} where the input is weak"


def test_a_peak_is_weak_only_where_the_input_is(study):
    """Peaks on strong lines are not put down to weak ones, and where there is no peak nothing is said of it."""
    joint = study.joints["elbow_pitch"]
    own = joint.spa
    f = own.frequencies
    rippled = 1.0 / (1.0 + f) * (1.0 + 3.0 * np.exp(-(((f - 5.0) / 0.4) ** 2)))
    for strong in (True, False):
        power = np.where((f > 4.0) & (f < 6.0), 1.0 if strong else 1e-6, 1.0)
        spa = replace(own, response=rippled[:, None, None].astype(complex), input_spectrum=power[:, None, None] + 0j)
        other = replace(study, joints={**study.joints, "elbow_pitch": replace(joint, spa=spa)})
        before, after = (chapter.slope(s).why.split("PRBS lines")[-1] for s in (study, other))
        counts = [int(n) for n in after.split(" by joint")[0].split(", ")]
        assert counts[2] == 1
        assert before.split(" by joint")[0].split(", ")[:2] == after.split(" by joint")[0].split(", ")[:2]
        lone = replace(study, joints={"elbow_pitch": replace(joint, spa=spa)})
        assert f"({0 if strong else 1} of 1 where" in chapter.slope(lone).why
    calm = replace(
        study, joints={"elbow_pitch": replace(joint, spa=replace(own, response=1.0 / (1.0 + f)[:, None, None] + 0j))}
    )
    assert chapter.slope(calm).why.endswith("PRBS lines 0 by joint")


def test_the_delay_is_claimed_of_the_pitches_alone(study):
    assert chapter.delay(study).unit.endswith("the verdict rests on them")
    for yaw, pitches, expected in ((9, 2, "reproduced"), (3, 1, "not reproduced")):
        entries = {}
        for joint, entry in study.nonparametric.items():
            lag = yaw if joint == "shoulder_yaw" else pitches
            entries[joint] = replace(entry, delay=replace(entry.delay, correlation=np.array([[lag]])))
        assert chapter.delay(replace(study, nonparametric=entries)).verdict == expected


def test_peaks_of_the_correlation_have_to_be_small(study):
    """A command that is white but for a side peak of a given size."""

    def seen(peak):
        entries = {}
        for joint, entry in study.nonparametric.items():
            functions = {}
            for name in ("covariances", "whitened"):
                own = getattr(entry, name)
                values = np.zeros_like(own.values)
                values[:, 0, 0] = values[own.lags == 0, 1, 1] = 1.0
                values[np.abs(own.lags) == 100, 1, 1] = peak
                functions[name] = replace(own, values=values)
            entries[joint] = replace(entry, **functions)
        return chapter.prbs_looks_white(replace(study, nonparametric=entries)).verdict

    assert seen(0.3) == "reproduced"
    assert seen(0.99) == "partly"
    assert seen(0.0) == "partly"


def test_the_command_is_white_only_when_made_so(study):
    decided = chapter.prbs_looks_white(study)
    for name in study.joints:
        assert numbers(decided)[f"{name}, as recorded"] > chapter.WHITE > numbers(decided)[f"{name}, made white"]
        assert numbers(decided)[f"{name}, as recorded, side peak"] > chapter.SMALL, "a file repeats exactly"
    assert decided.verdict == "partly"


def test_known_disturbances_are_those_put_in(study):
    for entry in study.joints.values():
        measurement, departure, random = chapter.disturbances(study, entry)
        assert 5e-5 < measurement < 2e-4, "resolver noise and rounding, rad"
        assert random < departure


def test_what_departs_from_the_truth_is_told_into_what_repeats_and_what_does_not(study):
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
    other = with_log(study, test.name, replace(log, true_angles=true, measured=measured))
    decided = chapter.disturbances(other, entry)
    assert decided == pytest.approx((5e-4, np.hypot(1e-3, 2e-4), 2e-4), rel=0.1)


def test_a_second_order_servo_has_no_40_decibel_near_its_break():
    servo = c2d(control.tf([6.5], [1.0, 6.5]) * control.tf([35.0], [1.0, 35.0]), 0.02)
    assert -20.0 < chapter._slope(_gain(np.abs(servo.frequency_response(GRID)[:, 0, 0]))) < -10.0
