"""Settled part of a log without its means, and where the log left the linear range."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from hmtb_twin import JOINTS, JointLog, Status
from hmtb_twin.control.data_acquisition import BOARD
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from sysid import IOData

SETTLING = 4.0
"""What is cut off at the start, s: every waveform file repeats in it, and the arm has settled into its periodic answer.

Detrending a record with its start takes different constants off input and output, because the output lags; a constant
of a hundredth of a milliradian is enough to make an output-error model of high order invent a pole at 0.002 Hz. The
thesis too let each excitation reach steady state [Morris1996, sec. II.2B].
"""


def settled(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Cut off the start; the means stay.

    Args:
        log: The log of an experiment.
        joints: The joint to look at, or several.

    Returns:
        Commanded and measured angle of each joint, rad, named after the experiment.

    Raises:
        ScenarioError: The log is so short that no more would be left than is cut off.
    """
    data = log.iodata(joints)
    start = round(SETTLING / data.dt)
    if len(data) <= 2 * start:
        raise ScenarioError(
            f"{log.name}: a log of {len(data) * data.dt:g} s given, expected more than {2 * SETTLING:g} s: the arm "
            f"settles for {SETTLING:g} s, which are cut off"
        )
    return replace(data[start:], name=log.name)


def prepared(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Cut off the start, then remove the means.

    Args:
        log: The log of an experiment.
        joints: The joint to look at, or several.

    Returns:
        Commanded and measured angle of each joint, rad, named after the experiment.

    Raises:
        ScenarioError: The log is so short that no more would be left than is cut off.
    """
    return settled(log, joints).detrend()


def clipped_share(log: JointLog, scenario: Scenario) -> float:
    """Share of the samples in which a converter clips, between 0 and 1.

    Args:
        log: The log of an experiment: counts of the hand controller at an end of its converter.
        scenario: The experiment: files that ask for more than the excitation computer's converter gives.
    """
    clipped = (log.status & Status.CONVERTER_SATURATED) != 0
    for entry in scenario.excitation:
        clipped |= BOARD.exceeds_range(entry.requested_volts(scenario.duration)[:, 0])
    return float(np.mean(clipped))


def velocity_limited_share(log: JointLog) -> float:
    """Share of the samples in which a joint's command moves as fast as its limit allows, between 0 and 1."""
    return _share(log, Status.VELOCITY_LIMITED)


def _share(log: JointLog, flag: Status) -> float:
    return float(np.mean((log.status & flag) != 0))


def swing(log: JointLog, joint: str) -> float:
    """Half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)


@dataclass(frozen=True)
class ShutdownInterval:
    """One stretch without power.

    Attributes:
        start: First time without power, s.
        end: First time with power again, or the end of the record, s.
        ends: Whether power came back in the record.
        joint: Which joint moved furthest from where it stood.
        sank: How far, rad.
    """

    start: float
    end: float
    ends: bool
    joint: str
    sank: float

    def __str__(self) -> str:
        until = f"{self.end:g} s" if self.ends else f"the end at {self.end:g} s"
        return (
            f"shut down {self.start:g} to {until}: sank up to {degrees(self.sank):.1f} deg "
            f"({self.joint.replace('_', ' ')})"
        )

    def summary(self) -> dict[str, object]:
        """What JSON holds of it."""
        return {"start_s": self.start, "end_s": self.end, "ends": self.ends, "joint": self.joint, "sank_rad": self.sank}


def shutdown_intervals(log: JointLog) -> tuple[ShutdownInterval, ...]:
    """Find the stretches without power in a log.

    Args:
        log: The log of an experiment.

    Returns:
        Each of them in turn; none where the servos had power throughout.
    """
    off = np.concatenate(([0], (log.status & Status.SHUT_DOWN) != 0, [0])).astype(int)
    edges = np.diff(off)
    found = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        way = np.abs(log.true_angles[first : last + 1] - log.true_angles[first]).max(axis=0)
        joint = int(way.argmax())
        ends = bool(last < len(log))
        found.append(ShutdownInterval(first * log.dt, last * log.dt, ends, JOINTS[joint], float(way[joint])))
    return tuple(found)
