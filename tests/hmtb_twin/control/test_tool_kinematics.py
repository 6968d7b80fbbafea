import numpy as np
import pinocchio as pin
import pytest

from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.control.tool_kinematics import ToolKinematics, WristAngles
from hmtb_twin.parameters.resources import model_file
from tests.hmtb_twin.altered_arms import LOWER, UPPER
from tests.refusals import refused

POSES = np.random.default_rng(0).uniform(LOWER + 0.1, UPPER - 0.1, (200, 7))


@pytest.fixture(scope="module")
def kinematics(arm):
    return ToolKinematics(arm.controller)


def wanted(controller, kinematics, angles):
    position, rotation = controller.tool_pose(angles)
    wrist = WristAngles(angles[2] - angles[3] + angles[4], angles[5], angles[6])
    return *kinematics.target(angles[0], position.tolist(), rotation.tolist()), wrist


def posture(controller, kinematics, angles):
    return kinematics.posture(*angles[1:4], *wanted(controller, kinematics, angles))


def test_posture_rates_and_inverse_of_random_poses(arm, kinematics):
    for angles in POSES:
        pose = posture(arm.controller, kinematics, angles)
        assert pose.angles == pytest.approx(angles[1:], abs=1e-12)
        assert pose.error == pytest.approx((0, 0, 0), abs=1e-12)
        # Next to the yaw axis the yaw is what little is left of the position.
        if abs(pose.radius) > 1e-2:
            inverse = kinematics.reaching(*wanted(arm.controller, kinematics, angles), pose.radius)
            assert inverse.angles == pytest.approx(angles[1:], abs=1e-10)
        # The rates hold the orientation and give the Jacobian, in the plane of the arm.
        rates = pose.rates()
        moved = arm.controller.tool_jacobian(angles)[:, 1:] @ rates[:6]
        _, rotation = arm.controller.tool_pose(angles)
        plane = pin.exp3(np.array([0.0, 0.0, -angles[1]])) @ pin.exp3(np.array([-angles[0], 0.0, 0.0]))
        scale = np.abs(rates).max()
        assert np.abs(moved[3:]).max() < 1e-13 * scale
        assert np.abs(plane @ rotation @ moved[:3] - pose.jacobian()).max() < 1e-13 * scale
        assert rates[6] == pytest.approx(pose.jacobian()[0], abs=1e-13 * scale)
        # Rigidity bounds the smallest singular value.
        turned = rates[:6] @ np.linalg.inv(pose.jacobian())
        assert pose.rigidity == pytest.approx(1.0 / np.linalg.norm(turned), rel=1e-9)


def test_angles_are_those_within_half_a_turn(arm, kinematics):
    angles = np.array([0.0, 0.2, -1.5, 2.5, -1.5, 0.1, 3.1])
    pose = posture(arm.controller, kinematics, angles)
    assert pose.wrist.tilt == pytest.approx(-5.5)
    centre, rotation, _ = wanted(arm.controller, kinematics, angles)
    turned = kinematics.posture(0.2, -1.5, 2.5, centre, rotation, WristAngles(-5.5, 0.1, -3.2))
    assert turned.wrist.roll == pytest.approx(3.1 - 2 * np.pi)
    # Out of reach there is no pose.
    centre, rotation, wrist = wanted(arm.controller, kinematics, np.zeros(7))
    assert kinematics.reaching((centre[0] + 1e-6, *centre[1:]), rotation, wrist) is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<joint name="elbow_pitch" axis="0 1 0"', '<joint name="elbow_pitch" axis="0 -1 0"'),
        ('<body name="wrist_yaw_link" pos="0.15 0 0">', '<body name="wrist_yaw_link" pos="0.15 0.01 0">'),
        ('<body name="forearm" pos="0.61 0 0">', '<body name="forearm" pos="0.61 0 0.05">'),
    ],
)
def test_another_arm_is_refused(old, new):
    text = model_file("hmtb/hmtb.xml").read_text(encoding="utf-8")
    assert old in text
    refused("other axes", ToolKinematics, ControllerModel(text.replace(old, new)))


def test_other_lengths_are_read_from_the_model():
    text = model_file("hmtb/hmtb.xml").read_text(encoding="utf-8")
    for part, old, new in (
        ('<body name="upper_arm"', "0.1 0 0", "0.12 0.03 0.04"),
        ('<body name="shoulder_yaw_link"', "0.15 0 0", "0.17 0.02 0.05"),
        ('<site name="tool"', "0.14 0 0", "0.3 0 0"),
        ('<body name="wrist_yaw_link"', "0.15 0 0", "0.15 -0.03 -0.02"),
    ):
        assert f'{part} pos="{old}"' in text
        text = text.replace(f'{part} pos="{old}"', f'{part} pos="{new}"')
    controller = ControllerModel(text)
    kinematics = ToolKinematics(controller)
    for angles in POSES[:20]:
        pose = posture(controller, kinematics, angles)
        assert pose.angles == pytest.approx(angles[1:], abs=1e-12)
        assert pose.error == pytest.approx((0, 0, 0), abs=1e-12)
