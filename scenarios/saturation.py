"""Where an experiment leaves the linear range: the converter's ends and the velocity limit of the command."""

import numpy as np

from hmtb_twin import JOINTS, JointLog
from hmtb_twin.parameters import HAND_CONTROLLER, MOTIONS
from scenarios.preparation import settled

EXACT = 1e-9
"""A step of the command counts as the largest one allowed within this, rad."""


def clipped_share(log: JointLog) -> float:
    """Share of the samples in which a hand-controller count stands at an end of the converter.

    Args:
        log: The log of an experiment.

    Returns:
        Between 0 and 1, any excited axis counting.
    """
    limit = 2 ** (HAND_CONTROLLER.adc_bits - 1)
    return float(np.mean(((log.counts <= -limit) | (log.counts >= limit - 1)).any(axis=1)))


def velocity_limited_share(log: JointLog) -> float:
    """Share of the samples in which an excited joint's command moves as fast as its limit allows.

    Args:
        log: The log of an experiment.

    Returns:
        Between 0 and 1, any excited axis counting.
    """
    if len(log) < 2:
        return 0.0
    columns = [JOINTS.index(name) for name in log.axes]
    largest = np.array([MOTIONS[name].velocity_limit * log.dt for name in log.axes])
    step = np.abs(np.diff(log.commanded[:, columns], axis=0))
    return float(np.mean((step > largest - EXACT).any(axis=1)))


def swing(log: JointLog, joint: str) -> float:
    """Half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)
