"""Where an experiment leaves the linear range: the converter's ends and the velocity limit of the command."""

import numpy as np

from hmtb_twin import JointLog, Status
from scenarios.preparation import settled


def clipped_share(log: JointLog) -> float:
    """Share of the samples in which a hand-controller count stands at an end of the converter, between 0 and 1."""
    return _share(log, Status.CONVERTER_SATURATED)


def velocity_limited_share(log: JointLog) -> float:
    """Share of the samples in which a joint's command moves as fast as its limit allows, between 0 and 1."""
    return _share(log, Status.VELOCITY_LIMITED)


def _share(log: JointLog, flag: Status) -> float:
    return float(np.mean((log.status & flag) != 0))


def swing(log: JointLog, joint: str) -> float:
    """Half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)
