import numpy as np
import pytest
from scipy.optimize import brentq

from hmtb_twin import JOINTS, OverloadError, Plant, linearize, load_arm
from hmtb_twin.parameters.variants import MOTIONS, OPERATING_POSE
from hmtb_twin.truth.analytic_hydraulics import linear_hydraulics
from hmtb_twin.truth.linearization import CLEARANCE


@pytest.fixture(scope="module")
def needed():
    """Supply pressure at which the shoulder's stall torque is just the weight, MPa."""
    arm = load_arm()
    weight = arm.controller.gravity_torque(arm.pose(OPERATING_POSE)[None])[0, JOINTS.index("shoulder_pitch")]
    actuator = arm.actuators["shoulder_pitch"]
    return actuator.hydraulics.return_pressure + abs(weight) / actuator.displacement


def weak(form, pressure):
    return load_arm(plant=Plant(actuator=form, supply_pressure=pressure))


@pytest.mark.parametrize("form", ["linear", "orifice"])
def test_load_beyond_the_supply_is_refused_in_words(form, needed):
    with pytest.raises(
        OverloadError,
        match=r"^at 4 MPa the drives cannot hold the arm at this pose: shoulder pitch needs 296 N m and has (209|210)",
    ):
        linearize(weak(form, 4.0))
    with pytest.raises(OverloadError, match=r"shoulder pitch needs 296 N m and has 29\d$"):
        weak(form, needed - 0.01).rest(load_arm().pose(OPERATING_POSE))


@pytest.mark.slow
def test_the_limit_is_that_of_the_supply(needed):
    # Leakage takes the last few percent.
    with pytest.raises(OverloadError, match=r"shoulder pitch needs 296 N m and has 29\d$"):
        weak("linear", needed + 0.01).rest(load_arm().pose(OPERATING_POSE))
    arm = weak("linear", 1.03 * needed)
    assert arm.rest(arm.pose(OPERATING_POSE)).qpos == pytest.approx(arm.pose(OPERATING_POSE))
    assert linearize(arm, amplitudes=()).joint("shoulder_pitch").dc_gain == pytest.approx(1.0, abs=1e-4)
    with pytest.raises(OverloadError, match=r"^at 5.4\d* MPa the servo valves cannot hold .* takes 100 % of a drive's"):
        weak("orifice", needed + 0.01).rest(arm.pose(OPERATING_POSE))
    assert linearize(weak("orifice", 1.1 * needed), amplitudes=()).model.order > 0


def test_a_joint_that_sinks_onto_its_stop_has_no_truth():
    arm = weak("orifice", 20.7)
    pose = np.radians([0.0, 0.0, 60.0, 30.0, 0.0, 0.0, 0.0])
    wrist, stop = JOINTS.index("wrist_pitch"), MOTIONS["wrist_pitch"].upper
    # Clear of it as commanded; under the weight beyond the wrist no longer.
    pose[wrist] = stop - 1.05 * CLEARANCE
    assert arm.rest(pose).qpos[wrist] > stop - CLEARANCE
    with pytest.raises(OverloadError, match=r"^at 20.7 MPa the drives let the wrist pitch sink onto its stop, to 89.9"):
        linearize(arm, pose, amplitudes=())


def test_linear_drives_hold_up_to_their_steady_stall_torque_and_no_more():
    """At a load between stall and what the oil gives without leakage, the servo would have no gain."""
    arm = load_arm(payload="mdm", plant=Plant(supply_pressure=18.0))
    stall = linear_hydraulics(arm.actuators["wrist_pitch"], 1.0).stall_torque
    assert arm.drives["wrist_pitch"].motor.holding_torque == pytest.approx(stall)
    pose, wrist = np.radians([0.0, 20.0, 50.0, 120.0, 0.0, 0.0, 0.0]), JOINTS.index("wrist_pitch")

    def surplus(angle):
        pose[wrist] = angle
        return abs(arm.controller.gravity_torque(pose[None])[0, wrist]) - stall

    edge = brentq(surplus, np.radians(-60.0), np.radians(-89.0))
    assert surplus(edge + np.radians(1.0)) < 0.0 < surplus(edge - np.radians(1.0))
    with pytest.raises(OverloadError, match=r"wrist pitch needs 17[45] N m and has 17[23]"):
        linearize(arm, pose)
    pose[wrist] = edge + np.radians(0.1)
    assert linearize(arm, pose, amplitudes=()).joint("wrist_pitch").dc_gain == pytest.approx(1.0, abs=1e-3)
