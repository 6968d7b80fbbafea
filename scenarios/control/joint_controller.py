"""Control laws as joint controllers of the laboratory: in deviations from the start, on the joints of the law."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from hmtb_twin import JOINTS


class LawRun(Protocol):
    """A control law at work on m joints, sample by sample, in deviations from where it started."""

    def command(self, requested: np.ndarray, measured: np.ndarray) -> np.ndarray:
        """Return the command (m,) for the request (m,) and the measurement (m,) of this sample, rad."""
        ...

    def applied(self, command: np.ndarray) -> None:
        """Tell the command (m,) that was applied at this sample, within all limits, rad."""
        ...


class Law(Protocol):
    """A control law, such as `sysid.Controller`, fixed or adaptive."""

    def start(self) -> LawRun:
        """Return the law at rest."""
        ...


class DeviationController:
    """Runs a law on some joints, in deviations from the commanded pose at its restart; other joints pass through.

    Args:
        law: The law.
        joints: Its joints, in the order of its inputs.
    """

    def __init__(self, law: Law, joints: Sequence[str]) -> None:
        self._law = law
        self._columns = [JOINTS.index(name) for name in joints]

    def restart(self, command: np.ndarray) -> None:
        """Begin at rest under a command (7,), rad."""
        self._origin = command[self._columns]
        self._run = self._law.start()
        self._begun = False

    def command(self, requested: np.ndarray, measured: np.ndarray, sent: np.ndarray) -> np.ndarray:
        """Return the joint command (7,), rad; see `hmtb_twin.control.experiment.JointController`."""
        chosen, origin = self._columns, self._origin
        if self._begun:
            # The limits are known one tick later.
            self._run.applied(sent[chosen] - origin)
        self._begun = True
        answer = requested.copy()
        answer[chosen] = origin + self._run.command(requested[chosen] - origin, measured[chosen] - origin)
        return answer
