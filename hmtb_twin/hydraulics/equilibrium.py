"""Static equilibrium of an arm with linear actuators whose weight its controller does not know exactly."""

from collections.abc import Callable
from copy import copy

import mujoco
import numpy as np

from hmtb_twin.files.errors import OverloadError
from hmtb_twin.parameters.values import INDEXED_JOINTS, JOINTS


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
        columns = [(function(point + e) - function(point - e)) / 2e-6 for e in 1e-6 * np.eye(len(point))]
        step = np.linalg.solve(np.column_stack(columns), -value)
        for _ in range(20):
            trial = function(point + step)
            if np.linalg.norm(trial) < np.linalg.norm(value):
                break
            step = 0.5 * step
        else:
            break
        point, value = point + step, trial
    return point


LEAN = 1e-8
"""Displacement by which the stiffness of a pin is measured, rad: about the deflection that it has under load."""


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
    return matrix


def drooping(
    model: mujoco.MjModel,
    weight: Callable[[np.ndarray], np.ndarray],
    command: np.ndarray,
    feedforward: np.ndarray,
    stiffness: np.ndarray,
    activations: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Find the equilibrium of a servo arm under a constant command, kp (q_cmd - q) + feedforward = weight(q).

    An indexed joint leans on its pin, some 1e-8 rad, until that carries what its servo does not.

    Args:
        model: The arm in free space.
        weight: Function from angles (7,), rad, to the torques (7,), N m, that hold it.
        command: Commanded angles (7,), rad.
        feedforward: Feedforward torques (7,), N m.
        stiffness: kp of each joint (7,), N m/rad.
        activations: Function from torques (7,), N m, to the activations at which the drives exert them.

    Returns:
        Joint angles (7,) in rad and torques of the drives (7,) in N m.

    Raises:
        OverloadError: There is no equilibrium.
    """
    indexed = np.isin(JOINTS, INDEXED_JOINTS)

    def torque(angles: np.ndarray) -> np.ndarray:
        return stiffness * (command - angles) + feedforward

    def settled(pins: np.ndarray) -> np.ndarray:
        def imbalance(angles: np.ndarray) -> np.ndarray:
            return np.where(indexed, angles - pins, (torque(angles) - weight(angles)) / stiffness)

        solution = newton(imbalance, command)
        if not np.abs(imbalance(solution)).max() < 1e-9:
            raise OverloadError("the servos cannot hold the arm at this pose: it weighs more than its controller knows")
        return solution

    smooth = model
    if model.dof_frictionloss.any():
        # Dry friction would hide the force of the pin.
        smooth = copy(model)
        smooth.dof_frictionloss[:] = 0.0

    def exerting(angles: np.ndarray) -> mujoco.MjData:
        data = mujoco.MjData(smooth)
        data.ctrl[0::2], data.ctrl[1::2] = command, feedforward
        data.qpos[:], data.act[:] = angles, activations(torque(angles))
        return data

    data = exerting(settled(command))
    lean_on_pins(smooth, data)
    angles = settled(data.qpos.copy())
    return angles, torque(angles)


def lean_on_pins(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Deflect indexed joints against their pins, some 1e-8 rad, until these carry what the drives do not.

    Args:
        model: The arm's model.
        data: The arm at rest except for the pins; only the angles of indexed joints change.
    """
    for name in INDEXED_JOINTS:
        joint = model.joint(name)
        angle, speed = joint.qposadr[0], joint.dofadr[0]
        mujoco.mj_forward(model, data)
        before = data.qacc[speed]
        data.qpos[angle] += LEAN
        mujoco.mj_forward(model, data)
        # The force of a pin is linear in its deflection.
        data.qpos[angle] -= LEAN * (1.0 + before / (data.qacc[speed] - before))
