"""The simulated actuators against linear hydraulics in closed form, one joint of the arm free and the others held.

The bench is the arm's own compiled model: the other joints carry an enormous armature, gravity, pin and stops are off,
and the servo's gains are zero, so that its feedforward torque asks for a valve flow. The wrist roll's shaft is light,
its resonance near 100 Hz: where that is to be seen, its step is a fraction of the arm's, which suits 1 Hz servo loops.
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
from hmtb_twin.parameters.drives import Actuator
from hmtb_twin.parameters.values import OPERATING_POSE
from hmtb_twin.truth.analytic_hydraulics import LinearHydraulics, linear_hydraulics
from tests.refusals import refused

CONDITIONS = {
    "nominal": Plant(),
    "low and cold": Plant(supply_pressure=10.35, oil_temperature=10.0),
    "high and hot": Plant(supply_pressure=30.0, oil_temperature=80.0),
}
EVERY = pytest.mark.parametrize(("name", "conditions"), list(product(JOINTS, CONDITIONS)))
REFINED = {"wrist_roll": 8}  # steps of the bench in one of the arm, where a shaft's resonance asks for them
FIXED = 1e9  # armature that holds a joint, kg m^2


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
        load_flow = self.actuator.displacement * data.qvel[self.joint]
        lost = self.actuator.flow_pressure_gain
        data.ctrl[2 * self.joint + 1] = (flow - load_flow) * self.actuator.displacement / lost

    def run(self, flows):
        """Return velocity and load pressure (N, 2) after each step of a run from rest."""
        data, read = self.start(), np.empty((len(flows), 2))
        for row, flow in zip(read, flows, strict=True):
            self.ask(data, flow)
            mujoco.mj_step(self.model, data)
            row[:] = data.qvel[self.joint], data.act[self.joint]
        return read

    def stall_torque(self):
        """Torque of the fully open valve on the joint, which is held from now on, N m."""
        self.model.dof_armature[self.joint] = FIXED
        data = self.start()
        data.ctrl[2 * self.joint + 1] = 10.0 * self.actuator.maximum_torque
        mujoco.mj_step(self.model, data, nstep=round(20.0 * self.actuator.motor.lag / self.model.opt.timestep) + 1)
        return float(data.actuator_force[self.joint])


def bench(name, plant=CONDITIONS["nominal"], *, valve=True, refined=1):
    """The bench of one joint, with the servo's gains at zero."""
    arm = load_arm(plant=plant, friction=False)
    joint, model = JOINTS.index(name), copy(arm.model if valve else arm.unpowered)
    model.opt.gravity[:] = 0.0
    model.opt.timestep /= refined
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.dof_armature[np.arange(len(JOINTS)) != joint] = FIXED
    model.actuator_gainprm[joint, [4, 6]] = 0.0
    angles = arm.pose(OPERATING_POSE)
    actuator = replace(arm.actuators[name], valve_open=valve)
    inertia = arm.controller.inertia_matrix(angles)[joint, joint]
    return Bench(model, joint, actuator, linear_hydraulics(actuator, inertia), angles)


def oscillator(poles):
    """Natural frequency, rad/s, and damping ratio of two poles."""
    squared, total = np.prod(poles).real, np.sum(poles).real
    return sqrt(squared), -total / (2.0 * sqrt(squared))


def linearized(machine, drift=0.0, gains=None):
    """Poles of velocity and load pressure by finite differences of one physics step, rad/s, slowest first.

    A closed valve is closed only off its kink at zero, hence the drift in rad/s. With gains of the servo, the pole of
    the angle is among those returned.
    """
    model, data, i = machine.model, machine.start(), machine.joint
    data.qvel[i] = drift
    n = model.nv
    if gains is not None:
        model.actuator_gainprm[i] = gains
    A, B = np.empty((2 * n + model.na,) * 2), np.empty((2 * n + model.na, model.nu))
    mujoco.mjd_transitionFD(model, data, 1e-5, True, A, B, None, None)
    kept = [n + i, 2 * n + i] if gains is None else [i, n + i, 2 * n + i]
    step = A[np.ix_(kept, kept)]
    if machine.actuator.valve_open and gains is None:
        # The servo makes up for the load flow D w; holding the valve still instead takes that away again.
        per_speed = machine.actuator.displacement**2 / machine.actuator.flow_pressure_gain
        step[:, 0] -= B[kept, 2 * i + 1] * per_speed
    return continuous_poles(step, model.opt.timestep)


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


def test_servo_poles_are_those_that_the_gains_were_placed_for():
    arm = load_arm(plant=Plant(friction="none"))
    inertia = np.diag(arm.controller.inertia_matrix(arm.pose(OPERATING_POSE)))
    for name, seen in zip(JOINTS, inertia, strict=True):
        theory, servo = linear_hydraulics(arm.actuators[name], seen), arm.servos[name]
        poles = theory.servo_poles(*arm.gains[name])
        np.testing.assert_allclose(poles[:2], [servo.slow_pole, servo.fast_pole], rtol=1e-6)


@EVERY
def test_linearised_step_has_the_hydraulic_poles(name, conditions):
    machine = bench(name, CONDITIONS[conditions])
    theory = machine.theory
    poles = linearized(machine)
    frequency, damping = oscillator(poles)
    assert frequency == pytest.approx(theory.natural_frequency * sqrt(1.0 + theory.leak_ratio), rel=5e-3)
    assert damping == pytest.approx(oscillator(theory.poles)[1], rel=5e-3)
    if theory.damping_ratio > 1.0:
        np.testing.assert_allclose(poles.imag, 0.0, atol=1e-9)
    np.testing.assert_allclose(poles, theory.poles, rtol=1e-2)


@EVERY
def test_step_of_flow(name, conditions):
    machine = bench(name, CONDITIONS[conditions], refined=REFINED.get(name, 1))
    theory, h = machine.theory, machine.model.opt.timestep
    flow = 0.1 * theory.largest_flow
    read = machine.run(np.full(round(0.5 / h), flow))
    ends = h * np.arange(1, len(read) + 1)
    exact = flow * theory.step(ends)
    # Semi-implicit Euler leaps: its velocities are those half a step later.
    exact[:, 0] = flow * theory.step(ends + 0.5 * h)[:, 0]
    error = np.abs(read - exact).max(axis=0) / np.abs(exact).max(axis=0)
    assert error.max() < 2e-3


@EVERY
def test_velocity_gain_no_load_speed_and_stall_torque(name, conditions):
    machine = bench(name, CONDITIONS[conditions])
    theory = machine.theory
    steps = round(10.0 / abs(theory.poles[0].real) / machine.model.opt.timestep)
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
    machine = bench(name, CONDITIONS[conditions], valve=False, refined=REFINED.get(name, 1))
    theory, h = machine.theory, machine.model.opt.timestep
    assert theory.damping_ratio < 0.3
    data = machine.start()
    data.act[machine.joint] = 1.0
    read = np.empty((round(5.0 * 2.0 * pi / theory.natural_frequency / h), 2))
    for row in read:
        mujoco.mj_step(machine.model, data)
        row[:] = data.qvel[machine.joint], data.act[machine.joint]
    # The map from one state to the next, by least squares over the ringing.
    rung = continuous_poles(np.linalg.lstsq(read[:-1], read[1:])[0], h)
    assert oscillator(rung) == pytest.approx((theory.natural_frequency, theory.damping_ratio), rel=1e-2)
    assert oscillator(linearized(machine, drift=1e-3)) == pytest.approx(oscillator(theory.poles), rel=1e-2)


def test_fast_shaft_behind_a_closed_valve_needs_a_finer_step():
    errors = []
    for refined in (1, 2, 4):
        machine = bench("wrist_roll", valve=False, refined=refined)
        resonance, expected = oscillator(linearized(machine, drift=1e-3))[0], oscillator(machine.theory.poles)[0]
        errors.append(abs(resonance / expected - 1.0))
    assert 0.01 < errors[0] < 0.06
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize("name", JOINTS)
def test_servo_of_the_held_joint(name):
    arm = load_arm(friction=False)
    for refined, dominant in ((1, 2e-3), (8, 3e-4)):
        machine = bench(name, refined=refined)
        poles = linearized(machine, gains=arm.model.actuator_gainprm[machine.joint])
        expected = machine.theory.servo_poles(*arm.gains[name])
        assert poles.real.max() == pytest.approx(expected[0].real, rel=dominant)
    # Two of the wrist roll's nearly coincide: their polynomial is known better than they are.
    np.testing.assert_allclose(np.poly(poles).real, np.poly(expected).real, rtol=1e-2)
