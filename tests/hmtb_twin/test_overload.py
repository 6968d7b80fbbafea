"""Drives that cannot hold the arm, in both forms of the actuator."""

import numpy as np
import pytest

from hmtb_twin import JOINTS, OverloadError, Plant, linearize, load_arm, simulate
from hmtb_twin.joint_range import CLEARANCE
from hmtb_twin.parameters import MOTIONS, OPERATING_POSE

FORMS = ("linear", "orifice")


@pytest.fixture(scope="module")
def needed():
    """Supply pressure at which the shoulder's stall torque is just the weight, MPa."""
    arm = load_arm()
    weight = arm.controller.gravity_torque(arm.pose(OPERATING_POSE)[None])[0, JOINTS.index("shoulder_pitch")]
    actuator = arm.actuators["shoulder_pitch"]
    return actuator.hydraulics.return_pressure + abs(weight) / actuator.displacement


def weak(form, pressure):
    return load_arm(plant=Plant(actuator=form, supply_pressure=pressure))


@pytest.mark.parametrize("form", FORMS)
def test_load_beyond_the_supply_is_refused_in_words(form, needed):
    with pytest.raises(
        OverloadError,
        match=r"^at 6 MPa the drives cannot hold the arm at this pose: shoulder pitch needs 296 N m and has 156, elbow",
    ):
        linearize(weak(form, 6.0))
    with pytest.raises(OverloadError, match=r"shoulder pitch needs 296 N m and has 29\d$"):
        weak(form, needed - 0.01).rest(load_arm().pose(OPERATING_POSE))


def test_the_limit_is_that_of_the_supply(needed):
    arm = weak("linear", needed + 0.01)
    assert arm.rest(arm.pose(OPERATING_POSE)).qpos == pytest.approx(arm.pose(OPERATING_POSE))
    # What servo valves leak takes the last few percent.
    with pytest.raises(OverloadError, match=r"^at 8.3\d* MPa the servo valves cannot hold .* takes 100 % of a drive's"):
        weak("orifice", needed + 0.01).rest(arm.pose(OPERATING_POSE))
    assert linearize(weak("orifice", 1.1 * needed), amplitudes=()).model.order > 0


def test_a_joint_that_sinks_onto_its_stop_has_no_truth():
    arm = weak("orifice", 20.7)
    pose = np.radians([0.0, 0.0, 60.0, 30.0, 0.0, 0.0, 0.0])
    wrist, stop = JOINTS.index("wrist_pitch"), MOTIONS["wrist_pitch"].upper
    # Clear of it as commanded; under the weight beyond the wrist no longer.
    pose[wrist] = stop - 1.05 * CLEARANCE
    assert arm.rest(pose).qpos[wrist] > stop - CLEARANCE
    with pytest.raises(OverloadError, match=r"^at 20.7 MPa the drives let the wrist pitch sink onto its stop, to 90"):
        linearize(arm, pose, amplitudes=())


@pytest.mark.parametrize("form", FORMS)
def test_an_experiment_that_starts_so_is_refused_before_anything_runs(experiment, form):
    heavy = experiment(name="heavy", plant=Plant(actuator=form, supply_pressure=6.0))
    told = []
    with pytest.raises(OverloadError, match=r"^heavy: at 6 MPa the drives .* \(rpcm_holster_out_approach\)$"):
        simulate([experiment(name="light", duration=1.0), heavy], progress=lambda *ticks: told.append(ticks))
    assert told == []
