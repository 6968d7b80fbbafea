"""Control modes: how stick motions become joint commands, within velocity limits and joint ranges."""

import math
from typing import Protocol

import numpy as np
import pinocchio as pin

from hmtb_twin.arm.arm import Arm
from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.damped_rates import DampedRates
from hmtb_twin.control.experiment import Experiment, Status
from hmtb_twin.control.resolved_rate import ResolvedRate
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.values import HandController

NORMAL, VELOCITY_LIMITED, JOINT_LIMITED = Status(0), int(Status.VELOCITY_LIMITED), int(Status.JOINT_LIMITED)
"""Status of most ticks, and flags as plain numbers: making an enumeration costs as much as the command itself."""


class SingleJoint:
    """Joint commands from stick deflections, within velocity limits and joint ranges.

    In position mode a deflection is an offset from the reference pose, in rate mode a velocity.

    Args:
        pose: Reference pose, where the command starts (7,), rad.
        joints: Joints that the stick moves, their places among those of the arm.
        lower: Lower ends of the joint ranges (7,), rad.
        upper: Upper ends (7,), rad.
        step: Largest change of each joint's command in one tick (7,), rad; infinite without a velocity limit.
        dt: Length of a tick in rate mode, s; None in position mode.
    """

    def __init__(
        self,
        pose: np.ndarray,
        joints: list[int],
        lower: np.ndarray,
        upper: np.ndarray,
        step: np.ndarray,
        dt: float | None,
    ) -> None:
        # Plain numbers: one tick of one joint costs less than a call of numpy.
        self._command = np.asarray(pose, dtype=float).tolist()
        self._reference = self._command.copy()
        low, high, steps = lower.tolist(), upper.tolist(), step.tolist()
        self._joints = [(j, low[j], high[j], steps[j]) for j in joints]
        self._lower, self._upper, self._dt = lower, upper, dt

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Compute the joint command of the next tick from the stick deflection.

        Args:
            deflection: Offsets in rad, or velocities in rad/s, of the joints that move (n,).

        Returns:
            The command (7,), rad, and its limits.
        """
        status, command = 0, self._command
        for (joint, lower, upper, step), demand in zip(self._joints, deflection.tolist(), strict=True):
            previous = command[joint]
            change = self._reference[joint] + demand - previous if self._dt is None else demand * self._dt
            if abs(change) > step:
                change = math.copysign(step, change)
                status |= VELOCITY_LIMITED
            unbounded = previous + change
            command[joint] = min(max(unbounded, lower), upper)
            if unbounded != command[joint]:
                status |= JOINT_LIMITED
        flags = Status(status) if status else NORMAL
        return np.array(command), flags

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Restart the command at measured angles: the present deflection then stands for them; see `Mode`."""
        self._command = np.clip(angles, self._lower, self._upper).tolist()
        self._reference = self._command.copy()
        if self._dt is None:
            for (joint, *_), demand in zip(self._joints, deflection.tolist(), strict=True):
                self._reference[joint] -= demand
        # An arm that sank onto a stop may stand beyond the range of its commands.
        status = NORMAL if np.array_equal(self._command, angles) else Status.JOINT_LIMITED
        return np.array(self._command), status


class Cartesian:
    """Joint commands from stick deflections in the tool frame, within velocity limits and joint ranges.

    In position mode a deflection is an offset from the reference pose of the tool, in its frame; in rate mode a
    velocity in the current tool frame. Directions without an axis of the stick are held.

    Args:
        controller: The controller's own model.
        rates: What finds the joint commands of a wanted tool pose.
        pose: Joint angles of the reference pose, where the command starts (n,), rad.
        directions: Places in `TOOL_AXES` of the directions that the stick moves.
        lower: Lower ends of the joint ranges (n,), rad.
        upper: Upper ends (n,), rad.
        dt: Length of a tick in rate mode, s; None in position mode.
    """

    def __init__(
        self,
        controller: ControllerModel,
        rates: ResolvedRate | DampedRates,
        pose: np.ndarray,
        directions: list[int],
        lower: np.ndarray,
        upper: np.ndarray,
        dt: float | None,
    ) -> None:
        self._controller, self._rates = controller, rates
        self._directions, self._lower, self._upper = directions, lower, upper
        self._dt = dt
        self._command = np.array(pose, dtype=float)
        self._position, self._rotation = controller.tool_pose(self._command)

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Compute the joint command of the next tick from the stick deflection in the tool frame.

        Args:
            deflection: Offsets in m and rad, or velocities in m/s and rad/s, of the directions that move (n,).

        Returns:
            The command (7,), rad, and its limits.
        """
        twist = np.zeros(6)
        twist[self._directions] = deflection if self._dt is None else self._dt * deflection
        position = self._position + self._rotation @ twist[:3]
        rotation = self._rotation @ pin.exp3(twist[3:]) if twist[3:].any() else self._rotation
        reached = self._rates.follow(self._command, position, rotation)
        self._command = reached.angles
        status = (
            reached.velocity_limited * Status.VELOCITY_LIMITED
            | reached.joint_limited * Status.JOINT_LIMITED
            | reached.singular * Status.SINGULAR
        )
        if self._dt is not None:
            # A limited rate command must not wind up: the reference follows what the tool reached.
            if status:
                position, rotation = self._controller.tool_pose(self._command)
            self._position, self._rotation = position, rotation
        return self._command.copy(), Status(status)

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Restart the command at measured angles: the present deflection then stands for the tool pose there."""
        self._command = np.clip(angles, self._lower, self._upper)
        self._position, self._rotation = self._controller.tool_pose(self._command)
        if self._dt is None:
            # The inverse of what `step` does with the deflection, in opposite order.
            twist = np.zeros(6)
            twist[self._directions] = deflection
            self._rotation = self._rotation @ pin.exp3(-twist[3:])
            self._position = self._position - self._rotation @ twist[:3]
        status = NORMAL if np.array_equal(self._command, angles) else Status.JOINT_LIMITED
        return self._command.copy(), status


MODES = ("single_joint", "single_joint_rate", "cartesian", "cartesian_rate")
"""The control modes: a deflection is an offset (position mode) or a velocity (rate mode), of a joint or of the tool in
its own frame."""

TOOL_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
"""Axes of the two three-axis hand controllers: translations along, rotations about x, y and z of the tool frame."""


class Mode(Protocol):
    """A control mode; it keeps the last command."""

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Return the next joint command (7,), rad, and its limits, from stick deflections (n_axes,) in SI units."""
        ...

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Restart the command at measured angles (7,), rad, so that the arm does not jump; return as `step` does."""
        ...


def axis_names(mode: str, variant: str = "nominal") -> tuple[str, ...]:
    """Return the axes that the stick can move in a mode on a variant; raises `TwinError` for unknown ones."""
    if mode not in MODES:
        raise TwinError(f"unknown mode {mode!r}, available: {', '.join(MODES)}")
    arm = arm_named(variant)
    if not mode.startswith("cartesian"):
        return arm.free
    return TOOL_AXES


def axis_gains(mode: str, axes: tuple[str, ...], parameters: HandController) -> np.ndarray:
    """Return the gain of each axis (n_axes,) from deflection in V, in rad/V, m/V, rad/(s V) or m/(s V)."""
    rate = mode.endswith("rate")
    joint = parameters.rate_gain if rate else parameters.gain
    translation = parameters.translation_rate_gain if rate else parameters.translation_gain
    rotation = parameters.rotation_rate_gain if rate else parameters.rotation_gain
    if not mode.startswith("cartesian"):
        # A joint may have any name, also that of an axis of the tool.
        return np.full(len(axes), joint)
    gains = {"x": translation, "y": translation, "z": translation, "roll": rotation, "pitch": rotation, "yaw": rotation}
    return np.array([gains[name] for name in axes])


def start_mode(experiment: Experiment, arm: Arm) -> Mode:
    """Return the control mode of an experiment, its command at the experiment's pose.

    Raises:
        TwinError: Unknown mode, or axes that the mode does not have.
    """
    available = axis_names(experiment.mode, arm.variant)
    axes = experiment.axes
    if not axes or len(set(axes)) != len(axes) or set(axes) - set(available):
        hint = "; the shoulder roll is indexed" if set(axes) & set(arm.indexed) else ""
        raise TwinError(
            f"{experiment.name}: axes {', '.join(axes) or 'none'} given, expected different ones of "
            f"{', '.join(available)} in mode {experiment.mode}{hint}"
        )
    pose = arm.pose(experiment.pose)
    lower, upper, tick = arm.description.lower, arm.description.upper, arm.description.sample_time
    step = arm.velocity_limits * tick if experiment.chain.velocity_limit else np.full(len(pose), np.inf)
    dt = tick if experiment.mode.endswith("rate") else None
    if experiment.mode.startswith("cartesian"):
        directions = [TOOL_AXES.index(name) for name in axes]
        # The test bed has a closed form of its chain; every other one is solved by least squares.
        solver = ResolvedRate if arm.description.rigid is None else DampedRates
        rates = solver(arm.controller, lower=lower, upper=upper, step=step)
        return Cartesian(arm.controller, rates, pose, directions, lower, upper, dt)
    return SingleJoint(pose, [arm.description.joint_index(name) for name in axes], lower, upper, step, dt)
