"""Where an experiment leaves the linear range: the converters' ends and the velocity limit of the command."""

import numpy as np

from hmtb_twin import JointLog, Status
from scenarios.excitation_computer import BOARD
from scenarios.preparation import settled
from scenarios.scenario import Scenario


def clipped_share(log: JointLog, scenario: Scenario) -> float:
    """Share of the samples in which a converter clips, between 0 and 1.

    Args:
        log: The log of an experiment: counts of the hand controller at an end of its converter.
        scenario: The experiment: files that ask for more than the excitation computer's converter gives.
    """
    clipped = (log.status & Status.CONVERTER_SATURATED) != 0
    for entry in scenario.excitation:
        clipped |= BOARD.beyond(entry.asked(scenario.duration)[:, 0])
    return float(np.mean(clipped))


def velocity_limited_share(log: JointLog) -> float:
    """Share of the samples in which a joint's command moves as fast as its limit allows, between 0 and 1."""
    return _share(log, Status.VELOCITY_LIMITED)


def _share(log: JointLog, flag: Status) -> float:
    return float(np.mean((log.status & flag) != 0))


def swing(log: JointLog, joint: str) -> float:
    """Half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)
