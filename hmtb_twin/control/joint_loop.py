"""The loop of a joint controller: delayed measurements in, commands within velocity limits and joint ranges out."""

import numpy as np

from hmtb_twin.arm.arm import Arm
from hmtb_twin.control.experiment import JointController, Status
from hmtb_twin.files.errors import TwinError


class JointLoop:
    """A joint controller between the control mode and the position loop of one experiment.

    Args:
        controller: The controller.
        arm: The arm as its controller knows it.
        pose: Reference pose, where the command starts (7,), rad.
        ticks: Length N of the experiment.
        velocity_limit: Whether commands move no faster than their limits.

    Attributes:
        controller: The controller.
        requested: What the control mode asked for (N, 7), rad.
    """

    def __init__(
        self, controller: JointController, arm: Arm, pose: np.ndarray, ticks: int, *, velocity_limit: bool
    ) -> None:
        self.controller, self._delays = controller, arm.delays
        description, n = arm.description, len(pose)
        self._lower, self._upper = description.lower, description.upper
        self._step = arm.velocity_limits * description.sample_time if velocity_limit else np.full(n, np.inf)
        self._fixed = [description.joint_index(name) for name in arm.indexed]
        self._sent = pose
        self.requested = np.empty((ticks, n))
        self._readings = np.empty((ticks, n))

    def step(self, tick: int, requested: np.ndarray, reading: np.ndarray, *, running: bool) -> tuple[np.ndarray, int]:
        """Advance one tick.

        Args:
            tick: The tick.
            requested: Joint command of the control mode (7,), rad.
            reading: Resolver readings at this tick (7,), rad.
            running: Whether the servos have power now and had it at the tick before.

        Returns:
            The command (7,), rad, and its limits, bits of `Status`.

        Raises:
            TwinError: The controller returns no finite command of seven joints.
        """
        self.requested[tick], self._readings[tick] = requested, reading
        if tick == 0 or not running:
            # Without power the command follows the arm; at the first tick it is the reference pose.
            self._sent = self._sent if tick == 0 else requested
            self.controller.restart(self._sent.copy())
        if not running:
            return requested, 0
        # Before its delay has passed, a reading shows the arm at rest.
        measured = self._readings[np.maximum(tick - self._delays, 0), np.arange(len(requested))]
        # Copies: a controller that changes its arguments must not change the records.
        answer = self.controller.command(requested.copy(), measured, self._sent.copy())
        command = np.asarray(answer, dtype=float)
        if command.shape != requested.shape or not np.isfinite(command).all():
            raise TwinError(f"its joint controller gave {answer!r}, expected {len(requested)} finite angles in rad")
        # An indexed joint is held by its pin: no controller moves it.
        command[self._fixed] = requested[self._fixed]
        slewed = np.clip(command, self._sent - self._step, self._sent + self._step)
        self._sent = np.clip(slewed, self._lower, self._upper)
        velocity_limited = bool((slewed != command).any())
        joint_limited = bool((self._sent != slewed).any())
        return self._sent, velocity_limited * Status.VELOCITY_LIMITED | joint_limited * Status.JOINT_LIMITED
