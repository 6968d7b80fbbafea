"""The `orifice` actuator: servo valves on one supply as MuJoCo user dynamics, compiled by Numba."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import mujoco
import numpy as np

from hmtb_twin.files.errors import OverloadError, TwinError
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.equilibrium import newton
from hmtb_twin.hydraulics.struct_offsets import struct_offsets
from hmtb_twin.parameters.drives import RATED_PRESSURE, Actuator
from hmtb_twin.parameters.servo_valve import POWER_UNIT, SERVO_VALVE, PowerUnit, ServoValve
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS

STEP = 0.001
"""Physics step of an arm with orifice actuators, s, by the Runge-Kutta method of fourth order.

By the first-order integrators of MuJoCo the oil's resonance on a light joint needs a tenth of it."""

FASTEST_BRISTLES = 1000.0
"""Fastest rate at which bristles settle and damp a joint, 1/s; their stiffness is at most twice the inertia times its
square, which the step resolves. It matters only for worn seals on the light wrist."""


def add_orifice_actuators(
    spec: mujoco.MjSpec,
    actuators: Mapping[str, Actuator],
    gains: Mapping[str, tuple[float, float]],
    *,
    valve: ServoValve = SERVO_VALVE,
    power_unit: PowerUnit = POWER_UNIT,
) -> None:
    """Replace the actuators of a model by servo valves.

    The control vector is that of `dcmotor`: commanded angle and feedforward torque of each joint in turn; the torque is
    the control of a second actuator without force that follows each valve.

    Args:
        spec: The model; its actuators are deleted, integrator and step are set to those that servo valves need.
        actuators: Actuator of each joint, by the joint's name.
        gains: kp (N m/rad) and kd (N m s/rad) of each joint.
        valve: The servo valve, the same in size-free terms for every joint.
        power_unit: Their common supply.

    Raises:
        TwinError: Numba is not installed, or MuJoCo's structures are not recognised.
    """
    install_valve_equations()
    rigid = spec.compile()
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    spec.option.integrator, spec.option.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP
    for j, (name, actuator) in enumerate(actuators.items()):
        parameters = valve_parameters(actuator, gains[name], valve, power_unit, joints=len(actuators))
        inertia = 1.0 / rigid.dof_invweight0[rigid.joint(name).dofadr[0]]
        for place, largest in (
            (eq.BRISTLE, 2.0 * FASTEST_BRISTLES**2 * inertia),
            (eq.BRISTLE_DAMPING, FASTEST_BRISTLES * inertia),
        ):
            parameters[place] = min(parameters[place], largest)
        spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            dyntype=mujoco.mjtDyn.mjDYN_USER,
            dynprm=[eq.MARK] + 9 * [0.0],
            actdim=eq.STATES + (j == 0),
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=[actuator.displacement] + 9 * [0.0],
            biastype=mujoco.mjtBias.mjBIAS_USER,
            userdata=parameters,
        )
        spec.add_actuator(
            name=f"{name}_feedforward",
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=10 * [0.0],
        )


def valve_parameters(
    actuator: Actuator,
    gains: tuple[float, float],
    valve: ServoValve = SERVO_VALVE,
    power_unit: PowerUnit = POWER_UNIT,
    *,
    joints: int = 1,
) -> np.ndarray:
    """Return the parameters of one joint's valve in the order of `valve_equations`.

    Args:
        actuator: The joint's actuator.
        gains: kp (N m/rad) and kd (N m s/rad).
        valve: Its servo valve.
        power_unit: The supply.
        joints: Joints of the arm.

    Returns:
        Parameters (PARAMETERS,), in MPa, cm^3 and s.
    """
    oil, friction = actuator.hydraulics, actuator.friction
    # The valve's size follows from the rating, whatever the supply pressure.
    rated_flow = actuator.displacement * actuator.no_load_speed
    p = np.zeros(eq.PARAMETERS)
    p[eq.COUNT] = joints
    p[eq.DISPLACEMENT] = actuator.displacement
    p[eq.CHAMBER] = 2.0 * actuator.compliance
    p[eq.LEAKAGE] = actuator.leakage
    # The amplifier knows the set pressure: with the flow of the rating, a higher supply would feed forward more
    # velocity than the joint takes. A sagging supply errs on the safe side.
    p[eq.RATED] = actuator.rated_flow
    p[eq.COMPENSATED] = valve.compensated
    # Two lands in series share the pressure at no load.
    p[eq.LAND] = rated_flow / eq.root(RATED_PRESSURE / 2.0, valve.transition_pressure)
    p[eq.FREQUENCY], p[eq.DAMPING] = valve.angular_frequency, valve.damping
    p[eq.UNDERLAP], p[eq.CLEARANCE], p[eq.TRANSITION] = valve.underlap, valve.clearance, valve.transition_pressure
    p[eq.STIFFNESS], p[eq.DAMPER] = gains
    static = valve.static_gain(actuator, gains[1])
    p[eq.PRESSURE_GAIN] = static * actuator.compliance
    p[eq.DYNAMIC_GAIN] = (valve.loop_gain - static) * actuator.compliance
    p[eq.WASHOUT] = valve.washout_time
    p[eq.OPEN] = actuator.valve_open
    p[eq.RETURN], p[eq.RELIEF] = oil.return_pressure, valve.relief * oil.supply_pressure
    p[eq.CHECK] = valve.check_flow * rated_flow
    p[eq.STRIBECK], p[eq.BRISTLE_RATE] = 1.0, FASTEST_BRISTLES
    if friction is not None and friction.bristles:
        p[eq.COULOMB] = actuator.coulomb_torque
        p[eq.STATIC] = friction.static_ratio * p[eq.COULOMB]
        p[eq.STRIBECK] = friction.stribeck_velocity
        p[eq.BRISTLE] = p[eq.COULOMB] / friction.presliding
        p[eq.BRISTLE_DAMPING] = p[eq.BRISTLE] * friction.bristle_time
    p[eq.SET], p[eq.DROOP] = oil.supply_pressure, power_unit.droop
    p[eq.PUMP], p[eq.CAPACITY] = power_unit.largest_flow, power_unit.capacity
    return p


def arm_parameters(model: mujoco.MjModel) -> np.ndarray:
    """Return the parameters of every valve of a model with orifice actuators (n, PARAMETERS)."""
    return np.array(model.actuator_user[0::2, : eq.PARAMETERS])


def require_compiler() -> None:
    """Raise `TwinError` if Numba, which compiles the equations, is not installed or cannot be loaded."""
    if not eq.COMPILER:
        raise TwinError(
            f'actuator = "orifice" given, but Numba, which compiles its equations, {eq.FAULT}; '
            "install it with pip install 'hmtb-twin[orifice]', or use actuator = \"linear\""
        )


def install_valve_equations() -> tuple[Any, Any]:
    """Install the equations as MuJoCo's callbacks: compiled once per process, installed again if removed.

    Without them MuJoCo simulates servo valves that never move, without a warning; therefore this is called wherever an
    arm is loaded or brought to rest.

    Returns:
        The compiled functions, kept alive by a cache.

    Raises:
        TwinError: Numba is not installed or cannot be loaded, MuJoCo's structures are not recognised, or another
            callback is installed.
    """
    require_compiler()
    rates, bias = _compiled()
    places = (
        ("mjcb_act_dyn", mujoco.get_mjcb_act_dyn(), mujoco.set_mjcb_act_dyn, rates.ctypes),
        ("mjcb_act_bias", mujoco.get_mjcb_act_bias(), mujoco.set_mjcb_act_bias, bias.ctypes),
    )
    for name, present, _, ours in places:
        if present is not None and present is not ours:
            raise TwinError(
                f"another callback is installed as MuJoCo's {name}; the orifice valve needs it, and MuJoCo has one per "
                "process: remove it, or run the orifice valve in a process of its own"
            )
    for _, present, install, ours in places:
        if present is None:
            install(ours)
    return rates, bias


@cache
def _compiled() -> tuple[Any, Any]:
    offsets = struct_offsets()
    try:
        return eq.compiled_callbacks(offsets)
    except RuntimeError:
        # Neither the folder of the package nor that of the user is writable.
        return eq.compiled_callbacks(offsets, cached=False)


def settled_arm(
    model: mujoco.MjModel,
    command: np.ndarray,
    feedforward: np.ndarray,
    weight: Callable[[np.ndarray], np.ndarray],
    pinned: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the equilibrium of an arm with orifice actuators under a constant command: joints at rest, pressures steady.

    The null leakage of a valve that carries a load costs it a little opening, and so the servo a small offset of the
    joint; a joint that a pin holds stays where it is.

    Args:
        model: The arm's model.
        command: Commanded angles (7,), rad.
        feedforward: Feedforward torques (7,), N m.
        weight: Function from angles (7,), rad, to the torques (7,), N m, that hold the arm there.
        pinned: Angles (7,) at which pins hold the indexed joints, rad; the commanded ones by default.

    Returns:
        Joint angles (7,) in rad and activations (na,).

    Raises:
        OverloadError: No equilibrium: the load is more than the valves can carry.
    """
    pins = np.where([name in INDEXED_JOINTS for name in JOINTS], command if pinned is None else pinned, np.nan)
    parameters = arm_parameters(model)
    n, oil = len(parameters), parameters[0]
    controls = np.column_stack([command, feedforward]).ravel()
    steady = np.array([eq.SPOOL_VELOCITY, eq.MEAN, eq.LOAD])

    def states(unknown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        joints = np.zeros((n, eq.STATES))
        joints[:, eq.SPOOL], joints[:, eq.MEAN], joints[:, eq.LOAD] = unknown[1:].reshape(4, n)[:3]
        joints[:, eq.FILTERED] = joints[:, eq.LOAD]
        return command + unknown[1 + 3 * n :], np.concatenate([unknown[:1], joints.ravel()])

    def imbalance(unknown: np.ndarray) -> np.ndarray:
        angles, act = states(unknown)
        rates = eq.arm_rates(parameters, act, controls, angles, np.zeros(n))
        joints = rates[1:].reshape(n, eq.STATES)[:, steady] / [oil[eq.FREQUENCY] ** 2, 1e3, 1e3]
        missing = act[1:].reshape(n, eq.STATES)[:, eq.LOAD] - weight(angles) / parameters[:, eq.DISPLACEMENT]
        return np.concatenate([rates[:1], joints.ravel(), np.where(np.isnan(pins), missing, 1e3 * (angles - pins))])

    start = np.concatenate(
        [
            [oil[eq.SET]],
            np.zeros(n),
            np.full(n, 0.5 * (oil[eq.SET] + oil[eq.RETURN])),
            feedforward / parameters[:, eq.DISPLACEMENT],
            np.zeros(n),
        ]
    )
    solution = newton(imbalance, start)
    if not np.abs(imbalance(solution)).max() < 1e-9:
        stall = parameters[:, eq.DISPLACEMENT] * (oil[eq.SET] - oil[eq.RETURN])
        most = np.max(np.abs(weight(command) / stall), where=np.isnan(pins), initial=0.0)
        raise OverloadError(
            f"at {oil[eq.SET]:g} MPa the servo valves cannot hold the arm at this pose: the weight takes "
            f"{100.0 * most:.0f} % of a drive's largest torque, and what leaks through the valves leaves less than that"
        )
    return states(solution)
