"""Limits and dry friction of the actuators; test_analytic_hydraulics.py holds their dynamics."""

import mujoco
import numpy as np
import pytest

from hmtb_twin import Plant, load_arm
from hmtb_twin.parameters.drives import ACTUATORS
from hmtb_twin.parameters.values import JOINTS


def test_oil_torque_never_exceeds_supply_pressure_times_displacement():
    arm = load_arm(friction=False)
    data = arm.rest(arm.pose("home"))
    limit = np.array([ACTUATORS[name].maximum_torque for name in JOINTS])
    data.ctrl[0::2] += 3.0
    data.ctrl[1::2] += 1e5
    reached = np.zeros(7)
    for _ in range(300):
        mujoco.mj_step(arm.model, data)
        reached = np.maximum(reached, np.abs(data.actuator_force))
    assert (reached <= limit * (1 + 1e-12)).all()
    assert (reached > 0.9 * limit).any()


def test_flow_limits_the_joint_velocity(arm):
    data = arm.rest(arm.pose("home"))
    data.ctrl[2] = 1.5
    data.ctrl[3] = 1e5
    fastest = 0.0
    for _ in range(1000):
        mujoco.mj_step(arm.model, data)
        fastest = max(fastest, abs(data.qvel[1]))
    assert 0.1 < fastest <= ACTUATORS["shoulder_yaw"].no_load_speed * 1.01


@pytest.mark.parametrize(("form", "within", "least"), [("linear", 0.1, 0.9), ("orifice", 0.15, 0.85)])
def test_dry_friction_is_a_spring_until_breakaway(form, within, least):
    arm = load_arm(plant=Plant(form))
    actuator, (kp, _) = arm.actuators["elbow_pitch"], arm.gains["elbow_pitch"]
    coulomb, friction = actuator.coulomb_torque, actuator.friction
    for torque, sticks in ((0.5 * coulomb, True), (4.0 * friction.static_ratio * coulomb, False)):
        data = arm.rest(arm.pose("rpcm_holster_out_approach"))
        start = data.qpos[3]
        data.ctrl[7] += torque
        mujoco.mj_step(arm.model, data, nstep=round(1.5 / arm.model.opt.timestep))
        # At rest the servo's stiffness and, as long as they stick, the bristles carry the torque together.
        stuck, moved = torque / (kp + coulomb / friction.presliding), data.qpos[3] - start
        assert bool(moved == pytest.approx(stuck, rel=within)) is sticks
        assert moved > least * stuck
