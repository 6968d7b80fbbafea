"""Intervals without servo power in a log, and how far the arm sank in each."""

from dataclasses import dataclass
from math import degrees

import numpy as np

from hmtb_twin.bus.joint_log import JointLog
from hmtb_twin.control.experiment import Status


@dataclass(frozen=True)
class ShutdownInterval:
    """One interval without servo power, and the joint that moved furthest in it.

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
        """Return the interval as a dictionary of plain values, for JSON."""
        return {"start_s": self.start, "end_s": self.end, "ends": self.ends, "joint": self.joint, "sank_rad": self.sank}


def shutdown_intervals(log: JointLog) -> tuple[ShutdownInterval, ...]:
    """Return the intervals without servo power in a log, in order."""
    # Padding with zeros closes intervals at either end of the record.
    off = np.concatenate(([0], (log.status & Status.SHUT_DOWN) != 0, [0])).astype(int)
    edges = np.diff(off)
    intervals = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        # Up to and including the first tick with power again, at which the arm still stands where it sank.
        distance = np.abs(log.true_angles[first : last + 1] - log.true_angles[first]).max(axis=0)
        joint = int(distance.argmax())
        ends = bool(last < len(log))
        intervals.append(
            ShutdownInterval(first * log.dt, last * log.dt, ends, log.joints[joint], float(distance[joint]))
        )
    return tuple(intervals)
