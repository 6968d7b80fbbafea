"""The preview shows what a simulation then commands, and warns of traps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import JOINTS, Chain, HandController, JointLog, Status, simulate
from hmtb_twin.bus.shutdown_intervals import shutdown_intervals
from hmtb_twin.parameters.values import GAINS, LARGE_MOTION
from scenarios import Excitation, Scenario, load, names
from scenarios.experiments.preview import preview
from tests.refusals import refused

QUIET = Excitation("prbs", {"amplitude": 0.02})
HIGH = Excitation("points", {"points": (9.0,) * 100})


@pytest.mark.parametrize("name", ["siso-7-elbow_pitch", "mimo-8-independent"])
def test_commands_are_those_of_the_simulation_to_the_bit(name):
    short = replace(load(name), duration=6.0)
    seen, log = preview(short), simulate([short])[0]
    for previewed, simulated in ((seen.volts, log.volts), (seen.commands, log.commanded), (seen.status, log.status)):
        np.testing.assert_array_equal(previewed, simulated)


@pytest.mark.slow
def test_every_test_of_both_tables_keeps_to_the_limits_and_runs():
    """The whole length of each is measured in docs/tests.md."""
    chosen = [replace(load(name), duration=6.0) for tag in ("siso", "mimo") for name in names(tag)]
    for scenario in chosen:
        seen = preview(scenario)
        assert not (seen.status & ~Status.VELOCITY_LIMITED).any(), scenario.name
        assert (np.abs(seen.rates).max(axis=0) <= seen.velocity_limits * (1 + 1e-9)).all(), scenario.name
        assert min(seen.margin(joint) for joint in seen.moving) > np.radians(30.0), scenario.name
        assert seen.dac_clipped == 0.0 and seen.deflection < 0.15, scenario.name
        assert scenario.mode == "single_joint" or seen.turn < 1e-6, scenario.name
    assert not simulate([replace(scenario, duration=1.0) for scenario in chosen]).failed


def test_figures_of_a_command_that_is_known():
    """One step of 1 V, up and down, without noise: every figure follows by hand."""
    box = Excitation("points", {"points": (1.0,) * 50 + (0.0,) * 50})
    chain = Chain(dac=False, noise=False, bias=False, adc=False)
    setting = Scenario("box", ("elbow_pitch",), (box,), duration=4.0, chain=chain, hand_controller=LARGE_MOTION)
    seen = preview(setting)
    assert seen.moving == ("elbow_pitch",)
    assert (seen.peak_rate("elbow_pitch"), seen.peak_rate("shoulder_yaw")) == (pytest.approx(np.radians(25.0)), 0.0)
    # 0.067 rad at 25 deg/s take 7 whole ticks and a part, four times; the elbow stands at 90 of 150 deg.
    assert seen.velocity_limited == pytest.approx(4 * 7 / 200)
    assert not any("velocity limit" in text for text in seen.warnings())  # which distorts no model
    assert seen.margin("elbow_pitch") == pytest.approx(np.radians(60.0) - 0.067)
    # The tool lies on a circle about the elbow.
    assert 0.5 < seen.deflection / (2 * np.sin(0.067 / 2)) < 1.2
    assert seen.turn == pytest.approx(0.067)
    assert seen.tool[np.argmax(np.linalg.norm(seen.tool, axis=1)), 1] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("gain", "low", "high"), [(GAINS["degrees"], 0, 0), (GAINS["nominal"], 0, 0), (5e-3, 0.1, 1), (0.067, 0.85, 0.95)]
)
def test_a_binary_sequence_slews_from_the_gain_on_at_which_the_limit_says_so(gain, low, high):
    test = replace(load("siso-5-elbow_pitch"), duration=12.0, chain=Chain(noise=False))
    seen = preview(replace(test, hand_controller=HandController(gain=gain, hold=1)))
    assert low <= seen.velocity_limited <= high
    assert np.ptp(seen.commands[:, JOINTS.index("elbow_pitch")]) <= 2.01 * gain


def test_a_cartesian_command_moves_the_tool_and_does_not_turn_it():
    chain = Chain(dac=False, noise=False, bias=False, adc=False)
    push = Excitation("points", {"points": (2.0,) * 100})
    settings = {"duration": 2.0, "mode": "cartesian", "chain": chain, "hand_controller": LARGE_MOTION}
    seen = preview(Scenario("push", ("z",), (push,), **settings))
    np.testing.assert_allclose(seen.tool[-1], [0.0, 0.0, 0.06], atol=1e-9)
    assert seen.turn < 1e-6
    assert set(seen.moving) >= {"shoulder_pitch", "elbow_pitch", "wrist_pitch"}


@pytest.mark.parametrize(
    ("excitation", "changes", "says"),
    [
        (Excitation("sine", {"frequency": 1.0, "amplitude": 12.0}), {}, "±10 V of the"),
        (Excitation("prbs", {"amplitude": 10.0}), {}, "converter stands at an end"),
        (replace(QUIET, repeat_frequency=1.0), {}, "misses points, and tones alias"),
        (Excitation("sine", {"frequency": 5.0}), {}, "order of excitation 2 is too"),
        (Excitation("prbs"), {"axes": ("x", "y", "z"), "mode": "cartesian"}, "move together (condition"),
        (HIGH, {"axes": ("shoulder_pitch",), "pose": "home"}, "at an end of its range"),
    ],
)
def test_it_warns(excitation, changes, says):
    chain = Chain(noise=says.startswith("move"), bias=False)
    scenario = Scenario("a", ("elbow_pitch",), (excitation,), duration=8.0, chain=chain, hand_controller=LARGE_MOTION)
    scenario = replace(scenario, **changes)
    assert any(says in text for text in preview(scenario).warnings())


def test_a_shutdown_ends_the_preview():
    planned = Scenario("stop", ("elbow_pitch",), (QUIET,), duration=4.0, shutdown=(1.0, 2.0))
    seen = preview(planned)
    assert (len(seen.commands), seen.duration, seen.power_off) == (50, 1.0, 1.0)
    np.testing.assert_array_equal(seen.commands, simulate([planned])[0].commanded[:50])
    assert not (seen.status & Status.SHUT_DOWN).any()
    assert "power off at 1 s: commands from then on depend on the arm and are not previewed" in seen.warnings()


@pytest.mark.parametrize(
    ("amplitude", "deadband", "says"),
    [
        (0.004, 0.0, "no more than one count of 4.88 mV: no joint"),
        (0.04, 0.05, "within the deadband of 0.05 V: no joint"),
        (0.06, 0.05, ""),
    ],
)
def test_an_excitation_too_small_to_pass_is_warned_of(amplitude, deadband, says):
    small, stick = Excitation("prbs", {"amplitude": amplitude}), HandController(deadband=deadband)
    still = Scenario("still", ("elbow_pitch",), (small,), duration=2.0, hand_controller=stick)
    warnings = [text for text in preview(still).warnings() if "no joint is commanded to move" in text]
    assert len(warnings) == bool(says)
    assert says in "".join(warnings)


@pytest.mark.slow
def test_simulate_says_how_far_the_arm_sank(printed, tmp_path):
    planned = Scenario("stop", ("elbow_pitch",), (QUIET,), duration=3.0, shutdown=(1.0, 2.0, 2.5))
    file = tmp_path / "stop.toml"
    file.write_text(planned.to_toml(), encoding="utf-8")
    assert "stop: 1 s of 3 s, single joint mode" in printed("preview", file, "--out", tmp_path)
    out = printed("simulate", file, "--out", tmp_path)
    log = JointLog.load(tmp_path / "stop.nc")
    first, second = shutdown_intervals(log)
    way = np.abs(log.true_angles[50:101] - log.true_angles[50]).max(axis=0)
    assert (first.start, first.end, first.ends, first.sank) == (1.0, 2.0, True, way.max())
    assert first.joint == JOINTS[int(way.argmax())]
    assert (second.start, second.end, second.ends) == (2.5, 3.0, False)
    assert f"stop: shut down 1 to 2 s: sank up to {np.degrees(way.max()):.1f} deg (" in out
    assert "stop: shut down 2.5 to the end at 3 s: sank" in out


def test_a_good_test_is_not_warned_of_and_an_operator_is_refused():
    quiet = Scenario("quiet", ("elbow_pitch",), (QUIET,), duration=6.0, chain=Chain(noise=False))
    assert preview(quiet).warnings() == ()
    refused("an operator who looks at the arm moves the stick", preview, load("rpcm"))


@pytest.mark.slow
def test_the_command_prints_what_is_seen(printed, result, tmp_path):
    words = ("preview", "mimo-9", "--duration", 8, "--seed", 3, "--out", tmp_path)
    (record,) = result(*words)["previews"].values()
    seen = preview(replace(load("mimo-9"), duration=8.0).reseeded(3))
    assert record["tool_deflection_m"] == seen.deflection
    assert record["joints"]["elbow_pitch"]["peak_rate_rad_s"] == seen.peak_rate("elbow_pitch")
    assert set(record["joints"]) == set(seen.moving) < set(JOINTS)
    assert (record["clipped"], record["order_of_excitation"]) == ({"dac": 0.0, "adc": 0.0}, [25])
    assert record["inputs"]["full_model"] is False
    assert record["warnings"] == list(seen.warnings())
    assert Path(record["plot"]).read_bytes().startswith(b"\x89PNG")
    out = printed(*words, "--overwrite")
    for word in ("mimo-9: 8 s, cartesian mode, axes x, y, z", "warning:", "25.0 deg/s", "order of excitation: 25"):
        assert word in out


def test_simulate_says_the_same_of_several_joints(result, tmp_path):
    fast = tmp_path / "fast.toml"
    quick = Scenario("fast", ("elbow_pitch",), (replace(QUIET, repeat_frequency=1.0),))
    fast.write_text(quick.to_toml(), encoding="utf-8")
    record = result("simulate", "mimo-7", "mimo-7-independent", fast, "--duration", 8, "--out", tmp_path)
    shared = record["inputs"]["mimo-7"]
    assert (shared["full_model"], shared["block_diagonal_model"]) == (False, True)
    assert record["inputs"]["mimo-7-independent"]["full_model"] is True
    warning, missed = record["warnings"]
    assert missed.startswith("fast: a file is played faster than 50 points per second")
    assert warning.startswith("mimo-7: the commands of shoulder_yaw, shoulder_pitch, elbow_pitch move together")
    assert preview(replace(load("mimo-7"), duration=8.0)).inputs.condition == shared["condition"]


def test_lengths_and_the_example_of_two_outputs_are_those_of_the_page():
    page = (Path(__file__).parents[3] / "docs" / "tests.md").read_text(encoding="utf-8")
    (example,) = (block for block in page.split("```toml\n")[1:] if block.startswith('name = "two-outputs"'))
    read = Scenario.from_toml(example.partition("```")[0])
    assert read.axes == ("x", "y", "z")
    assert read.excitation[0] == read.excitation[2] != read.excitation[1]

    rpcm, unloaded = (load(name).duration for name in ("rpcm", "rpcm-unloaded"))
    assert f"`rpcm` {rpcm:g} s, within which the exchange is over, `rpcm-unloaded` {unloaded:g} s" in page
    assert {load(name).duration for tag in ("table1", "table2") for name in names(tag)} == {240.0}
