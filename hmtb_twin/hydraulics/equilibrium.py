"""Static equilibrium of an arm with linear actuators whose weight its controller does not know exactly."""

from collections.abc import Callable

import mujoco
import numpy as np

from hmtb_twin.files.errors import OverloadError
from hmtb_twin.hydraulics import valve_equations as eq
from hmtb_twin.parameters.values import PIN


def pin_stiffnesses(model: mujoco.MjModel) -> np.ndarray:
    """Return the stiffness of the pin of each joint of a model (7,), N m/rad: no other spring holds a joint."""
    # The joints of the arm, one for each drive, stand before all others.
    return np.array(model.jnt_stiffness[: int(model.actuator_user[0, eq.COUNT])])


def newton(function: Callable[[np.ndarray], np.ndarray], start: np.ndarray) -> np.ndarray:
    """Find a root by Newton's method with centred differences, halving steps that do not reduce the norm.

    Args:
        function: Function (n,) of (n,), both of order one or smaller.
        start: First point (n,).

    Returns:
        The last point (n,); the caller checks whether the function vanishes there.
    """
    point, value = start, function(start)
    for _ in range(50):
        if np.abs(value).max() < 1e-12:
            break
        columns = []
        # For values of order one both errors of this difference stay small: 1e-12 by truncation, 1e-10 by rounding.
        for shift in 1e-6 * np.eye(len(point)):
            columns.append((function(point + shift) - function(point - shift)) / 2e-6)
        step = np.linalg.solve(np.column_stack(columns), -value)
        for _ in range(20):
            trial = function(point + step)
            if np.linalg.norm(trial) < np.linalg.norm(value):
                break
            step = 0.5 * step
        else:
            # No step of this direction reduces the norm: the root is as good as rounding allows, or there is none.
            break
        point, value = point + step, trial
    return point


def weight_function(model: mujoco.MjModel) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from angles (7,), rad, to the torques (7,), N m, that hold a model in free space."""
    data = mujoco.MjData(model)

    def weight(angles: np.ndarray) -> np.ndarray:
        data.qpos[:] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        torques = np.empty(model.nv)
        mujoco.mj_rne(model, data, 0, torques)
        return torques

    return weight


def inertia(model: mujoco.MjModel, angles: np.ndarray) -> np.ndarray:
    """Return the inertia matrix (7, 7) of a model in free space at joint angles (7,), kg m^2 and rad."""
    data = mujoco.MjData(model)
    data.qpos[:] = angles
    mujoco.mj_forward(model, data)
    matrix = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    # The rotors of electric drives turn with the joints; what holds an indexed joint is no part of the arm.
    indexed = pin_stiffnesses(model) > 0.0
    matrix[indexed, indexed] -= PIN.inertia
    return matrix


def drooping(
    load: Callable[[np.ndarray], np.ndarray],
    command: np.ndarray,
    feedforward: np.ndarray,
    stiffness: np.ndarray,
    pins: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Find the equilibrium of a servo arm under a constant command, k (q_cmd - q) + feedforward = load(q).

    Args:
        load: Function from angles (7,), rad, to the torques (7,), N m, that hold the arm against weight and pins.
        command: Commanded angles (7,), rad.
        feedforward: Feedforward torques (7,), N m.
        stiffness: Static stiffness k of each servo (7,), N m/rad.
        pins: Stiffness of the pin of each joint (7,), N m/rad.

    Returns:
        Joint angles (7,) in rad and torques of the drives (7,) in N m.

    Raises:
        OverloadError: There is no equilibrium.
    """

    def torque(angles: np.ndarray) -> np.ndarray:
        return stiffness * (command - angles) + feedforward

    def imbalance(angles: np.ndarray) -> np.ndarray:
        return (torque(angles) - load(angles)) / (stiffness + pins)

    angles = newton(imbalance, command)
    if not np.abs(imbalance(angles)).max() < 1e-9:
        raise OverloadError("the servos cannot hold the arm at this pose: it weighs more than its controller knows")
    return angles, torque(angles)
