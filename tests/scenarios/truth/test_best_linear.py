from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, kstest

from hmtb_twin import IDEAL, STUDIED_JOINTS, Chain, Plant, Specimen, linearize, load_arm
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import LARGE_MOTION
from hmtb_twin.parameters.variants import joint_index
from scenarios import load
from scenarios.experiments.campaign import Condition, campaign_scenario
from scenarios.experiments.multisines import MultisineExperiment, Multisines, multisine_experiments
from scenarios.experiments.preview import preview
from scenarios.truth.best_linear import best_linear, best_linear_as_needed, measured_best_linear
from scenarios.truth.bla_of_test import CLOSE, best_linear_of_test
from sysid import IOData
from sysid.frequency.bla import response_agreement
from tests.benchmarks.best_linear import QUIET, agreement
from tests.refusals import refused
from tests.user_arm import write_arm

SHORT = Multisines(realisations=8, period=5.12, f_min=0.1)
YAW = MultisineExperiment("yaw", ("shoulder_yaw",), chain=QUIET)


@pytest.mark.thorough
def test_without_friction_it_is_the_small_signal_truth_line_by_line():
    truth = linearize(load_arm(friction=False), amplitudes=())
    lines, seeds, held = zip(*(agreement(joint, 2, SHORT, truth) for joint in STUDIED_JOINTS), strict=True)
    p, whole = np.concatenate(lines), np.concatenate(seeds)
    assert kstest(p, "uniform").pvalue > 0.01
    low, high = binom.interval(0.99, len(p), 0.05)
    assert low <= np.sum(p < 0.05) <= high
    assert min(whole) > 0.01 / len(whole)
    assert sum(held) >= binom.ppf(0.01, len(whole), 0.95)


@pytest.mark.thorough
def test_the_test_would_see_a_bandwidth_that_is_off_by_two_percent():
    approximation = best_linear(YAW, SHORT)
    f = approximation.servo.response.frequencies
    model = approximation.small_signal.channel("shoulder_yaw", "shoulder_yaw")
    assert response_agreement(approximation.servo, model.frequency_response(f)).p_all.item() > 1e-3
    assert response_agreement(approximation.servo, model.frequency_response(f / 1.02)).p_all.item() < 1e-6


@pytest.mark.thorough
def test_several_joints_at_once_give_the_coupled_truth():
    setting = MultisineExperiment("mimo", ("shoulder_pitch", "elbow_pitch"), chain=QUIET)
    approximation = best_linear(setting, replace(SHORT, realisations=5), measured=("elbow_pitch", "shoulder_pitch"))
    assert approximation.servo.response.response.shape == (25, 2, 2)
    result = approximation.servo_agreement()
    np.testing.assert_array_less(1e-3, result.p_all)
    # The first row is the elbow's: its own command is the second input.
    assert np.abs(approximation.servo.response.response[0, 0]) @ [0, 1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_friction_takes_gain_and_bandwidth_away_and_shows_as_odd_distortion():
    noisy = replace(YAW, specimen=Specimen(resolver_noise=5.0))  # of a whole step, so that rounding is noise too
    setting = replace(noisy, chain=replace(QUIET, friction=True))
    approximation = best_linear(setting, Multisines(realisations=4, odd=True))
    departure = approximation.servo_agreement()
    assert departure.p_all.item() < 1e-9
    assert (20 * np.log10(np.abs(departure.ratio)))[:, 0, 0].mean() < -0.1
    assert approximation.bandwidth.ci95[1].item() < approximation.small_signal.joint("shoulder_yaw").bandwidth_hz
    assert approximation.distortion_percent.item() > 1.0
    assert approximation.silent.odd.item() > 10 * approximation.silent.even.item()
    quiet = best_linear(replace(noisy, name="sliding"), Multisines(realisations=4, odd=True))
    assert quiet.distortion_percent.item() < 0.3
    assert quiet.silent.odd.item() < 0.1 * approximation.silent.odd.item()
    # The recorder's own noise and rounding.
    assert quiet.silent.noise.item() == pytest.approx(1.04e-4 * np.sqrt(50 / 255), rel=0.05)


@pytest.mark.slow
def test_limits_and_rounding_lie_before_the_recorded_command():
    """What reaches the servo is recorded, so that its response is the truth; from the stick it is not."""
    limited = best_linear(
        replace(YAW, chain=replace(QUIET, velocity_limit=True)), replace(SHORT, rms=0.03, realisations=5)
    )
    assert limited.slewing > 0.3
    assert limited.servo_agreement().p_all.item() > 1e-3
    assert limited.agreement(limited.chain).p_all.item() < 1e-9
    assert (20 * np.log10(np.abs(limited.agreement(limited.chain).ratio)))[-3:].mean() < -3.0
    assert limited.command_rms.item() < 0.8 * 0.03
    rounded = best_linear(
        replace(YAW, chain=replace(QUIET, dac=True, adc=True)), replace(SHORT, rms=0.001, realisations=5)
    )
    assert rounded.servo_agreement().p_all.item() > 1e-3
    step = LARGE_MOTION.gain * LARGE_MOTION.adc_step
    uniform = step / np.sqrt(12.0)
    error = np.sqrt(np.abs(rounded.command_rms.item() ** 2 - 0.001**2))
    assert error < 2 * uniform


@pytest.mark.slow
def test_the_same_seeds_give_the_same_bits_on_any_number_of_threads():
    short = replace(SHORT, realisations=2)
    one, two, other = (
        best_linear(replace(YAW, seed=seed), short, threads=threads) for seed, threads in ((0, 1), (0, 2), (1, 1))
    )
    np.testing.assert_array_equal(one.servo.response.response, two.servo.response.response)
    assert not np.array_equal(one.servo.response.response, other.servo.response.response)


@pytest.mark.slow
def test_any_single_joint_experiment_is_a_setting():
    scenario = replace(load("siso-5-elbow_pitch"), payload="none", plant=Plant(friction_level=3.0), seed=9)
    scenario = replace(scenario, hand_controller=LARGE_MOTION)
    scenario = replace(scenario, specimen=Specimen(mass=(1.1,) * 8))
    records = multisine_experiments(scenario, SHORT)
    assert len({record.seed for record in records}) == len(records) == 8
    first = records[0]
    assert first.duration == SHORT.duration
    for name in ("axes", "payload", "plant", "specimen"):
        assert getattr(first, name) == getattr(scenario, name)
    approximation = best_linear(scenario, replace(SHORT, realisations=2))
    assert approximation.provenance["plant_friction_level"] == "3.0"
    assert approximation.provenance["multisines_rms"] == "0.01"
    assert approximation.small_signal.payload == "none"
    assert approximation.small_signal.specimen == scenario.specimen


def test_as_many_realisations_are_taken_as_the_interval_needs():
    rubbing = replace(YAW, chain=Chain())
    few = Multisines(rms=0.01, realisations=2, period=5.1, f_min=0.2)
    first, two = best_linear_as_needed(rubbing, few, most=2), best_linear(rubbing, few)
    np.testing.assert_array_equal(first.servo.response.response, two.servo.response.response)
    _, low, high = first.bandwidth.path()
    # Wide enough: none is added.
    assert best_linear_as_needed(rubbing, few, narrow=1.01 * high / low, most=8).experiment.multisines.realisations == 2
    more = best_linear_as_needed(rubbing, few, narrow=1.0, most=9)
    assert more.experiment.multisines.realisations == 8
    # Those that were added are those of a measurement that takes all at once, phases and noise.
    at_once = best_linear(rubbing, replace(few, realisations=8))
    np.testing.assert_array_equal(more.servo.response.response, at_once.servo.response.response)
    np.testing.assert_array_equal(more.chain.response.response, at_once.chain.response.response)


ONCE = "measured = .* given, expected one or more of shoulder_roll, .* each once"


@pytest.mark.parametrize(
    ("setting", "rms", "measured", "message"),
    [
        (replace(YAW, mode="single_joint_rate"), 0.01, None, "mode single_joint_rate given, expected single_joint"),
        (replace(YAW, shutdown=(1.0,)), 0.01, None, "emergency shutdown"),
        (
            replace(YAW, hand_controller=replace(LARGE_MOTION, hold=3), chain=replace(QUIET, hold=True)),
            *(0.01, None, "expected one whose hold divides the period of 256 samples"),
        ),
        (YAW, 0.5, None, "peaks of .* V; expected less than the converter's 10 V"),
        (replace(YAW, hand_controller=replace(LARGE_MOTION, deadband=1.0)), 0.01, None, "no power at the line"),
        *((YAW, 0.01, measured, ONCE) for measured in ("elbow_pitch", 5, (), ("elbow_pitch", "elbow_pitch"))),
    ],
)
def test_what_cannot_be_measured_is_refused(setting, rms, measured, message):
    refused(message, best_linear, setting, replace(SHORT, rms=rms, realisations=2), measured=measured)


@pytest.mark.parametrize("chain", [Chain(), replace(QUIET, adc=True), replace(QUIET, dac=True)])
def test_a_command_below_half_a_count_is_no_excitation(chain):
    """With noise on the wires the command moves, but what moves it is the noise."""
    least = 0.5 * max(LARGE_MOTION.adc_step, BOARD.dac_step) * LARGE_MOTION.gain
    message = "expected 0.000164 rad or more: below half a count of the converters"
    for rms in (1e-9, 0.99 * least):
        refused(message, best_linear, replace(YAW, chain=chain), replace(SHORT, rms=rms, realisations=2))
    assert multisine_experiments(replace(YAW, chain=chain), replace(SHORT, rms=1.01 * least))
    assert multisine_experiments(YAW, replace(SHORT, rms=1e-9)), "nothing rounds there"


@pytest.mark.slow
def test_without_friction_it_is_the_small_signal_truth():
    condition = Condition(friction=False)
    setting = condition.applied(campaign_scenario("siso-5-elbow_pitch", duration=24.0))
    setting = replace(setting, hand_controller=LARGE_MOTION)
    # What the arm answers does not matter here.
    u = preview(setting).commands[200:, joint_index("elbow_pitch")]
    record = IOData(u, u, 0.02).detrend()
    approximation = best_linear_of_test(setting, [record], test="5", seed=3)
    truth = linearize(load_arm(), amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert approximation.wanted_rms == pytest.approx(float(np.std(record.u)))
    assert approximation.command_rms == pytest.approx(approximation.wanted_rms, rel=2 * CLOSE)
    assert approximation.f_max == pytest.approx(3.5, abs=0.6)
    assert approximation.slewing > 0.3  # as the test's own command does
    assert approximation.hz == pytest.approx(truth, rel=0.005)
    assert approximation.ci95[0] <= approximation.hz <= approximation.ci95[1]
    assert approximation.half_power_hz == pytest.approx(truth, rel=0.01)
    assert approximation.cautions == ()
    assert "8 realisations" in approximation.described


@pytest.mark.slow
def test_a_faster_position_loop_holds_the_points_of_the_multisine(tmp_path):
    folder = write_arm(tmp_path)
    (folder / "arm.toml").write_text("sample_rate = 200\n")
    arm = load_arm(str(folder))
    class_of_excitation = Multisines(rms=0.01, f_min=0.2, f_max=3.0, period=5.0, realisations=2)
    chain = replace(IDEAL, friction=False)
    found = measured_best_linear(arm, arm.description.operating_pose, class_of_excitation, chain=chain)["bend"]
    assert found.experiment.period == 1000
    assert len(found.experiment.volts()) == 3000
    frequencies = found.servo.response.frequencies
    np.testing.assert_allclose(frequencies, class_of_excitation.lines / 5.0)
    truth = linearize(load_arm(str(folder), friction=False), amplitudes=())
    exact = truth.joint("bend").model.frequency_response(frequencies)
    np.testing.assert_allclose(np.abs(found.servo.response.response / exact - 1.0), 0.0, atol=0.01)
    setting = replace(found.experiment, variant=str(folder))
    (folder / "arm.toml").write_text("sample_rate = 130\n")
    refused("expected a whole number of ticks", best_linear, setting, replace(class_of_excitation, period=5.02))
