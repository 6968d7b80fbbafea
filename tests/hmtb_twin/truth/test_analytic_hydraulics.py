"""The simulated actuators against linear hydraulics in closed form, one joint of the arm free and the others held.

The bench is the arm's own compiled model: the other joints carry an enormous armature, gravity, pin and stops are off,
and the servo's gains are zero, so that its feedforward torque asks for a valve flow.
"""

from copy import copy
from dataclasses import dataclass, replace
from itertools import product
from math import pi, sqrt

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

from hmtb_twin import JOINTS, Plant, load_arm
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.parameters.drives import Actuator
from hmtb_twin.parameters.variants import OPERATING_POSE
from hmtb_twin.truth.analytic_hydraulics import LinearHydraulics, linear_hydraulics
from hmtb_twin.truth.linearization import sample_map
from tests.refusals import refused

CONDITIONS = {
    "nominal": Plant(),
    "low and cold": Plant(supply_pressure=10.35, oil_temperature=10.0),
    "high and hot": Plant(supply_pressure=30.0, oil_temperature=80.0),
}
EVERY = pytest.mark.parametrize(("name", "conditions"), list(product(JOINTS, CONDITIONS)))
FIXED = 1e9  # armature that holds a joint, kg m^2
REFINED = {"wrist_roll": 4}
"""Steps in place of one, where the oil rings so fast on so little inertia that the arm's own step shows."""


@dataclass(frozen=True)
class Bench:
    """One free joint of an arm."""

    model: mujoco.MjModel
    joint: int
    actuator: Actuator
    theory: LinearHydraulics
    angles: np.ndarray

    def start(self):
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.angles
        data.ctrl[0::2] = self.angles
        mujoco.mj_forward(self.model, data)
        return data

    def ask(self, data, flow):
        """Ask the servo for the torque that makes it open the valve for a flow, cm^3/s."""
        data.ctrl[2 * self.joint + 1] = flow * self.actuator.displacement / self.actuator.flow_pressure_gain

    @property
    def load(self):
        """Place of the load pressure among the activations."""
        return eq.LINEAR_STATES * self.joint + eq.LINEAR_LOAD

    def run(self, flows):
        """Return velocity and load pressure (N, 2) after each step of a run from rest."""
        data, read = self.start(), np.empty((len(flows), 2))
        for row, flow in zip(read, flows, strict=True):
            self.ask(data, flow)
            mujoco.mj_step(self.model, data)
            row[:] = data.qvel[self.joint], data.act[self.load]
        return read

    def stall_torque(self):
        """Torque of the fully open valve on the joint, which is held from now on, N m."""
        self.model.dof_armature[self.joint] = FIXED
        data = self.start()
        data.ctrl[2 * self.joint + 1] = 10.0 * self.actuator.maximum_torque
        mujoco.mj_step(self.model, data, nstep=round(20.0 * self.actuator.motor.lag / self.model.opt.timestep) + 1)
        return float(data.actuator_force[2 * self.joint])


def bench(name, plant=CONDITIONS["nominal"], *, valve=True, servo=False):
    """The bench of one joint, with the servo's gains at zero or as they are."""
    arm = load_arm(plant=plant, friction=False)
    joint, model = JOINTS.index(name), copy(arm.model if valve else arm.unpowered)
    model.opt.gravity[:] = 0.0
    model.opt.timestep /= REFINED.get(name, 1)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.jnt_stiffness[:] = 0.0
    model.dof_armature[:], model.dof_damping[0] = FIXED, model.dof_damping[1]
    model.dof_armature[joint] = 0.0
    if not servo:
        gains = [eq.STIFFNESS, eq.DAMPER, eq.PRESSURE_GAIN, eq.DYNAMIC_GAIN, eq.COMPENSATED]
        model.actuator_user[2 * joint, gains] = 0.0
    angles = arm.pose(OPERATING_POSE)
    actuator = replace(arm.actuators[name], valve_open=valve)
    inertia = arm.controller.inertia_matrix(angles)[joint, joint]
    return Bench(model, joint, actuator, linear_hydraulics(actuator, inertia), angles)


def oscillator(poles):
    """Natural frequency, rad/s, and damping ratio of two poles."""
    squared, total = np.prod(poles).real, np.sum(poles).real
    return sqrt(squared), -total / (2.0 * sqrt(squared))


def linearized(machine, servo=None):
    """Poles of velocity and load pressure, or of the joint under a servo, by the map of one physics step, rad/s."""
    model, n, i, h = machine.model, machine.model.nv, machine.joint, machine.model.opt.timestep
    A = sample_map(model, machine.start(), period=h)[0]
    kept = [n + i, 2 * n + machine.load]
    if servo is not None:
        kept = [i, *kept] + ([2 * n + machine.load + eq.LINEAR_FILTERED - eq.LINEAR_LOAD] if servo.dynamic else [])
    return continuous_poles(A[np.ix_(kept, kept)], h)


def continuous_poles(step, period):
    """Poles of one step's map, rad/s, slowest first."""
    poles = np.log(np.linalg.eigvals(step).astype(complex)) / period
    return poles[np.argsort(-poles.real, kind="stable")]


def test_formulas_are_those_of_the_state_equations():
    example = LinearHydraulics(
        inertia=12.0, displacement=20.0, compliance=0.02, flow_pressure_gain=0.4, drag=0.7, largest_flow=90.0
    )
    for name, value in (("inertia", 0.0), ("compliance", -0.1), ("displacement", np.nan)):
        refused(f"{name} = .* expected above 0", replace, example, **{name: value})
    for theory in (example, replace(example, flow_pressure_gain=40.0)):
        joint = np.array([-theory.drag, theory.displacement]) / theory.inertia
        oil = -np.array([theory.displacement, theory.flow_pressure_gain]) / theory.compliance
        dynamics = np.array([joint, oil])
        np.testing.assert_allclose(np.poly(theory.poles).real, np.poly(dynamics), rtol=1e-12)
        drive = np.array([0.0, 1.0 / theory.compliance])
        steady = -np.linalg.solve(dynamics, drive)
        assert theory.velocity_gain == pytest.approx(steady[0], rel=1e-12)
        times = np.array([0.0, 1e-3, 0.03, 0.7])
        exact = [steady - expm(dynamics * t) @ steady for t in times]
        np.testing.assert_allclose(theory.step(times), exact, rtol=1e-9, atol=1e-15)
        lines = np.array([0.0, 0.3, 5.0, 80.0])
        exact = [np.linalg.solve(2j * pi * f * np.eye(2) - dynamics, drive) for f in lines]
        np.testing.assert_allclose(theory.response(lines), exact, rtol=1e-12)


def test_formulas_are_those_of_the_textbook():
    actuator = load_arm(friction=False).actuators["elbow_pitch"]
    inertia, beta = 15.0, actuator.hydraulics.bulk_modulus
    D, V, K = actuator.displacement, actuator.trapped_volume, actuator.flow_pressure_gain
    theory = linear_hydraulics(actuator, inertia)
    assert theory.natural_frequency == pytest.approx(sqrt(4.0 * beta * D**2 / (V * inertia)), rel=1e-12)
    classic = K / D * sqrt(beta * inertia / V) + actuator.drag / (4.0 * D) * sqrt(V / (beta * inertia))
    assert theory.damping_ratio == pytest.approx(classic, rel=1e-12)
    # What drag and leakage take is what the textbook neglects against one.
    leaky, tight = 1.0 + actuator.hydraulics.leakage, 1.0 + theory.leak_ratio
    assert theory.velocity_gain * tight == pytest.approx(1.0 / D, rel=1e-12)
    assert theory.no_load_speed * tight == pytest.approx(actuator.rated_flow / D, rel=1e-12)
    assert theory.stall_torque * leaky == pytest.approx(D * actuator.hydraulics.pressure, rel=1e-12)


@pytest.mark.parametrize("law", ["flow", "torque"])
def test_servo_poles_are_those_that_the_gains_were_placed_for(law):
    arm = load_arm(plant=Plant(servo=law))
    inertia = np.diag(arm.controller.inertia_matrix(arm.pose(OPERATING_POSE)))
    for name, seen in zip(JOINTS, inertia, strict=True):
        theory, servo = linear_hydraulics(arm.actuators[name], seen), arm.servos[name]
        poles = theory.servo_poles(arm.gains[name])
        wanted = [servo.slow_pole] if law == "flow" else [servo.slow_pole, servo.fast_pole]
        for pole in wanted:
            assert np.abs(poles / pole - 1.0).min() < 1e-6
        if law == "flow":
            swinging = poles[np.abs(poles.imag) > 1e-6]
            assert (-swinging.real > 0.3 * np.abs(swinging)).all()


@pytest.mark.slow
@EVERY
def test_linearised_step_has_the_hydraulic_poles(name, conditions):
    machine = bench(name, CONDITIONS[conditions])
    theory = machine.theory
    poles = linearized(machine)
    frequency, damping = oscillator(poles)
    assert frequency == pytest.approx(theory.natural_frequency * sqrt(1.0 + theory.leak_ratio), rel=5e-3)
    assert damping == pytest.approx(oscillator(theory.poles)[1], rel=5e-3)
    if oscillator(theory.poles)[1] > 1.0:
        np.testing.assert_allclose(poles.imag, 0.0, atol=1e-9)
    np.testing.assert_allclose(poles, theory.poles, rtol=1e-2)


@EVERY
def test_step_of_flow(name, conditions):
    machine = bench(name, CONDITIONS[conditions])
    theory, h = machine.theory, machine.model.opt.timestep
    flow = 0.1 * theory.largest_flow
    read = machine.run(np.full(round(0.5 / h), flow))
    ends = h * np.arange(1, len(read) + 1)
    exact = flow * theory.step(ends)
    error = np.abs(read - exact).max(axis=0) / np.abs(exact).max(axis=0)
    assert error.max() < 1e-4


@pytest.mark.slow
@EVERY
def test_velocity_gain_no_load_speed_and_stall_torque(name, conditions):
    machine = bench(name, CONDITIONS[conditions])
    theory = machine.theory
    # Poles that nearly coincide, or swing, settle to 1e-5 in fifteen time constants.
    steps = round(15.0 / abs(theory.poles[0].real) / machine.model.opt.timestep)
    for part in (0.1, 5.0):
        data = machine.start()
        # Far beyond its limit the valve is fully open whatever the joint does.
        wanted = part * theory.largest_flow
        for _ in range(steps):
            machine.ask(data, wanted)
            mujoco.mj_step(machine.model, data)
        expected = theory.velocity_gain * wanted if part < 1.0 else theory.no_load_speed
        assert data.qvel[machine.joint] == pytest.approx(expected, rel=1e-4)
    assert machine.stall_torque() == pytest.approx(theory.stall_torque, rel=1e-4)
    assert theory.stall_torque < machine.actuator.maximum_torque


@EVERY
def test_closed_valve_rings_at_the_hydraulic_resonance(name, conditions):
    machine = bench(name, CONDITIONS[conditions], valve=False)
    theory, h = machine.theory, machine.model.opt.timestep
    assert theory.damping_ratio < 0.3
    data = machine.start()
    data.act[machine.load] = 1.0
    read = np.empty((round(5.0 * 2.0 * pi / theory.natural_frequency / h), 2))
    for row in read:
        mujoco.mj_step(machine.model, data)
        row[:] = data.qvel[machine.joint], data.act[machine.load]
    # The map from one state to the next, by least squares over the ringing.
    rung = continuous_poles(np.linalg.lstsq(read[:-1], read[1:])[0], h)
    assert oscillator(rung) == pytest.approx((theory.natural_frequency, theory.damping_ratio), rel=1e-2)
    assert oscillator(linearized(machine)) == pytest.approx(oscillator(theory.poles), rel=1e-2)


@pytest.mark.parametrize("name", JOINTS)
@pytest.mark.parametrize("law", ["flow", "torque"])
def test_servo_of_the_held_joint(name, law):
    machine = bench(name, Plant(servo=law), servo=True)
    gains = load_arm(plant=Plant(servo=law)).gains[name]
    expected = machine.theory.servo_poles(gains)
    # Poles that nearly coincide are known less well than their polynomial.
    np.testing.assert_allclose(np.poly(linearized(machine, gains)).real, np.poly(expected).real, rtol=2e-3)
