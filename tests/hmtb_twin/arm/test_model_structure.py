from dataclasses import replace

import pytest
from mujoco import batch

from hmtb_twin import JOINTS, Plant, Specimen, load_arm
from hmtb_twin.run.simulation import structure


def rubbing_without(joint):
    return Specimen(dry_friction=tuple(0.0 if name == joint else 1.0 for name in JOINTS))


ALIKE = [
    {"variant": "published"},
    {"payload": "mdm"},
    {"plant": Plant(friction_level=2.0)},
    {"plant": Plant(supply_pressure=18.0)},
    {"specimen": Specimen(payload_mass=1.3, kp=tuple(0.9 for _ in JOINTS))},
]
OTHERS = [
    {"payload": "none"},
    {"variant": "flight"},
    {"friction": False},
    {"plant": Plant(friction="coulomb")},
    {"plant": Plant(actuator="orifice")},
    {"worksite": True},
    {"specimen": rubbing_without("elbow_pitch")},
]


@pytest.mark.parametrize("differing", ALIKE, ids=str)
def test_arms_that_differ_in_numbers_share_a_batch(differing):
    plain, other = load_arm(), load_arm(**differing)
    assert structure(plain) == structure(other)
    batch.Batch(plain.model, nsim=2).set_models([other.model, plain.model])


@pytest.mark.parametrize("differing", OTHERS, ids=str)
def test_arms_that_differ_in_more_do_not(differing):
    assert structure(load_arm()) != structure(load_arm(**differing))


def test_equally_many_states_in_other_places_are_another_structure():
    elbow, wrist = (load_arm(specimen=rubbing_without(name)) for name in ("elbow_pitch", "wrist_yaw"))
    assert elbow.model.na == wrist.model.na
    assert structure(elbow) != structure(wrist)


def test_an_arm_runs_beside_itself_without_power():
    arm = load_arm()
    assert structure(arm) == structure(replace(arm, model=arm.unpowered))
