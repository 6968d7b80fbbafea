"""What an excitation or a scenario may not be."""

import pytest

from hmtb_twin import HandController, TwinError
from scenarios import Scenario, ScenarioError, load
from scenarios.experiments.excitation import bipolar_ramping_pulse, multisine, prbs, sine, two_sines, white_noise
from scenarios.experiments.waveform import Waveform, read_points


@pytest.mark.parametrize("name", ["", " ", ".", "../escape", "/tmp/abs", "a/b", "a\nb", "a\0b", "x" * 101, "-x"])
def test_names_that_are_no_file_names_are_refused(name):
    text = load("siso-1-shoulder_yaw").to_toml()
    scenario = Scenario.from_toml(text)
    with pytest.raises(ScenarioError, match="scenario name"):
        Scenario(name, scenario.axes, scenario.excitation)


@pytest.mark.parametrize("duration", [0.0, -1.0, 1e9, float("nan"), float("inf")])
def test_durations_beyond_reason_are_refused(duration):
    scenario = load("siso-1-shoulder_yaw")
    with pytest.raises(ScenarioError, match="duration"):
        Scenario("x", scenario.axes, scenario.excitation, duration=duration)
    with pytest.raises(ScenarioError, match="duration"):
        sine(frequency=5.0).play(duration)


@pytest.mark.parametrize("seed", [-1, 2**63])
@pytest.mark.parametrize("kind", [prbs, multisine, white_noise])
def test_seeds_out_of_range_are_refused(kind, seed):
    with pytest.raises(ScenarioError, match="seed"):
        kind(seed=seed)


@pytest.mark.parametrize("seed", [-1, 2**63, 2**70])
def test_scenario_seeds_out_of_range_are_refused(seed):
    scenario = load("siso-1-shoulder_yaw")
    with pytest.raises(ScenarioError, match="seed"):
        Scenario("x", scenario.axes, scenario.excitation, seed=seed)


def test_a_sine_sampled_at_its_zeros_is_refused():
    with pytest.raises(ScenarioError, match="below 25"):
        sine(frequency=25.0)


@pytest.mark.parametrize("seed", range(20))
def test_every_binary_sequence_changes_sign(seed):
    for clock in (1, 2, 7, 33):
        assert set(prbs(clock=clock, seed=seed).points) == {-1.0, 1.0}
    with pytest.raises(ScenarioError, match="clock"):
        prbs(clock=50)


def test_voltages_beyond_reason_are_refused():
    with pytest.raises(ScenarioError, match="at most 1000 V"):
        sine(frequency=5.0, amplitude=1e308)


def test_a_number_too_large_for_a_float_is_refused():
    text = load("siso-1-shoulder_yaw").to_toml().replace("duration = 240.0", "duration = 1" + "0" * 400)
    with pytest.raises(ScenarioError, match="finite number"):
        Scenario.from_toml(text)


def test_silence_excites_nothing():
    assert Waveform([0.0] * 100, "silence").order_of_excitation() == 0


def test_a_log_can_be_made_again_from_itself():
    from dataclasses import replace

    import numpy as np

    from hmtb_twin import simulate

    first = simulate([replace(load("siso-5-elbow_pitch"), duration=1.0, seed=3)])[0]
    again = simulate([Scenario.from_toml(first.provenance["scenario"])])[0]
    assert np.array_equal(first.measured, again.measured)


def test_an_opengl_back_end_that_does_not_load_is_one_line():
    import os
    import subprocess
    import sys

    run = subprocess.run(
        [sys.executable, "-m", "scenarios", "truth"],
        env={**os.environ, "MUJOCO_GL": "bogus"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.count("\n") == 1
    assert "MUJOCO_GL='bogus'" in run.stderr


def test_a_waveform_of_silence_is_one_line(capsys, tmp_path):
    from scenarios.commands.cli import main

    words = ["waveform", "sine", "--frequency", "5", "--amplitude", "0", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("huge", [1e308, -1e308])
def test_huge_arguments_are_refused_by_name(huge):
    with pytest.raises(ScenarioError, match="lower tone"):
        two_sines(frequency=huge)
    with pytest.raises(ScenarioError, match="pulse width"):
        bipolar_ramping_pulse(pulse_width=huge)
    for name in ("translation_gain", "adc_range", "hum_frequency"):
        with pytest.raises(TwinError, match=name):
            HandController(**{name: huge})


def test_a_path_that_is_none_is_refused():
    with pytest.raises(ScenarioError, match="cannot read waveform file"):
        read_points("a\0b")
