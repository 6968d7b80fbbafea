"""The dcmotor against the equations of a rotary hydraulic actuator, integrated by SciPy."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hmtb_twin import load_arm
from hmtb_twin.parameters.drives import ACTUATORS
from hmtb_twin.parameters.values import JOINTS

BENCH = """
<mujoco>
  <option timestep="0.0001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="shaft" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="{J} {J} {J}"/>
    </body>
  </worldbody>
  <actuator>
    <dcmotor joint="shaft" motorconst="{D}" resistance="{R}" inductance="{L} 0" saturation="{T} 0 0"
      input="voltage"/>
  </actuator>
</mujoco>
"""


def bench(actuator, inertia):
    text = BENCH.format(
        J=inertia,
        D=actuator.displacement,
        R=actuator.flow_pressure_gain,
        L=actuator.compliance,
        T=actuator.maximum_torque,
    )
    return mujoco.MjModel.from_xml_string(text)


@pytest.mark.parametrize("name", ["shoulder_yaw", "elbow_pitch", "wrist_roll"])
def test_valve_step_follows_the_load_pressure_equations(name):
    actuator, inertia, flow = ACTUATORS[name], 5.0, 0.3 * ACTUATORS[name].rated_flow
    model = bench(actuator, inertia)
    data = mujoco.MjData(model)
    data.ctrl[0] = flow
    instants = np.linspace(0.01, 0.5, 50)
    speed, pressure = [], []
    for instant in instants:
        while data.time < instant - 1e-9:
            mujoco.mj_step(model, data)
        speed.append(data.qvel[0])
        pressure.append(data.act[0])

    def equations(_, state):
        w, p = state
        load_flow = actuator.displacement * w + actuator.flow_pressure_gain * p
        return [actuator.displacement * p / inertia, (flow - load_flow) / actuator.compliance]

    exact = solve_ivp(equations, (0, 0.5), [0, 0], t_eval=instants, rtol=1e-10, atol=1e-12, method="LSODA").y
    np.testing.assert_allclose(speed, exact[0], atol=5e-3 * exact[0].max())
    np.testing.assert_allclose(pressure, exact[1], atol=5e-3 * exact[1].max())


@pytest.mark.parametrize("name", JOINTS)
def test_no_load_speed_and_stall_pressure(name):
    actuator = ACTUATORS[name]
    model = bench(actuator, 1.0)
    data = mujoco.MjData(model)
    data.ctrl[0] = actuator.rated_flow
    mujoco.mj_step(model, data, nstep=20_000)
    assert data.qvel[0] == pytest.approx(actuator.no_load_speed, rel=1e-3)
    # Stalled, the fully open valve builds up the supply pressure but for the internal leakage.
    assert actuator.rated_flow / actuator.flow_pressure_gain == pytest.approx(
        actuator.hydraulics.pressure / (1.0 + actuator.hydraulics.leakage)
    )


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


def test_dry_friction_is_a_spring_until_breakaway(arm):
    actuator = ACTUATORS["elbow_pitch"]
    coulomb = actuator.friction.coulomb * actuator.maximum_torque
    breakaway = actuator.friction.static_ratio * coulomb
    bristles = coulomb / actuator.friction.presliding
    kp, _ = arm.gains["elbow_pitch"]
    angles = arm.pose("rpcm_holster_out_approach")
    for torque, sticks in ((0.5 * coulomb, True), (4.0 * breakaway, False)):
        data = arm.rest(angles)
        data.ctrl[7] += torque
        mujoco.mj_step(arm.model, data, nstep=3000)
        # At rest the servo's stiffness and, as long as they stick, the bristles carry the torque together.
        stuck = torque / (kp + bristles)
        moved = abs(data.qpos[3] - angles[3])
        assert bool(moved == pytest.approx(stuck, rel=0.1)) is sticks
        assert moved > 0.9 * stuck
