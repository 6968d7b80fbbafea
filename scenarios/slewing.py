"""How much of an experiment the velocity limit of the command shapes."""

import numpy as np

from hmtb_twin import JointLog
from hmtb_twin.parameters import MOTIONS
from scenarios.preparation import settled

EXACT = 1e-9
"""A step of the command counts as the largest one allowed within this, rad."""


def slewing(log: JointLog, joint: str) -> float:
    """Share of the samples in which the command changes by exactly what the velocity limit allows.

    Args:
        log: The log of an experiment.
        joint: The excited joint.

    Returns:
        Between 0 and 1, over the settled part.
    """
    step = np.abs(np.diff(settled(log, joint).u[:, 0]))
    return float(np.mean(np.abs(step - MOTIONS[joint].velocity_limit * log.dt) < EXACT))


def swing(log: JointLog, joint: str) -> float:
    """Half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)
