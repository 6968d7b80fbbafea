"""Static equilibrium of an arm with servo valves."""

from collections.abc import Callable

import mujoco
import numpy as np

from hmtb_twin.files.errors import OverloadError
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.hydraulics.drive_actuators import drive_parameters
from hmtb_twin.hydraulics.equilibrium import newton, pin_stiffnesses


def settled_arm(
    model: mujoco.MjModel,
    command: np.ndarray,
    feedforward: np.ndarray,
    load: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Find the equilibrium of an arm with orifice actuators under a constant command: joints at rest, pressures steady.

    The null leakage of a valve that carries a load costs it a little opening, and so the servo a small offset of the
    joint.

    Args:
        model: The arm's model.
        command: Commanded angles (7,), rad.
        feedforward: Feedforward torques (7,), N m.
        load: Function from angles (7,), rad, to the torques (7,), N m, that hold the arm against weight and pins.

    Returns:
        Joint angles (7,) in rad and activations (na,).

    Raises:
        OverloadError: No equilibrium: the load is more than the valves can carry.
    """
    parameters, pins = drive_parameters(model), pin_stiffnesses(model)
    n, oil = len(parameters), parameters[0]
    controls = np.column_stack([command, feedforward]).ravel()
    steady = np.array([eq.SPOOL_VELOCITY, eq.MEAN, eq.LOAD])
    displacement = parameters[:, eq.DISPLACEMENT]

    # Unknown: supply pressure, then spools, mean pressures, load pressures and droops of the joints.
    # Spool velocities and bristles vanish at rest, filtered load pressures equal the load pressures.
    def states(unknown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        joints = np.zeros((n, eq.STATES))
        joints[:, eq.SPOOL], joints[:, eq.MEAN], joints[:, eq.LOAD] = unknown[1:].reshape(4, n)[:3]
        joints[:, eq.FILTERED] = joints[:, eq.LOAD]
        return command + unknown[1 + 3 * n :], np.concatenate([unknown[:1], joints.ravel()])

    def imbalance(unknown: np.ndarray) -> np.ndarray:
        angles, act = states(unknown)
        rates = eq.arm_rates(parameters, act, controls, angles, np.zeros(n))
        # `newton` expects values of order one; spool acceleration and pressure rates are scaled to that.
        joints = rates[1:].reshape(n, eq.STATES)[:, steady] / [oil[eq.FREQUENCY] ** 2, 1e3, 1e3]
        missing = displacement * act[1:].reshape(n, eq.STATES)[:, eq.LOAD] - load(angles)
        return np.concatenate([rates[:1], joints.ravel(), missing / (displacement + 1e-3 * pins)])

    # The start: spools closed, chambers half-way between supply and return, as the controller knows the weight.
    set_pressure = [oil[eq.SET]]
    mean_pressures = np.full(n, 0.5 * (oil[eq.SET] + oil[eq.RETURN]))
    start = np.concatenate([set_pressure, np.zeros(n), mean_pressures, feedforward / displacement, np.zeros(n)])
    solution = newton(imbalance, start)
    if not np.abs(imbalance(solution)).max() < 1e-9:
        stall = displacement * (oil[eq.SET] - oil[eq.RETURN])
        # Pins carry the load of the joints that they hold.
        largest_load = np.max(np.abs(load(command) / stall), where=pins == 0.0, initial=0.0)
        raise OverloadError(
            f"at {oil[eq.SET]:g} MPa the servo valves cannot hold the arm at this pose: the weight takes "
            f"{100.0 * largest_load:.0f} % of a drive's largest torque, and what leaks through the valves leaves less "
            "than that"
        )
    return states(solution)
