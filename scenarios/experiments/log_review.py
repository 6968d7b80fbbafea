"""Settled part of a log without its means, and where the log left the linear range."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from hmtb_twin import JOINTS, JointLog, Status
from scenarios.files.errors import ScenarioError
from sysid import IOData

SETTLING = 4.0
"""Length cut off at the start, s: every waveform file repeats in it, and the arm settles to its periodic response.

Detrending a record with its start removes different constants from input and output, because the output lags; a
constant of a hundredth of a milliradian is enough to make an output-error model of high order invent a pole at 0.002
Hz. The thesis too let each excitation reach steady state [Morris1996, sec. II.2B].
"""


def settled(log: JointLog, joints: str | Sequence[str]) -> IOData:
    """Return commanded and measured angles of joints without the start of the log; the means stay.

    Args:
        log: The log of an experiment.
        joints: The joint, or several.

    Returns:
        Record in rad, named after the experiment.

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
    """Return the `settled` part of a log without its means, which is what estimators get."""
    return settled(log, joints).detrend()


def velocity_limited_share(log: JointLog) -> float:
    """Return the fraction of samples at which a joint's command moves at its velocity limit."""
    return float(np.mean((log.status & Status.VELOCITY_LIMITED) != 0))


def swing(log: JointLog, joint: str) -> float:
    """Return half of the distance between the largest and the smallest command over the settled part, rad."""
    return float(np.ptp(settled(log, joint).u[:, 0]) / 2)


@dataclass(frozen=True)
class ShutdownInterval:
    """One interval without servo power.

    Attributes:
        start: First time without power, s.
        end: First time with power again, or the end of the record, s.
        ends: Whether power came back in the record.
        joint: Joint that moved furthest from its angle at the start.
        sank: Distance that it moved, rad.
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
        """Return plain values for JSON."""
        return {"start_s": self.start, "end_s": self.end, "ends": self.ends, "joint": self.joint, "sank_rad": self.sank}


def shutdown_intervals(log: JointLog) -> tuple[ShutdownInterval, ...]:
    """Return the intervals without servo power in a log, in order."""
    # Padding with zeros closes intervals at either end of the record.
    off = np.concatenate(([0], (log.status & Status.SHUT_DOWN) != 0, [0])).astype(int)
    edges = np.diff(off)
    intervals = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        distance = np.abs(log.true_angles[first : last + 1] - log.true_angles[first]).max(axis=0)
        joint = int(distance.argmax())
        ends = bool(last < len(log))
        intervals.append(ShutdownInterval(first * log.dt, last * log.dt, ends, JOINTS[joint], float(distance[joint])))
    return tuple(intervals)
