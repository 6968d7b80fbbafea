"""Chapter III is judged by the thesis' own estimates, and what they cannot know is said."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.thesis import findings_chapter_3 as chapter
from scenarios.thesis.nonparametric import GRID
from scenarios.truth.published import BREAK_FREQUENCY, PUBLISHED
from sysid import FrequencyResponse, simulate
from sysid.models.bandwidth import HALF_POWER, gain_crossing
from tests.scenarios.thesis.altered import with_log


def _gain(values):
    return FrequencyResponse(GRID.copy(), np.asarray(values, dtype=complex)[:, None, None], 0.02, "model")


def test_slope_is_that_of_the_order():
    for order in (1, 2):
        falling = _gain((GRID / 0.8) ** -order / np.sqrt(2))
        assert chapter.gain_slope(falling) == pytest.approx(-20.0 * order, abs=0.5)
    assert np.isnan(chapter.gain_slope(_gain(np.where(GRID < 3.0, 1.0, 0.1)))), "the cutoff lies above 10 rad/s"
    assert np.isnan(chapter.gain_slope(_gain(np.ones(len(GRID)))))


def test_resonances_are_peaks_above_10_rad_per_second():
    smooth = 1.0 / (1.0 + GRID)
    low, high = (1.0 + 3.0 * np.exp(-(((GRID - at) / 0.2) ** 2)) for at in (1.0, 6.0))
    assert len(chapter._resonances(_gain(smooth))) == 0
    assert len(chapter._resonances(_gain(smooth * low))) == 0
    (peak,) = chapter._resonances(_gain(smooth * high))
    assert GRID[peak] == pytest.approx(6.0, abs=0.1)
    assert len(chapter._resonances(_gain(smooth * (1.0 + 0.1 * high)))) == 0, "less than 3 dB"


def test_a_second_order_system_is_steeper_than_a_first_order_one_with_its_cutoff():
    w = 2 * np.pi * GRID
    for gain, steeper in (
        (1 / np.hypot(1.0, w / 6.0), False),
        (1 / np.hypot(1.0, w / 6.5) / np.hypot(1.0, w / 35.0), True),
    ):
        response = _gain(gain)
        cutoff = gain_crossing(response, HALF_POWER)
        assert (chapter.gain_slope(response) < chapter.first_order_slope(cutoff) - 0.05) == steeper
    assert np.isnan(chapter.first_order_slope(2.0)), "the cutoff lies above 10 rad/s"


def test_the_cutoff_on_the_lines_is_near_that_of_the_best_linear_truth(study):
    decided = chapter.gain_and_cutoff(study)
    assert all(f"cutoff on {joint.replace('_', ' ')} {chapter.LINES}" in decided.parts for joint in study.joints)
    for name, entry in study.joints.items():
        lowest, best = entry.spa.frequencies[0], entry.best_linear.half_power_hz
        cutoff = decided.value.get(f"{name}, PRBS lines", 2 * np.pi * lowest) / (2 * np.pi)
        # Friction takes another share of a binary sequence than of a multisine as strong.
        assert 0.5 < cutoff / max(best, lowest) < 2.0


def test_printed_models_that_cross_at_the_spectra_s_breaks_are_computed():
    same, other = chapter.printed_breaks()
    for label, joint in (
        ("OE (4.8)", "shoulder_yaw"),
        ("OE (4.10)", "shoulder_pitch"),
        ("ARMAX (4.12)", "elbow_pitch"),
    ):
        (model,) = (one for one in PUBLISHED if one.label == label)
        f = np.linspace(0.5, 2.0, 3001)
        crossing = 2 * np.pi * f[np.argmax(np.abs(model.model.frequency_response(f)[:, 0, 0]) < HALF_POWER)]
        assert round(crossing) == BREAK_FREQUENCY[joint]
        assert same[label] == pytest.approx(crossing, abs=0.005)
    assert len(same) == 3 and same.keys() | other.keys() == {model.label for model in PUBLISHED}


def test_peaks_of_the_two_sines_are_leakage(study):
    value = chapter.slope(study).value
    for joint in study.joints:
        assert value[f"{joint}, two sines, peaks where the input is weak"] == value[f"of {joint}, two sines"] > 0


@pytest.mark.parametrize("strong", [True, False])
def test_a_peak_is_weak_only_where_the_input_is(study, strong):
    joint = study.joints["elbow_pitch"]
    f = joint.spa.frequencies
    rippled = 1.0 / (1.0 + f) * (1.0 + 3.0 * np.exp(-(((f - 5.0) / 0.4) ** 2)))
    power = np.where((f > 4.0) & (f < 6.0), 1.0 if strong else 1e-6, 1.0)
    for response, count in ((rippled, 1), (1.0 / (1.0 + f), 0)):
        spa = replace(joint.spa, response=response[:, None, None] + 0j, input_spectrum=power[:, None, None] + 0j)
        other = replace(study, joints={**study.joints, "elbow_pitch": replace(joint, spa=spa)})
        value = chapter.slope(other).value
        assert value["of elbow_pitch, PRBS lines"] == count
        assert value["elbow_pitch, PRBS lines, peaks where the input is weak"] == (0 if strong else count)


@pytest.mark.parametrize(
    ("yaw", "pitches", "expected"),
    [(9, 2, "reproduced by construction"), (3, 1, "not reproduced"), (3, 6, "not reproduced")],
)
def test_the_peak_of_the_correlation_of_the_pitches_decides_on_the_delay(study, yaw, pitches, expected):
    entries = {}
    for joint, entry in study.nonparametric.items():
        values = np.zeros_like(entry.delay.correlations)
        values[yaw if joint == "shoulder_yaw" else pitches] = 1.0
        entries[joint] = replace(entry, delay=replace(entry.delay, correlations=values))
    assert chapter.delay(replace(study, nonparametric=entries)).verdict == expected


def commanded(study, command):
    """The study with another command in every PRBS test, repeated (N,)."""
    joints = {}
    for joint, entry in study.joints.items():
        own = entry.data[study.estimation_test]
        u = np.resize(command, len(own))
        joints[joint] = replace(entry, data={**entry.data, study.estimation_test: replace(own, u=u - u.mean())})
    return replace(study, joints=joints)


def test_an_exactly_repeating_white_command_with_small_peaks_passes(study):
    rng = np.random.default_rng(5)
    white = rng.choice([-1.0, 1.0], 300)
    assert chapter.prbs_looks_white(commanded(study, white)).verdict == "reproduced"
    never = chapter.prbs_looks_white(commanded(study, rng.choice([-1.0, 1.0], 5000)))
    assert never.verdict == "partly"
    assert "fails: periodic on every joint" in never.why
    echo = chapter.prbs_looks_white(commanded(study, np.tile(white[:30], 10)))
    assert "fails: small peaks on every joint" in echo.why
    assert chapter.correlation(np.array([1.0, -1.0, 1.0, -1.0]), [0, 1, 2]) == pytest.approx([1.0, -1.0, 1.0])


def test_what_the_window_leaks_does_not_count_where_the_input_has_power():
    line = (np.abs(GRID - 2.5) < 0.1).astype(float)
    leaked = 0.01 * (1.0 - line)
    densities = {
        "input_spectrum": line - 0.001 * (1.0 - line),
        "output_spectrum": 100.0 * line + leaked,
        "noise_spectrum": 0.001 * line + leaked,
    }
    response = FrequencyResponse(GRID.copy(), np.ones((len(GRID), 1, 1), dtype=complex), 0.02, "spa")
    spectrum = replace(response, **{name: density[:, None, None] + 0j for name, density in densities.items()})
    kept = chapter.frequency_masks(spectrum)
    assert kept[chapter.WHOLE].all()
    np.testing.assert_array_equal(kept[chapter.POWERED], line > 0)
    assert chapter.orders_below(spectrum, kept[chapter.POWERED]) == pytest.approx(5.0)
    assert chapter.orders_below(spectrum, kept[chapter.WHOLE]) < 3.0


def test_both_readings_are_told_with_their_numbers(study):
    for finding in (chapter.pulse_spectra, chapter.sinusoid_disturbance):
        decided = finding(study)
        assert len(decided.value) == len(decided.parts)
        assert np.isfinite(list(decided.value.values())).all()
        assert chapter.WHOLE in decided.why
        assert chapter.POWERED in decided.why
    orders = chapter.sinusoid_disturbance(study).value
    for joint in study.joints:
        assert orders[f"{joint}, input's power"] > orders[f"{joint}, all frequencies"]


def test_what_does_not_repeat_is_a_part_of_the_departure(study):
    for entry in study.joints.values():
        measurement, departure, random = chapter.disturbances(study, entry)
        assert measurement > 0.0
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
    true[:, column] = np.roll(angle, -1)  # the bus reads the elbow one sample late
    measured[:, column] = angle + 5e-4 * rng.standard_normal(len(ticks))
    other = with_log(study, test.name, replace(log, true_angles=true, measured=measured))
    decided = chapter.disturbances(other, entry)
    assert decided == pytest.approx((5e-4, np.hypot(1e-3, 2e-4), 2e-4), rel=0.1)
