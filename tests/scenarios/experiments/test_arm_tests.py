"""Tests of any arm: their names, their sizes, and what becomes of them in the laboratory."""

from dataclasses import replace

import numpy as np
import pytest

import hmtb_twin
from hmtb_twin import Chain, linearize, load_arm
from hmtb_twin.arm_files.known_arms import arm_named
from scenarios.experiments import registry
from scenarios.experiments.arm_tests import ALL_JOINTS, TOOL, command_gain
from scenarios.experiments.preview import preview
from scenarios.experiments.registry import load, selected
from scenarios.experiments.scenario import Scenario
from scenarios.files.data_file import joints_of
from scenarios.identification.identification import fit_model
from scenarios.problems.twin_name import twin_name
from tests.refusals import refused


def breakaway(name, joint):
    """Error at which the servo overcomes the friction of a joint at rest, rad."""
    return arm_named(name).actuators[joint].breakaway_torque / load_arm(name).gains[joint][0]


@pytest.mark.parametrize("name", ["panda", "kinova", "nominal", "flight"])
def test_every_free_joint_has_its_tests_and_none_slews(name):
    arm, tests = arm_named(name), registry.tests_of(name)
    names = [f"{kind}-{joint}" for kind in ("prbs", "multisine", "chirp") for joint in arm.free]
    # the tool of the test bed has the tests of the thesis
    assert list(tests) == [*names, ALL_JOINTS, *([TOOL] if arm.rigid is not None else [])]
    for joint in (arm.free[0], arm.free[-1]):
        commands = preview(load(f"prbs-{joint}", duration=10.0, arm=name))
        assert commands.moving == (joint,)
        gain = command_gain(arm, joint)
        # friction would hold some joints at a gain at which none slews
        assert commands.velocity_limited == 0.0 or gain <= 3.0 * breakaway(name, joint)
        # the largest round gain: the next one would slew, or is none of small motion
        digit = 10.0 ** np.floor(np.log10(gain) + 1e-9)
        larger = 2.0 * (gain + digit) > arm.motions[joint].velocity_limit * arm.sample_time
        assert larger or gain >= 0.05 or commands.margin(joint) < 8.0 * gain


@pytest.mark.parametrize("name", ["xarm7", "kinova"])
def test_a_joint_that_friction_would_hold_is_commanded_further(name):
    arm = arm_named(name)
    joint = arm.free[-1]
    # more than it takes to overcome friction at rest, and steps become ramps
    assert 2.0 * command_gain(arm, joint) > arm.motions[joint].velocity_limit * arm.sample_time
    test = load(f"prbs-{joint}", duration=20.0, arm=name)
    logs = hmtb_twin.simulate([test, replace(test, name="frictionless", chain=Chain(friction=False))])
    stuck, linear = (np.std(log.true_angles[200:, -1]) / np.std(log.commanded[200:, -1]) for log in logs)
    assert stuck > 0.6 * linear


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "ur10", "kinova", "xarm7"])
def test_the_tool_of_another_arm_moves_along_its_axes_within_limits(name):
    test = load(TOOL, duration=10.0, arm=name)
    assert preview(test).velocity_limited == 0.0
    (log,) = hmtb_twin.simulate([test])
    positions, rotations = load_arm(name).controller.tool_path(log.commanded)
    offsets = (positions - positions[0]) @ rotations[0]
    # each axis follows its own voltage and no other
    likeness = np.corrcoef(np.hstack([offsets, log.volts]).T)[:3, 3:]
    assert np.diag(likeness).min() > 0.99
    assert np.abs(likeness - np.diag(np.diag(likeness))).max() < 0.3


def test_a_record_of_another_arm_is_identified_with_the_true_bandwidth():
    # dry friction would cost a quarter of it at these small moves
    test = replace(load("multisine-panda_joint1", duration=60.0, arm="panda"), chain=Chain(friction=False))
    (log,) = hmtb_twin.simulate([test])
    assert log.joints == load_arm("panda").joints
    assert log.provenance["variant"] == "panda"
    data = log.iodata()
    assert joints_of(data) == ("panda_joint1",)
    model = fit_model([data[200:]], "oe", (4, 4, 2)).estimate
    truth = linearize(load_arm("panda"), amplitudes=()).joint("panda_joint1")
    assert model.bandwidth().hz.item() == pytest.approx(truth.bandwidth_hz, rel=0.01)


def test_logs_of_another_arm_are_kept_whole(tmp_path):
    (log,) = hmtb_twin.simulate([load(ALL_JOINTS, duration=2.0, arm="ur10")])
    path = log.save(tmp_path / "log.nc")
    again = hmtb_twin.JointLog.load(path)
    assert again.joints == log.joints == arm_named("ur10").joints
    np.testing.assert_array_equal(again.measured, log.measured)
    again = Scenario.from_toml(log.provenance["scenario"])
    assert again == load(ALL_JOINTS, duration=2.0, arm="ur10")
    # the same seed, the same bits
    (second,) = hmtb_twin.simulate([again])
    np.testing.assert_array_equal(second.true_angles, log.true_angles)


def test_a_scenario_file_names_its_arm():
    text = 'name = "mine"\narm = "xarm7"\naxes = ["joint3"]\nduration = 2.0\n[excitation]\nkind = "prbs"\n'
    mine = Scenario.from_toml(text)
    assert (mine.variant, mine.payload, mine.pose) == ("xarm7", "none", arm_named("xarm7").operating_pose)
    refused("expected one of them", Scenario.from_toml, 'variant = "nominal"\n' + text)
    refused("unknown variant 'xarm9'.*xarm7", Scenario.from_toml, text.replace("xarm7", "xarm9"))
    refused("unknown axis 'joint9'", Scenario.from_toml, text.replace("joint3", "joint9"))


def test_an_arm_has_tests_of_its_own():
    refused("unknown test of the arm panda 'siso-5-elbow_pitch'", load, "siso-5-elbow_pitch", arm="panda")
    assert load("siso-5-elbow_pitch", arm="flight").variant == "flight"
    assert [test.name for test in selected(["joint2"], arm="xarm7")] == [
        f"{k}-joint2" for k in ("prbs", "multisine", "chirp")
    ]


def test_problems_of_another_arm_have_short_names():
    name = twin_name("twin-panda-joint4-multisine-10mrad-w3")
    assert name.joint == "panda_joint4"
    assert str(twin_name(str(name))) == str(name) == "twin-panda-panda_joint4-multisine-10mrad-w3"
    assert name.setting(0).pose == arm_named("panda").operating_pose
    refused("unknown joint 'joint9'", twin_name, "twin-panda-joint9-multisine-10mrad")
    refused("unknown variant 'pandda'", twin_name, "twin-pandda-joint4-multisine-10mrad")
