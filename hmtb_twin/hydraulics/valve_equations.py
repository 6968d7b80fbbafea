"""Equations of the drives, linear and with servo valves: plain functions, which Numba compiles unchanged.

Units are MPa, cm^3 and s throughout, so that states have order one and displacement times pressure is a torque in N m.
Of an electric drive, current stands for pressure and voltage for flow.
"""

from collections.abc import Mapping
from math import exp, sqrt
from typing import Any

import numpy as np
from numba import carray, cfunc, types
from numba.extending import register_jitable

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
    SLOPE,
    FEED,
    LARGEST,
    LIMIT,
    SLIP,
) = range(36)
"""Places of a drive's parameters in its `user` array; the two forms share those that both have."""

PARAMETERS = 36
"""Length of that array."""

VALVE_MARK = 418.75
"""First dynamics parameter that marks the servo valves of this package."""

LINEAR_MARK = 419.75
"""First dynamics parameter that marks its linear drives."""

LOAD_LOSS = 1
"""Place, after the mark, of the friction that goes with the load, as a part of it."""

STATES = 6
"""States of a servo valve's joint: spool, its velocity, bristles, filtered load pressure, mean and load pressure."""

SPOOL, SPOOL_VELOCITY, BRISTLES, FILTERED, MEAN, LOAD = range(STATES)
"""Places of these states; the supply pressure that all joints share stands before those of the first joint."""

LINEAR_STATES = 3
"""States of a linear drive's joint."""

LINEAR_BRISTLES, LINEAR_FILTERED, LINEAR_LOAD = range(LINEAR_STATES)
"""Places of these states: bristles, filtered load pressure, load pressure. The last state drives in both forms."""


@register_jitable
def opening(uncovered: float, clearance: float) -> float:
    """Opening of a land, part of full stroke, smooth from covered to open [Eryilmaz2000]."""
    # At the edge half the clearance is open: the lands leak at null.
    return 0.5 * (uncovered + sqrt(uncovered * uncovered + clearance * clearance))


@register_jitable
def root(drop: float, transition: float) -> float:
    """Signed square root of a pressure drop in MPa, proportional to it well below the transition pressure."""
    # The plain root has an infinite slope at zero, where neither the integrator nor Newton's method could go on.
    return drop / sqrt(sqrt(drop * drop + transition * transition))


@register_jitable
def land_flows(p: np.ndarray, spool: float, supply: float, a: float, b: float) -> tuple[float, float, float, float]:
    """Flow through the four lands, cm^3/s: supply to A, A to return, supply to B, B to return."""
    stroke = min(max(spool, -1.0), 1.0)
    forward = p[OPEN] * p[LAND] * opening(stroke + p[UNDERLAP], p[CLEARANCE])
    backward = p[OPEN] * p[LAND] * opening(-stroke + p[UNDERLAP], p[CLEARANCE])
    supply_a = forward * root(supply - a, p[TRANSITION])
    a_return = backward * root(a - p[RETURN], p[TRANSITION])
    supply_b = backward * root(supply - b, p[TRANSITION])
    b_return = forward * root(b - p[RETURN], p[TRANSITION])
    return supply_a, a_return, supply_b, b_return


@register_jitable
def check_flow(p: np.ndarray, pressure: float) -> float:
    """Flow into a chamber from the return line through its anti-cavitation valve, less that of its relief valve."""
    return p[CHECK] * (max(p[RETURN] - pressure, 0.0) - max(pressure - p[RELIEF], 0.0))


@register_jitable
def servo_flow(
    p: np.ndarray, standing: float, position: float, feedforward: float, load: float, filtered: float, velocity: float
) -> float:
    """Flow that a joint's servo demands of its valve, by position control, feedforward and pressure feedback.

    F u/D + S f/D + G ((u + f)/D - P) + c D w - G' (P - P_filtered), with the position torque u and the feedforward f,
    the flow S that a standing load takes per pressure, and c the part of the load flow that is compensated. The last
    term, dynamic pressure feedback, fades within the washout time and damps the oil's resonance without letting a
    standing load move the joint [Merritt1967].
    """
    flow = (p[FEED] * position + standing * feedforward) / p[DISPLACEMENT]
    flow += p[PRESSURE_GAIN] * ((position + feedforward) / p[DISPLACEMENT] - load)
    flow += p[COMPENSATED] * p[DISPLACEMENT] * velocity
    return flow - p[DYNAMIC_GAIN] * (load - filtered)


@register_jitable
def spool_command(p: np.ndarray, flow: float) -> float:
    """Return the spool command for a wanted flow, as a fraction of the full stroke."""
    return min(max(p[OPEN] * flow / p[RATED], -1.0), 1.0)


@register_jitable
def bristle_rate(p: np.ndarray, bristles: float, velocity: float, lost: float = 0.0) -> float:
    """Rate of the bristle deflection in the LuGre model of friction, rad/s [Canudas1995].

    Friction that goes with the load adds `lost`, N m, a part of the torque that the drive exerts, to Stribeck's curve.

    The bristles settle no faster than at the rate `BRISTLE_RATE`. This bound is far above the bandwidth of anything
    else: it spares the integrator the bristles of a fast joint, whose force is that of Stribeck's curve either way.
    """
    if p[BRISTLE] == 0.0:
        return -p[BRISTLE_RATE] * bristles
    # Stribeck's curve: static friction at rest falls to Coulomb friction.
    level = p[COULOMB] + (p[STATIC] - p[COULOMB]) * exp(-((velocity / p[STRIBECK]) ** 2)) + lost
    # |w| with a smooth reversal, which an integrator of fourth order needs.
    speed = velocity * velocity / sqrt(velocity * velocity + p[SLIP] * p[SLIP])
    rate = speed * p[BRISTLE] / level
    return (velocity - rate * bristles) / sqrt(1.0 + (rate / p[BRISTLE_RATE]) ** 2)


@register_jitable
def friction_torque(p: np.ndarray, bristles: float, rate: float) -> float:
    """Torque of the seals against the motion, N m, from deflection and rate of the bristles."""
    return p[BRISTLE] * bristles + p[BRISTLE_DAMPING] * rate


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
    p: np.ndarray,
    state: np.ndarray,
    supply: float,
    position: float,
    feedforward: float,
    velocity: float,
    rates: np.ndarray,
    load_loss: float = 0.0,
) -> None:
    """Write the rates of the states of one servo valve's joint.

    Args:
        p: Parameters of its valve (PARAMETERS,).
        state: Its states (STATES,).
        supply: Supply pressure, MPa.
        position: Position torque of the servo, N m.
        feedforward: Its feedforward torque, N m.
        velocity: Joint velocity, rad/s.
        rates: Where the rates (STATES,) go.
        load_loss: Friction that goes with the load, as a part of it.
    """
    x, v, mean, load = state[SPOOL], state[SPOOL_VELOCITY], state[MEAN], state[LOAD]
    command = spool_command(p, servo_flow(p, p[LEAKAGE], position, feedforward, load, state[FILTERED], velocity))
    # At its stop the spool rests until its velocity, which goes on as a state, points back.
    stopped = (x >= 1.0 and v > 0.0) or (x <= -1.0 and v < 0.0)
    a, b = mean + 0.5 * load, mean - 0.5 * load
    supply_a, a_return, supply_b, b_return = land_flows(p, x, supply, a, b)
    # Continuity of both chambers [Merritt1967]: the piston's flow and the leakage pass from A to B.
    crossing = p[DISPLACEMENT] * velocity + p[LEAKAGE] * load
    rate_a = (supply_a - a_return + check_flow(p, a) - crossing) / p[CHAMBER]
    rate_b = (supply_b - b_return + check_flow(p, b) + crossing) / p[CHAMBER]
    rates[SPOOL] = 0.0 if stopped else v
    rates[SPOOL_VELOCITY] = p[FREQUENCY] * (p[FREQUENCY] * (command - x) - 2.0 * p[DAMPING] * v)
    rates[BRISTLES] = bristle_rate(p, state[BRISTLES], velocity, load_loss * abs(p[DISPLACEMENT] * load))
    rates[FILTERED] = (load - state[FILTERED]) / p[WASHOUT]
    rates[MEAN] = 0.5 * (rate_a + rate_b)
    rates[LOAD] = rate_a - rate_b


@register_jitable
def linear_rates(
    p: np.ndarray,
    state: np.ndarray,
    position: float,
    feedforward: float,
    velocity: float,
    rates: np.ndarray,
    load_loss: float = 0.0,
) -> None:
    """Write the rates of the states of a linear drive's joint.

    The valve passes the flow that the servo asks for, up to its largest, less what the load pressure takes along the
    straight line from no-load flow to stall and through the leakage [Merritt1967, ch. 5 and 6].

    Args:
        p: Parameters of its drive (PARAMETERS,).
        state: Its states (LINEAR_STATES,).
        position: Position torque of the servo, N m.
        feedforward: Its feedforward torque, N m.
        velocity: Joint velocity, rad/s.
        rates: Where the rates (LINEAR_STATES,) go.
        load_loss: Friction that goes with the load, as a part of it.
    """
    load = state[LINEAR_LOAD]
    flow = servo_flow(p, p[SLOPE], position, feedforward, load, state[LINEAR_FILTERED], velocity)
    flow = min(max(flow, -p[LARGEST]), p[LARGEST])
    # Beyond the limit the drive exerts no more, and rubs no more.
    exerted = p[DISPLACEMENT] * min(abs(load), p[LIMIT])
    rates[LINEAR_BRISTLES] = bristle_rate(p, state[LINEAR_BRISTLES], velocity, load_loss * exerted)
    rates[LINEAR_FILTERED] = (load - state[LINEAR_FILTERED]) / p[WASHOUT]
    rates[LINEAR_LOAD] = (flow - p[SLOPE] * load - p[DISPLACEMENT] * velocity) / (0.5 * p[CHAMBER])


@register_jitable
def beyond_limit(p: np.ndarray, load: float) -> float:
    """Torque of the load pressure beyond the limit of a linear drive, N m, signed: the drive does not exert it."""
    return p[DISPLACEMENT] * (load - min(max(load, -p[LIMIT]), p[LIMIT]))


@register_jitable
def position_torque(p: np.ndarray, command: float, angle: float, velocity: float) -> float:
    """Position torque of the servo, N m: its command without the feedforward."""
    return p[STIFFNESS] * (command - angle) - p[DAMPER] * velocity


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
        states = slice(1 + j * STATES, 1 + (j + 1) * STATES)
        position = position_torque(p, control[2 * j], angle[j], velocity[j])
        joint_rates(p, act[states], act[0], position, control[2 * j + 1], velocity[j], rates[states])
    return rates


_STRUCT = types.CPointer(types.CPointer(types.float64))
"""A structure of MuJoCo, of which the equations see only the pointers to arrays of numbers."""

_SIGNATURE = types.float64(_STRUCT, _STRUCT, types.int32)
"""MuJoCo's callbacks of an actuator: model, data, its index."""


def compiled_callbacks(offsets: Mapping[str, int], *, cached: bool = True) -> tuple[Any, Any, Any]:
    """Compile the activation dynamics and the bias force of the drives for MuJoCo, and a clock that stands still.

    An arm's drives stand first in its model, for each joint the drive and then the input of its feedforward torque.
    Each drive's call writes the rates of its states, that of the first servo valve also the supply pressure's. Other
    actuators, without a mark, are not touched. Everything is read from the two structures, so that any number of
    threads may call at the same time.

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

    # Numba keys its cache on this file and on the variables closed over, the offsets among them.
    # A division by zero gives infinity, as in C, and spares a check of every divisor.
    @cfunc(_SIGNATURE, cache=cached, error_model="numpy")
    def rates(model, data, drive):  # type: ignore[no-untyped-def]
        mark = model[dynprm][10 * drive]
        if mark != LINEAR_MARK and mark != VALVE_MARK:
            return 0.0
        n, j, speed = int(model[user][COUNT]), drive // 2, data[velocity][drive]
        # Each drive's row is followed by that of its feedforward, which holds no parameters.
        parameters = carray(model[user], (n, 2, PARAMETERS))[:, 0, :]
        p = parameters[j]
        position = position_torque(p, data[ctrl][drive], data[length][drive], speed)
        load_loss = model[dynprm][10 * drive + LOAD_LOSS]
        forward = data[ctrl][drive + 1]
        if mark == LINEAR_MARK:
            columns = slice(j * LINEAR_STATES, (j + 1) * LINEAR_STATES)
            states, slopes = carray(data[act], (n * LINEAR_STATES,)), carray(data[act_dot], (n * LINEAR_STATES,))
            linear_rates(p, states[columns], position, forward, speed, slopes[columns], load_loss)
            return 0.0
        columns = slice(1 + j * STATES, 1 + (j + 1) * STATES)
        states, slopes = carray(data[act], (1 + n * STATES,)), carray(data[act_dot], (1 + n * STATES,))
        joint_rates(p, states[columns], states[0], position, forward, speed, slopes[columns], load_loss)
        # MuJoCo calls each drive by itself: the first one also answers for the supply that all share.
        if j == 0:
            slopes[0] = supply_rate(p, states[0], drawn_flow(parameters, states))
        return 0.0

    @cfunc(_SIGNATURE, cache=cached, error_model="numpy")
    def bias(model, data, drive):  # type: ignore[no-untyped-def]
        mark = model[dynprm][10 * drive]
        if mark != LINEAR_MARK and mark != VALVE_MARK:
            return 0.0
        n, j = int(model[user][COUNT]), drive // 2
        p = carray(model[user], (n, 2, PARAMETERS))[j, 0]
        bristles, excess = 1 + j * STATES + BRISTLES, 0.0
        if mark == LINEAR_MARK:
            first = j * LINEAR_STATES
            bristles, excess = first + LINEAR_BRISTLES, beyond_limit(p, data[act][first + LINEAR_LOAD])
        # MuJoCo has just called `rates` at this state.
        return -friction_torque(p, data[act][bristles], data[act_dot][bristles]) - excess

    @cfunc(types.float64(), cache=cached)
    def clock():  # type: ignore[no-untyped-def]
        return 0.0

    return rates, bias, clock
