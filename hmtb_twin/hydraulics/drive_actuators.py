"""Drives of an arm as MuJoCo actuators with user dynamics: linear ones, and servo valves on one supply."""

from collections.abc import Mapping
from math import ceil, sqrt

import mujoco
import numpy as np

from hmtb_twin.files.errors import TwinError
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.callbacks import install_equations
from hmtb_twin.parameters.drives import RATED_PRESSURE, Actuator, Drive
from hmtb_twin.parameters.servo_gains import ServoGains, servo_dynamics
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE, PowerUnit, ServoValve
from hmtb_twin.parameters.values import SAMPLE_TIME

ORIFICE_STEP = 0.001
"""Physics step of an arm with orifice actuators, s, by the Runge-Kutta method of fourth order.

By the first-order integrators of MuJoCo the oil's resonance on a light joint needs a tenth of it."""

MOST_STEPS = 5000
"""Most steps of the physics in a tick: a minute of motion would take hours."""

FASTEST_BRISTLES = 1000.0
"""Fastest rate at which bristles settle and damp a joint, 1/s; their stiffness is at most twice the inertia times its
square, which the step resolves, their damping at most half the inertia times it: with Coulomb friction the worn wrist
roll without a payload would swing at twice that. It matters only for worn seals and for light joints."""

LONGEST_STEP = 1.6
"""Longest physics step of linear drives in time constants of their fastest mode: at 2.8 the integrator diverges.

Stiff oil or a light specimen get a shorter step."""

FASTEST_OIL = 460.0
"""Fastest resonance of oil and inertia that the model's own step resolves with friction to 1e-5, rad/s.

The step shrinks in proportion for a faster one, that of the wrist roll without a payload."""


def add_linear_drives(
    spec: mujoco.MjSpec,
    drives: Mapping[str, Drive],
    gains: Mapping[str, ServoGains],
    *,
    sample_time: float = SAMPLE_TIME,
    refine: bool = True,
) -> None:
    """Replace the actuators of a model by linear drives.

    The control vector holds commanded angle and feedforward torque of each joint in turn; the torque is the control of
    a second actuator without force that follows each drive.

    Args:
        spec: The model; its actuators are deleted, its integrator is set to the Runge-Kutta method.
        drives: Drive of each joint, by the joint's name.
        gains: Gains of each joint's servo.
        sample_time: Length of a tick, s.
        refine: Whether the step shrinks for joints whose oil rings faster than `FASTEST_OIL`.

    Raises:
        TwinError: MuJoCo's structures are not recognised.
    """
    rows = {}
    for name, drive in drives.items():
        rows[name] = linear_parameters(drive, gains[name], joints=len(drives))
    inertias = _add_drives(spec, rows, _load_losses(drives), eq.LINEAR_MARK, eq.LINEAR_STATES, shared=0)
    model_steps = sample_time / spec.option.timestep
    # Steps end where a tick ends: the joint that needs most steps per tick decides.
    steps_per_tick = [round(model_steps)]
    for name, inertia in inertias.items():
        if spec.joint(name).stiffness[0]:
            # A pin holds the joint.
            continue
        motor = drives[name].motor
        modes = np.linalg.eigvals(servo_dynamics(inertia, drives[name].drag, motor, gains[name]))
        # Stability: the fastest mode of servo, oil and joint bounds the step.
        steps_per_tick.append(ceil(sample_time * float(np.abs(modes).max()) / LONGEST_STEP))
        if refine:
            # Accuracy: K / sqrt(L J) is the resonance of the oil (or inductance) with the inertia.
            steps_per_tick.append(ceil(model_steps * motor.constant / sqrt(motor.inductance * inertia) / FASTEST_OIL))
    steps = max(steps_per_tick)
    if steps > MOST_STEPS:
        raise TwinError(
            f"a drive, servo or friction so fast that a tick takes {steps:.3g} steps of the physics given, expected at "
            f"most {MOST_STEPS}: look for a lag, an inertia or a friction in other units"
        )
    spec.option.timestep = sample_time / steps


def add_orifice_actuators(
    spec: mujoco.MjSpec,
    actuators: Mapping[str, Actuator],
    gains: Mapping[str, ServoGains],
    *,
    valve: ServoValve = SERVO_VALVE,
    power_unit: PowerUnit = POWER_UNIT,
) -> None:
    """Replace the actuators of a model by servo valves, with the controls of `add_linear_drives`.

    Args:
        spec: The model; its actuators are deleted, integrator and step are set to those that servo valves need.
        actuators: Actuator of each joint, by the joint's name.
        gains: Gains of each joint's servo.
        valve: The servo valve, the same in size-free terms for every joint.
        power_unit: Their common supply.

    Raises:
        TwinError: MuJoCo's structures are not recognised.
    """
    rows = {}
    for name, actuator in actuators.items():
        rows[name] = valve_parameters(actuator, gains[name], valve, power_unit, joints=len(actuators))
    spec.option.timestep = ORIFICE_STEP
    _add_drives(spec, rows, _load_losses(actuators), eq.VALVE_MARK, eq.STATES, shared=1)


def _load_losses(drives: Mapping[str, Drive]) -> dict[str, float]:
    """Friction that goes with the load of each drive, as a part of it."""
    return {name: drive.friction.load_loss if drive.friction else 0.0 for name, drive in drives.items()}


def _add_drives(
    spec: mujoco.MjSpec,
    rows: Mapping[str, np.ndarray],
    load_losses: Mapping[str, float],
    mark: float,
    states: int,
    shared: int,
) -> dict[str, float]:
    """Add the drives; return the inertia that each joint sees while the others are free, kg m^2."""
    install_equations()
    rigid = spec.compile()
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    inertias = {}
    # The states that all drives share, the supply pressure, stand before those of the first.
    activations = states + shared
    for name, parameters in rows.items():
        inertia = float(1.0 / rigid.dof_invweight0[rigid.joint(name).dofadr[0]])
        parameters[eq.BRISTLE] = min(parameters[eq.BRISTLE], 2.0 * FASTEST_BRISTLES**2 * inertia)
        parameters[eq.BRISTLE_DAMPING] = min(parameters[eq.BRISTLE_DAMPING], 0.5 * FASTEST_BRISTLES * inertia)
        _add_drive(spec, name, parameters, [mark, load_losses[name]], activations)
        inertias[name] = inertia
        activations = states
    return inertias


def _add_drive(
    spec: mujoco.MjSpec, joint: str, parameters: np.ndarray, dynamics: list[float], activations: int
) -> None:
    """Add the actuator of a joint's drive and the one that carries its feedforward torque."""
    spec.add_actuator(
        name=joint,
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        dyntype=mujoco.mjtDyn.mjDYN_USER,
        dynprm=dynamics + (10 - len(dynamics)) * [0.0],
        actdim=activations,
        # The last activation is the load pressure: displacement times pressure is the torque.
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[parameters[eq.DISPLACEMENT]] + 9 * [0.0],
        biastype=mujoco.mjtBias.mjBIAS_USER,
        userdata=parameters,
    )
    # An actuator has a single control; this one, without force, only lends its control to the drive's equations.
    spec.add_actuator(
        name=f"{joint}_feedforward",
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=10 * [0.0],
    )


def linear_parameters(drive: Drive, gains: ServoGains, *, joints: int = 1) -> np.ndarray:
    """Return the parameters of a linear drive in the order of `valve_equations`.

    Args:
        drive: The joint's drive.
        gains: Gains of its servo.
        joints: Joints of the arm.

    Returns:
        Parameters (PARAMETERS,), in MPa, cm^3 and s; in A, V and s of an electric drive.
    """
    p, motor = _common_parameters(drive, gains, joints), drive.motor
    # The load pressure is the difference of two chambers: it feels half of one chamber's compliance.
    p[eq.SLOPE], p[eq.CHAMBER] = motor.resistance, 2.0 * motor.inductance
    p[eq.FEED] = motor.resistance if gains.feed is None else gains.feed
    p[eq.LARGEST], p[eq.LIMIT] = motor.largest_input, motor.maximum_torque / motor.constant
    p[eq.PRESSURE_GAIN], p[eq.DYNAMIC_GAIN], p[eq.COMPENSATED] = gains.pressure, gains.dynamic, gains.compensated
    p[eq.WASHOUT] = gains.washout
    return p


def valve_parameters(
    actuator: Actuator,
    gains: ServoGains,
    valve: ServoValve = SERVO_VALVE,
    power_unit: PowerUnit = POWER_UNIT,
    *,
    joints: int = 1,
) -> np.ndarray:
    """Return the parameters of one joint's valve in the order of `valve_equations`.

    A servo that asks for a torque closes the load-pressure loop of its valve; one whose error opens the valve feeds the
    load pressure back as far as the linear drive's load-flow line would.

    Args:
        actuator: The joint's actuator.
        gains: Gains of its servo.
        valve: Its servo valve.
        power_unit: The supply.
        joints: Joints of the arm.

    Returns:
        Parameters (PARAMETERS,), in MPa, cm^3 and s.
    """
    oil, p = actuator.hydraulics, _common_parameters(actuator, gains, joints)
    # The valve's size follows from the rating, whatever the supply pressure.
    rated_flow = actuator.displacement * actuator.no_load_speed
    p[eq.CHAMBER] = 2.0 * actuator.compliance
    p[eq.LEAKAGE] = actuator.leakage
    # The amplifier knows the set pressure: with the flow of the rating, a higher supply would feed forward more
    # velocity than the joint takes. A sagging supply errs on the safe side.
    p[eq.RATED] = actuator.rated_flow
    # Two lands in series share the pressure at no load.
    p[eq.LAND] = rated_flow / eq.root(RATED_PRESSURE / 2.0, valve.transition_pressure)
    p[eq.FREQUENCY], p[eq.DAMPING] = valve.angular_frequency, valve.damping
    p[eq.UNDERLAP], p[eq.CLEARANCE], p[eq.TRANSITION] = valve.underlap, valve.clearance, valve.transition_pressure
    if gains.feed is None:
        static = valve.static_gain(actuator, gains.kd)
        p[eq.PRESSURE_GAIN] = static * actuator.compliance
        p[eq.DYNAMIC_GAIN] = (valve.loop_gain - static) * actuator.compliance
        p[eq.WASHOUT], p[eq.COMPENSATED] = valve.washout_time, valve.compensated
    else:
        # Near null the lands hardly damp: pressure feedback takes the part of the linear drive's load-flow line.
        largest_gain = valve.loop_gain * actuator.compliance
        p[eq.PRESSURE_GAIN] = min(oil.load_flow_slope * gains.feed, largest_gain)
        # The pressure loop asks for the position torque, too: less of it must not open the valve less.
        p[eq.STIFFNESS] /= oil.load_flow_slope
        # Static and dynamic feedback close one loop through the valve, whose bandwidth bounds their sum.
        p[eq.DYNAMIC_GAIN] = min(gains.dynamic, largest_gain - p[eq.PRESSURE_GAIN])
        p[eq.WASHOUT] = gains.washout
    p[eq.OPEN] = actuator.valve_open
    p[eq.RETURN], p[eq.RELIEF] = oil.return_pressure, valve.relief * oil.supply_pressure
    p[eq.CHECK] = valve.check_flow * rated_flow
    p[eq.SET], p[eq.DROOP] = oil.supply_pressure, power_unit.droop
    p[eq.PUMP], p[eq.CAPACITY] = power_unit.largest_flow, power_unit.capacity
    return p


def _common_parameters(drive: Drive, gains: ServoGains, joints: int) -> np.ndarray:
    """Return the parameters (PARAMETERS,) that both forms of a drive have: servo stiffness, damping and friction."""
    friction, coulomb = drive.friction, drive.coulomb_torque
    p = np.zeros(eq.PARAMETERS)
    p[eq.COUNT], p[eq.DISPLACEMENT] = joints, drive.motor.constant
    p[eq.STIFFNESS], p[eq.DAMPER] = gains.kp, gains.kd
    # Without friction the velocities only keep their quotients finite.
    p[eq.STRIBECK], p[eq.SLIP], p[eq.BRISTLE_RATE] = 1.0, 1.0, FASTEST_BRISTLES
    if friction is not None and coulomb > 0.0:
        p[eq.COULOMB], p[eq.STATIC] = coulomb, friction.static_ratio * coulomb
        p[eq.STRIBECK], p[eq.SLIP] = friction.stribeck_velocity, friction.slip_velocity
        p[eq.BRISTLE], p[eq.BRISTLE_DAMPING] = friction.bristles(drive.bristle_torque, drive.drag)
    return p


def drive_parameters(model: mujoco.MjModel) -> np.ndarray:
    """Return the parameters of every drive of a model (n, PARAMETERS)."""
    # Every second actuator is a feedforward, without parameters.
    return np.array(model.actuator_user[0::2, : eq.PARAMETERS])
