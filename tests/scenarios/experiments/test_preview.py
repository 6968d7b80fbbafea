"""The preview shows what a simulation then commands, and warns of what somebody should know first."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hmtb_twin import JOINTS, Chain, HandController, JointLog, Status, TwinError, simulate
from scenarios import Excitation, Scenario, ScenarioError, load, names
from scenarios.commands.cli import main
from scenarios.experiments.log_review import shutdown_intervals
from scenarios.experiments.preview import preview

QUIET = Excitation("prbs", {"amplitude": 0.02})


def short(name: str) -> Scenario:
    return replace(load(name), duration=6.0)


@pytest.mark.parametrize("name", ["siso-7-elbow_pitch", "mimo-8-independent"])
def test_commands_are_those_of_the_simulation_to_the_bit(name: str) -> None:
    seen, log = preview(short(name)), simulate([short(name)])[0]
    for channel in ("volts", "commanded", "status"):
        np.testing.assert_array_equal(getattr(seen, channel.replace("commanded", "commands")), getattr(log, channel))


def test_every_test_of_both_tables_keeps_to_the_limits_and_runs() -> None:
    """The whole length of each is measured in docs/tests.md."""
    chosen = [replace(load(name), duration=6.0) for tag in ("siso", "mimo") for name in names(tag)]
    for scenario in chosen:
        seen = preview(scenario)
        assert not (seen.status & ~Status.VELOCITY_LIMITED).any(), scenario.name
        assert (np.abs(seen.rates).max(axis=0) <= seen.velocity_limits * (1 + 1e-9)).all(), scenario.name
        assert min(seen.margin(joint) for joint in seen.moving) > np.radians(30.0), scenario.name
        assert seen.dac_clipped == 0.0, scenario.name
        assert seen.deflection < 0.15, scenario.name
        assert scenario.mode == "single_joint" or seen.turn < 1e-6, scenario.name
    logs = simulate([replace(scenario, duration=1.0) for scenario in chosen])
    assert [log.name for log in logs] == [scenario.name for scenario in chosen]
    assert not logs.failed


def test_figures_of_a_command_that_is_known() -> None:
    """One step of 1 V, up and down, without noise: every figure follows by hand."""
    box = Excitation("points", {"points": (1.0,) * 50 + (0.0,) * 50})
    chain = Chain(dac=False, noise=False, bias=False, adc=False)
    seen = preview(Scenario("box", ("elbow_pitch",), (box,), duration=4.0, chain=chain))
    assert seen.moving == ("elbow_pitch",)
    assert seen.peak_rate("elbow_pitch") == pytest.approx(np.radians(25.0))
    assert seen.peak_rate("shoulder_yaw") == 0.0
    # 0.067 rad at 25 deg/s take 7 whole ticks and a part, four times; the elbow stands at 90 of 150 deg.
    assert seen.velocity_limited == pytest.approx(4 * 7 / 200)
    assert seen.margin("elbow_pitch") == pytest.approx(np.radians(60.0) - 0.067)
    # The tool lies on a circle about the elbow.
    kinematics = seen.tool[np.argmax(np.linalg.norm(seen.tool, axis=1))]
    radius = seen.deflection / (2 * np.sin(0.067 / 2))
    assert 0.5 < radius < 1.2
    assert seen.turn == pytest.approx(0.067)
    assert kinematics[1] == pytest.approx(0.0, abs=1e-12)
    assert seen.dac_clipped == 0.0


def test_a_cartesian_command_moves_the_tool_and_does_not_turn_it() -> None:
    chain = Chain(dac=False, noise=False, bias=False, adc=False)
    push = Excitation("points", {"points": (2.0,) * 100})
    seen = preview(Scenario("push", ("z",), (push,), duration=2.0, mode="cartesian", chain=chain))
    np.testing.assert_allclose(seen.tool[-1], [0.0, 0.0, 0.06], atol=1e-9)
    assert seen.turn < 1e-6
    assert set(seen.moving) >= {"shoulder_pitch", "elbow_pitch", "wrist_pitch"}


@pytest.mark.parametrize(
    ("scenario", "says"),
    [
        (Scenario("a", ("elbow_pitch",), (Excitation("sine", {"frequency": 1.0, "amplitude": 12.0}),)), "±10 V of the"),
        (Scenario("b", ("elbow_pitch",), (Excitation("prbs", {"amplitude": 10.0}),)), "converter stands at an end"),
        (Scenario("c", ("elbow_pitch",), (Excitation("prbs", {"amplitude": 3.0}),)), "at its velocity limit"),
        (Scenario("d", ("elbow_pitch",), (replace(QUIET, repeat_frequency=1.0),)), "misses points, and tones alias"),
        (Scenario("e", ("elbow_pitch",), (Excitation("sine", {"frequency": 5.0}),)), "order of excitation 2 is too"),
        (Scenario("f", ("x", "y", "z"), (Excitation("prbs"),), mode="cartesian"), "move together (condition"),
        (
            Scenario("g", ("shoulder_pitch",), (Excitation("points", {"points": (9.0,) * 100}),), pose="home"),
            "at an end of its range",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_it_warns(scenario: Scenario, says: str) -> None:
    chain = Chain(noise=says.startswith("move"), bias=False)
    assert any(says in text for text in preview(replace(scenario, duration=8.0, chain=chain)).warnings())


def test_a_good_test_is_not_warned_of() -> None:
    assert (
        preview(Scenario("quiet", ("elbow_pitch",), (QUIET,), duration=6.0, chain=Chain(noise=False))).warnings() == ()
    )


def test_a_shutdown_ends_the_preview_and_is_checked_as_a_simulation_does() -> None:
    planned = Scenario("stop", ("elbow_pitch",), (QUIET,), duration=4.0, shutdown=(1.0, 2.0))
    seen = preview(planned)
    assert (len(seen.commands), seen.duration, seen.power_off) == (50, 1.0, 1.0)
    np.testing.assert_array_equal(seen.commands, simulate([planned])[0].commanded[:50])
    assert not (seen.status & Status.SHUT_DOWN).any()
    said = "power off at 1 s: commands from then on depend on the arm and are not previewed"
    assert said in seen.warnings()
    with pytest.raises(TwinError, match="expected ascending times"):
        preview(replace(planned, shutdown=(1.0, 5.0)))


@pytest.mark.parametrize(
    ("amplitude", "deadband", "says"),
    [
        (0.004, 0.0, "no more than one count of 4.88 mV: no joint"),
        (0.04, 0.05, "within the deadband of 0.05 V: no joint"),
        (0.06, 0.05, ""),
    ],
)
def test_an_excitation_too_small_to_pass_is_told(amplitude: float, deadband: float, says: str) -> None:
    small = Excitation("prbs", {"amplitude": amplitude})
    still = Scenario(
        "still", ("elbow_pitch",), (small,), duration=2.0, hand_controller=HandController(deadband=deadband)
    )
    told = [text for text in preview(still).warnings() if "no joint is commanded to move" in text]
    assert len(told) == bool(says)
    assert says in "".join(told)


def test_simulate_says_how_far_the_arm_sank(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    planned = Scenario("stop", ("elbow_pitch",), (QUIET,), duration=3.0, shutdown=(1.0, 2.0, 2.5))
    file = tmp_path / "stop.toml"
    file.write_text(planned.to_toml(), encoding="utf-8")
    assert main(["preview", str(file), "--out", str(tmp_path)]) == 0
    assert "stop: 1 s of 3 s, single joint mode" in capsys.readouterr().out
    assert main(["simulate", str(file), "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    log = JointLog.load(tmp_path / "stop.nc")
    first, second = shutdown_intervals(log)
    way = np.abs(log.true_angles[50:101] - log.true_angles[50]).max(axis=0)
    assert (first.start, first.end, first.ends, first.sank) == (1.0, 2.0, True, way.max())
    assert first.joint == JOINTS[int(way.argmax())]
    assert (second.start, second.end, second.ends) == (2.5, 3.0, False)
    assert f"stop: shut down 1 to 2 s: sank up to {np.degrees(way.max()):.1f} deg (" in out
    assert "stop: shut down 2.5 to the end at 3 s: sank" in out


def test_an_operator_is_refused() -> None:
    with pytest.raises(ScenarioError, match="an operator who looks at the arm moves the stick"):
        preview(load("rpcm"))


def test_the_command_prints_what_is_seen(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["preview", "mimo-9", "--duration", "8", "--seed", "3", "--out", str(tmp_path)]
    assert main([*words, "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["previews"].values()
    seen = preview(replace(load("mimo-9"), duration=8.0).reseeded(3))
    assert found["tool_deflection_m"] == seen.deflection
    assert found["joints"]["elbow_pitch"]["peak_rate_rad_s"] == seen.peak_rate("elbow_pitch")
    assert set(found["joints"]) == set(seen.moving) < set(JOINTS)
    assert found["clipped"] == {"dac": 0.0, "adc": 0.0}
    assert found["order_of_excitation"] == [25]
    assert found["inputs"]["full_model"] is False
    assert found["warnings"] == list(seen.warnings())
    assert Path(found["plot"]).read_bytes().startswith(b"\x89PNG")
    assert main(words) == 0
    out = capsys.readouterr().out
    for word in ("mimo-9: 8 s, cartesian mode, axes x, y, z", "warning:", "25.0 deg/s", "order of excitation: 25"):
        assert word in out


def test_simulate_says_the_same_of_several_joints(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    fast = tmp_path / "fast.toml"
    quick = Scenario("fast", ("elbow_pitch",), (replace(QUIET, repeat_frequency=1.0),))
    fast.write_text(quick.to_toml(), encoding="utf-8")
    words = ["simulate", "mimo-7", "mimo-7-independent", fast, "--duration", "8", "--out", tmp_path, "--json"]
    assert main(list(map(str, words))) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["inputs"]) == {"mimo-7", "mimo-7-independent"}
    assert found["inputs"]["mimo-7"]["full_model"] is False
    assert found["inputs"]["mimo-7"]["block_diagonal_model"] is True
    assert found["inputs"]["mimo-7-independent"]["full_model"] is True
    warning, missed = found["warnings"]
    assert missed.startswith("fast: a file is played faster than 50 points per second")
    assert warning.startswith("mimo-7: the commands of shoulder_yaw, shoulder_pitch, elbow_pitch move together")
    assert preview(replace(load("mimo-7"), duration=8.0)).inputs.condition == found["inputs"]["mimo-7"]["condition"]


def test_the_documented_example_of_two_outputs_is_a_scenario() -> None:
    page = (Path(__file__).parents[3] / "docs" / "tests.md").read_text(encoding="utf-8")
    (example,) = (block for block in page.split("```toml\n")[1:] if block.startswith('name = "two-outputs"'))
    read = Scenario.from_toml(example.partition("```")[0])
    assert read.axes == ("x", "y", "z")
    assert read.excitation[0] == read.excitation[2] != read.excitation[1]


def test_lengths_are_those_of_the_page() -> None:
    page = (Path(__file__).parents[3] / "docs" / "tests.md").read_text(encoding="utf-8")
    rpcm, unloaded = (load(name).duration for name in ("rpcm", "rpcm-unloaded"))
    assert f"`rpcm` {rpcm:g} s, within which the exchange is over, `rpcm-unloaded` {unloaded:g} s" in page
    assert {load(name).duration for tag in ("table1", "table2") for name in names(tag)} == {240.0}
