"""Cartesian modes: the stick moves the tool along and about the axes of its own frame, by resolved rate."""

import numpy as np
import pinocchio as pin

from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.control.resolved_rate import ResolvedRate
from hmtb_twin.control.status import Status


class Cartesian:
    """Joint commands from stick deflections in the tool frame, within velocity limits and joint ranges.

    In position mode a deflection is an offset from the reference pose of the tool, in its frame; in rate mode a
    velocity in the current tool frame. Directions without an axis of the stick are held.

    Args:
        controller: The controller's own model.
        pose: Joint angles of the reference pose, where the command starts (7,), rad.
        directions: Places in `TOOL_AXES` of the directions that the stick moves.
        lower: Lower ends of the joint ranges (7,), rad.
        upper: Upper ends (7,), rad.
        step: Largest change of each joint's command in one tick (7,), rad; infinite without a velocity limit.
        dt: Length of a tick in rate mode, s; None in position mode.
    """

    def __init__(
        self,
        controller: ControllerModel,
        pose: np.ndarray,
        directions: list[int],
        lower: np.ndarray,
        upper: np.ndarray,
        step: np.ndarray,
        dt: float | None,
    ) -> None:
        self._controller = controller
        self._resolved_rate = ResolvedRate(controller, lower=lower, upper=upper, step=step)
        self._directions, self._lower, self._upper = directions, lower, upper
        self._dt = dt
        self._command = np.array(pose, dtype=float)
        self._position, self._rotation = controller.tool_pose(self._command)

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Advance one tick.

        Args:
            deflection: Offsets in m and rad, or velocities in m/s and rad/s, of the directions that move (n,).

        Returns:
            The command (7,), rad, and what was limited.
        """
        twist = np.zeros(6)
        twist[self._directions] = deflection if self._dt is None else self._dt * deflection
        position = self._position + self._rotation @ twist[:3]
        rotation = self._rotation @ pin.exp3(twist[3:]) if twist[3:].any() else self._rotation
        reached = self._resolved_rate.follow(self._command, position, rotation)
        self._command = reached.angles
        status = (
            reached.velocity_limited * Status.VELOCITY_LIMITED
            | reached.joint_limited * Status.JOINT_LIMITED
            | reached.singular * Status.SINGULAR
        )
        if self._dt is not None:
            # What was not reached is not owed: a limited rate command does not wind up.
            self._position, self._rotation = (
                self._controller.tool_pose(self._command) if status else (position, rotation)
            )
        return self._command.copy(), Status(status)

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Take over at measured angles without a bump: this deflection now means the tool where it is.

        Args:
            angles: Measured angles (7,), rad.
            deflection: The deflection at this tick (n,).

        Returns:
            The command (7,), rad, and whether a range kept it from the angles.
        """
        self._command = np.clip(angles, self._lower, self._upper)
        self._position, self._rotation = self._controller.tool_pose(self._command)
        if self._dt is None:
            twist = np.zeros(6)
            twist[self._directions] = deflection
            self._rotation = self._rotation @ pin.exp3(-twist[3:])
            self._position = self._position - self._rotation @ twist[:3]
        limited = not np.array_equal(self._command, angles)
        return self._command.copy(), Status.JOINT_LIMITED if limited else Status(0)
