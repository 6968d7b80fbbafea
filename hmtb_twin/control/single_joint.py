"""Single-joint modes: the stick moves joints one by one, the others keep their pose."""

import math

import numpy as np

from hmtb_twin.control.status import Status


class SingleJoint:
    """Joint commands from stick deflections, within velocity limits and joint ranges.

    In position mode a deflection is an offset from the reference pose, in rate mode a velocity.

    Args:
        pose: Reference pose, where the command starts (7,), rad.
        joints: Joints that the stick moves, their places in `JOINTS`.
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
        self._command = np.array(pose, dtype=float)
        self._reference = np.array(pose, dtype=float)
        # Plain numbers: one tick of one joint costs less than a call of numpy.
        self._joints = [(j, float(lower[j]), float(upper[j]), float(step[j])) for j in joints]
        self._lower, self._upper, self._dt = lower, upper, dt

    def step(self, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Advance one tick.

        Args:
            deflection: Offsets in rad, or velocities in rad/s, of the joints that move (n,).

        Returns:
            The command (7,), rad, and what was limited.
        """
        status = 0
        for (joint, lower, upper, step), moved in zip(self._joints, deflection.tolist(), strict=True):
            previous = self._command.item(joint)
            change = self._reference.item(joint) + moved - previous if self._dt is None else moved * self._dt
            if abs(change) > step:
                change = math.copysign(step, change)
                status |= Status.VELOCITY_LIMITED.value
            command = previous + change
            if not lower <= command <= upper:
                command = min(max(command, lower), upper)
                status |= Status.JOINT_LIMITED.value
            self._command[joint] = command
        return self._command.copy(), Status(status)

    def rebase(self, angles: np.ndarray, deflection: np.ndarray) -> tuple[np.ndarray, Status]:
        """Take over at measured angles without a bump: this deflection now means the arm as it stands.

        Args:
            angles: Measured angles (7,), rad.
            deflection: The deflection at this tick (n,).

        Returns:
            The command (7,), rad, and whether a range kept it from the angles.
        """
        self._command[:] = np.clip(angles, self._lower, self._upper)
        self._reference[:] = self._command
        if self._dt is None:
            for (joint, *_), moved in zip(self._joints, deflection.tolist(), strict=True):
                self._reference[joint] -= moved
        limited = not np.array_equal(self._command, angles)
        return self._command.copy(), Status.JOINT_LIMITED if limited else Status(0)
