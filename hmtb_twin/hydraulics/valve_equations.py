"""Equations of the orifice actuators: plain functions of numbers and arrays, which Numba compiles unchanged.

Units are MPa, cm^3 and s throughout, so that states have order one and displacement times pressure is a torque in N m.
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import Any

import numpy as np

try:
    from numba import carray, cfunc, types
    from numba.extending import register_jitable
# An incompatible installation fails with AttributeError, SystemError or OSError.
except Exception as error:  # The equations themselves need no compiler; `orifice` reports what is missing.
    COMPILER = False
    FAULT = (
        "is not installed"
        if isinstance(error, ModuleNotFoundError) and error.name == "numba"
        else f"cannot be loaded ({type(error).__name__}: {error})"
    )

    def register_jitable(function: Any) -> Any:
        """Return a function unchanged."""
        return function
else:
    COMPILER, FAULT = True, ""

(
    COUNT,
    DISPLACEMENT,
    CHAMBER,
    LEAKAGE,
    RATED,
    LAND,
    FREQUENCY,
    DAMPING,
    UNDERLAP,
    CLEARANCE,
    TRANSITION,
    STIFFNESS,
    DAMPER,
    PRESSURE_GAIN,
    DYNAMIC_GAIN,
    COMPENSATED,
    WASHOUT,
    OPEN,
    RETURN,
    RELIEF,
    CHECK,
    BRISTLE,
    BRISTLE_DAMPING,
    COULOMB,
    STATIC,
    STRIBECK,
    BRISTLE_RATE,
    SET,
    DROOP,
    PUMP,
    CAPACITY,
) = range(31)
"""Places of a valve's parameters in its `user` array."""

PARAMETERS = 31
"""Length of that array."""

MARK = 418.75
"""First dynamics parameter that marks the valves of this package."""

STATES = 6
"""States of a joint: spool, its velocity, bristles, filtered load pressure, mean and load pressure; the last drives."""

SPOOL, SPOOL_VELOCITY, BRISTLES, FILTERED, MEAN, LOAD = range(STATES)
"""Places of a joint's states; the supply pressure that all joints share stands before those of the first joint."""


@register_jitable
def opening(uncovered: float, clearance: float) -> float:
    """Opening of a land, part of full stroke, smooth from covered to open [Eryilmaz2000]."""
    return 0.5 * (uncovered + sqrt(uncovered * uncovered + clearance * clearance))


@register_jitable
def root(drop: float, transition: float) -> float:
    """Signed square root of a pressure drop in MPa, proportional to it well below the transition pressure."""
    return drop / sqrt(sqrt(drop * drop + transition * transition))


@register_jitable
def land_flows(p: np.ndarray, spool: float, supply: float, a: float, b: float) -> tuple[float, float, float, float]:
    """Flow through the four lands, cm^3/s: supply to A, A to return, supply to B, B to return."""
    stroke = min(max(spool, -1.0), 1.0)
    forward = p[OPEN] * p[LAND] * opening(stroke + p[UNDERLAP], p[CLEARANCE])
    backward = p[OPEN] * p[LAND] * opening(-stroke + p[UNDERLAP], p[CLEARANCE])
    return (
        forward * root(supply - a, p[TRANSITION]),
        backward * root(a - p[RETURN], p[TRANSITION]),
        backward * root(supply - b, p[TRANSITION]),
        forward * root(b - p[RETURN], p[TRANSITION]),
    )


@register_jitable
def check_flow(p: np.ndarray, pressure: float) -> float:
    """Flow into a chamber from the return line through its anti-cavitation valve, less that of its relief valve."""
    return p[CHECK] * (max(p[RETURN] - pressure, 0.0) - max(pressure - p[RELIEF], 0.0))


@register_jitable
def spool_command(p: np.ndarray, torque: float, load: float, filtered: float, velocity: float) -> float:
    """Spool command of the amplifier: flow to reach the wanted load pressure, to cover leakage and to move the joint.

    K (T/D - P) + C T/D + c D w - K' (P - P_filtered), c the part of the load flow that is compensated: the last term,
    dynamic pressure feedback, fades within the washout time and damps the oil's resonance without letting a standing
    load move the joint [Merritt1967].
    """
    wanted = torque / p[DISPLACEMENT]
    flow = p[PRESSURE_GAIN] * (wanted - load) + p[LEAKAGE] * wanted
    flow += p[COMPENSATED] * p[DISPLACEMENT] * velocity
    flow -= p[DYNAMIC_GAIN] * (load - filtered)
    return min(max(p[OPEN] * flow / p[RATED], -1.0), 1.0)


@register_jitable
def bristle_rate(p: np.ndarray, bristles: float, velocity: float) -> float:
    """Rate of the bristles' deflection, rad/s [Canudas1995]; they settle no faster than at the rate `BRISTLE_RATE`.

    The bound is far above the bandwidth of anything else: it spares the integrator the bristles of a fast joint, whose
    force is that of Stribeck's curve either way.
    """
    if p[BRISTLE] == 0.0:
        return -p[BRISTLE_RATE] * bristles
    level = p[COULOMB] + (p[STATIC] - p[COULOMB]) * exp(-((velocity / p[STRIBECK]) ** 2))
    settled = level / p[BRISTLE]
    rate = abs(velocity) / settled
    rate = rate / sqrt(1.0 + (rate / p[BRISTLE_RATE]) ** 2)
    if velocity == 0.0:
        return 0.0
    return rate * (settled * (1.0 if velocity > 0.0 else -1.0) - bristles)


@register_jitable
def friction_torque(p: np.ndarray, bristles: float, velocity: float) -> float:
    """Torque of the seals against the motion, N m."""
    return p[BRISTLE] * bristles + p[BRISTLE_DAMPING] * bristle_rate(p, bristles, velocity)


@register_jitable
def pump_flow(p: np.ndarray, supply: float) -> float:
    """Flow of the pump at a supply pressure, cm^3/s: its compensator lets the pressure droop under load."""
    return min(max(p[DROOP] * (p[SET] - supply), 0.0), p[PUMP])


@register_jitable
def supply_rate(p: np.ndarray, supply: float, drawn: float) -> float:
    """Rate of the supply pressure, MPa/s, from the first valve's parameters and the flow that all valves draw."""
    return (pump_flow(p, supply) - drawn) / p[CAPACITY]


@register_jitable
def joint_rates(
    p: np.ndarray, state: np.ndarray, supply: float, torque: float, velocity: float, rates: np.ndarray
) -> None:
    """Write the rates of one joint's states.

    Args:
        p: Parameters of its valve (PARAMETERS,).
        state: Its states (STATES,).
        supply: Supply pressure, MPa.
        torque: Torque that the position servo asks for, N m.
        velocity: Joint velocity, rad/s.
        rates: Where the rates (STATES,) go.
    """
    x, v, mean, load = state[SPOOL], state[SPOOL_VELOCITY], state[MEAN], state[LOAD]
    command = spool_command(p, torque, load, state[FILTERED], velocity)
    stopped = (x >= 1.0 and v > 0.0) or (x <= -1.0 and v < 0.0)
    a, b = mean + 0.5 * load, mean - 0.5 * load
    supply_a, a_return, supply_b, b_return = land_flows(p, x, supply, a, b)
    moved = p[DISPLACEMENT] * velocity + p[LEAKAGE] * load
    rate_a = (supply_a - a_return + check_flow(p, a) - moved) / p[CHAMBER]
    rate_b = (supply_b - b_return + check_flow(p, b) + moved) / p[CHAMBER]
    rates[SPOOL] = 0.0 if stopped else v
    rates[SPOOL_VELOCITY] = p[FREQUENCY] * (p[FREQUENCY] * (command - x) - 2.0 * p[DAMPING] * v)
    rates[BRISTLES] = bristle_rate(p, state[BRISTLES], velocity)
    rates[FILTERED] = (load - state[FILTERED]) / p[WASHOUT]
    rates[MEAN] = 0.5 * (rate_a + rate_b)
    rates[LOAD] = rate_a - rate_b


@register_jitable
def servo_torque(p: np.ndarray, command: float, feedforward: float, angle: float, velocity: float) -> float:
    """Torque command of the position servo, N m."""
    return p[STIFFNESS] * (command - angle) - p[DAMPER] * velocity + feedforward


@register_jitable
def drawn_flow(parameters: np.ndarray, act: np.ndarray) -> float:
    """Flow that all valves (n, PARAMETERS) draw from the supply at states (1 + n STATES,), cm^3/s."""
    drawn = 0.0
    for j in range(len(parameters)):
        first = 1 + j * STATES
        mean, load = act[first + MEAN], act[first + LOAD]
        flows = land_flows(parameters[j], act[first + SPOOL], act[0], mean + 0.5 * load, mean - 0.5 * load)
        drawn += flows[0] + flows[2]
    return drawn


def arm_rates(
    parameters: np.ndarray, act: np.ndarray, control: np.ndarray, angle: np.ndarray, velocity: np.ndarray
) -> np.ndarray:
    """Return the rates of all states of an arm's actuators, as MuJoCo computes them.

    Args:
        parameters: Parameters of each joint's valve (n, PARAMETERS).
        act: States (1 + n STATES,): supply pressure in MPa, then those of each joint.
        control: Commanded angle in rad and feedforward torque in N m of each joint in turn (2 n,).
        angle: Joint angles (n,), rad.
        velocity: Joint velocities (n,), rad/s.

    Returns:
        Rates (1 + n STATES,), per second.
    """
    rates = np.empty(1 + len(parameters) * STATES)
    rates[0] = supply_rate(parameters[0], act[0], drawn_flow(parameters, act))
    for j, p in enumerate(parameters):
        own = slice(1 + j * STATES, 1 + (j + 1) * STATES)
        torque = servo_torque(p, control[2 * j], control[2 * j + 1], angle[j], velocity[j])
        joint_rates(p, act[own], act[0], torque, velocity[j], rates[own])
    return rates


def compiled_callbacks(offsets: Mapping[str, int], *, cached: bool = True) -> tuple[Any, Any]:
    """Compile the activation dynamics and the bias force of the orifice actuators for MuJoCo.

    An arm's actuators stand first in its model, for each joint the valve and then the input of its feedforward torque.
    Each valve's call writes the rates of its states, the first one's also that of the supply pressure. Other actuators,
    without `MARK`, are not touched. Everything is read from the two structures, so that any number of threads may call
    at the same time.

    Args:
        offsets: Byte offsets of the arrays, from `struct_offsets`.
        cached: Whether the machine code is kept on disk, which spares later processes seconds.

    Returns:
        The compiled functions; they must stay alive for as long as MuJoCo may call them.

    Raises:
        RuntimeError: There is no folder in which machine code could be kept.
    """
    dynprm, user = offsets["actuator_dynprm"] // 8, offsets["actuator_user"] // 8
    act, act_dot, ctrl = offsets["act"] // 8, offsets["act_dot"] // 8, offsets["ctrl"] // 8
    length, velocity = offsets["actuator_length"] // 8, offsets["actuator_velocity"] // 8
    struct = types.CPointer(types.CPointer(types.float64))
    signature = types.float64(struct, struct, types.int32)

    # Numba keys its cache on this file and on the variables closed over, the offsets among them.
    @cfunc(signature, cache=cached)
    def rates(model, data, valve):  # type: ignore[no-untyped-def]
        if model[dynprm][10 * valve] != MARK:
            return 0.0
        n, j = int(model[user][COUNT]), valve // 2
        parameters = carray(model[user], (n, 2, PARAMETERS))[:, 0, :]
        states, slopes = carray(data[act], (1 + n * STATES,)), carray(data[act_dot], (1 + n * STATES,))
        p, first, speed = parameters[j], 1 + j * STATES, data[velocity][valve]
        torque = servo_torque(p, data[ctrl][valve], data[ctrl][valve + 1], data[length][valve], speed)
        joint_rates(p, states[first : first + STATES], states[0], torque, speed, slopes[first : first + STATES])
        if j == 0:
            slopes[0] = supply_rate(p, states[0], drawn_flow(parameters, states))
        return 0.0

    @cfunc(signature, cache=cached)
    def bias(model, data, valve):  # type: ignore[no-untyped-def]
        if model[dynprm][10 * valve] != MARK:
            return 0.0
        n, j = int(model[user][COUNT]), valve // 2
        p = carray(model[user], (n, 2, PARAMETERS))[j, 0]
        return -friction_torque(p, data[act][1 + j * STATES + BRISTLES], data[velocity][valve])

    return rates, bias
