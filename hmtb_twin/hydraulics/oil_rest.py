"""Where an arm with orifice actuators rests: the equilibrium of oil, joints and pins."""

from collections.abc import Callable

import mujoco
import numpy as np

from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.orifice import arm_parameters
from hmtb_twin.hydraulics.rest_newton import newton
from hmtb_twin.parameters.errors import OverloadError
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS


def settled_oil(
    parameters: np.ndarray,
    command: np.ndarray,
    feedforward: np.ndarray,
    pins: np.ndarray,
    load: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Find the equilibrium of an arm under constant commands: every joint at rest, every pressure steady.

    The null leakage of a valve that carries a load costs it a little opening, and so the servo a small offset of the
    joint; a joint that a pin holds stays where it is.

    Args:
        parameters: Parameters of each joint's valve (n, PARAMETERS).
        command: Commanded angles (n,), rad.
        feedforward: Feedforward torques (n,), N m.
        pins: Angle (n,) at which a pin holds each joint, rad; NaN for a joint without.
        load: Torques (n,) in N m that hold the arm at angles (n,) in rad.

    Returns:
        Joint angles (n,) in rad and states (1 + n STATES,).

    Raises:
        OverloadError: No equilibrium: the load is more than the valves can carry.
    """
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
        missing = act[1:].reshape(n, eq.STATES)[:, eq.LOAD] - load(angles) / parameters[:, eq.DISPLACEMENT]
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
    found = newton(imbalance, start)
    if not np.abs(imbalance(found)).max() < 1e-9:
        stall = parameters[:, eq.DISPLACEMENT] * (oil[eq.SET] - oil[eq.RETURN])
        most = np.max(np.abs(load(command) / stall), where=np.isnan(pins), initial=0.0)
        raise OverloadError(
            f"at {oil[eq.SET]:g} MPa the servo valves cannot hold the arm at this pose: the weight takes "
            f"{100.0 * most:.0f} % of a drive's largest torque, and what leaks through the valves leaves less than that"
        )
    return states(found)


def settled_arm(
    model: mujoco.MjModel,
    command: np.ndarray,
    feedforward: np.ndarray,
    weight: Callable[[np.ndarray], np.ndarray],
    pinned: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Find where an arm with orifice actuators rests under a commanded pose.

    Args:
        model: The arm's model.
        command: Commanded joint angles (7,), rad.
        feedforward: Torques (7,) that the controller feeds forward, N m.
        weight: Torques (7,) in N m that hold the arm at angles (7,) in rad; the controller may think of others.
        pinned: Angles (7,) of which those of the indexed joints hold, rad; the commanded ones by default.

    Returns:
        Joint angles (7,) in rad and activations (na,).

    Raises:
        OverloadError: The valves cannot carry the load.
    """
    pins = np.where([name in INDEXED_JOINTS for name in JOINTS], command if pinned is None else pinned, np.nan)
    return settled_oil(arm_parameters(model), command, feedforward, pins, weight)
