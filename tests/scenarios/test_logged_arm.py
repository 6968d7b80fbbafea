"""What a log tells of its arm, and which truth belongs to it."""

from dataclasses import replace

import numpy as np
import pytest

from hmtb_twin import POSES, JointLog, Plant, linearize, load_arm, simulate
from hmtb_twin.parameters import OPERATING_POSE
from scenarios import ScenarioError, load
from scenarios.attainable import attainable
from scenarios.logged_arm import check_truth, logged_arm


@pytest.fixture(scope="module")
def log() -> JointLog:
    return simulate([replace(load("siso-5-elbow_pitch"), name="short", duration=2.0)])[0]


@pytest.mark.parametrize(
    ("arm", "pose", "message"),
    [
        (load_arm("published"), OPERATING_POSE, "variant = published, not nominal"),
        (load_arm(payload="none"), OPERATING_POSE, "payload = none, not rpcm"),
        (load_arm(plant=Plant(supply_pressure=15.0)), OPERATING_POSE, r"supply_pressure = 15.0, not 20.7"),
        (load_arm(plant=Plant(process_noise=0.01)), OPERATING_POSE, r"process_noise = 0.01, not 0.0"),
        (load_arm(plant=Plant(friction="none")), OPERATING_POSE, "friction = none, not viscous"),
        (load_arm(), "home", "pose = home, not rpcm_holster_out_approach"),
        (load_arm(), np.array(POSES["home"]), "pose = given angles, not rpcm_holster_out_approach"),
    ],
)
def test_a_truth_of_something_else_is_refused(log, arm, pose, message):
    with pytest.raises(ScenarioError, match=f"^short: a truth given of {message}; expected that of the log's own arm$"):
        attainable(log, truth=linearize(arm, pose, amplitudes=()))


@pytest.mark.parametrize("friction", ["viscous", "coulomb", "lugre"])
def test_dry_friction_is_no_part_of_a_truth(log, friction):
    arm = load_arm(plant=Plant(friction=friction, friction_level=2.0))
    check_truth(log, logged_arm(log), linearize(arm, np.array(POSES[OPERATING_POSE]), amplitudes=()))
