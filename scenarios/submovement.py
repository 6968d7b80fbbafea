"""A discrete hand movement: smooth, minimum-jerk, of chosen length and duration."""

from dataclasses import dataclass

import numpy as np

PEAK = 1.875
"""Peak speed of a minimum-jerk movement over its mean speed [FlashHogan1985]."""


@dataclass(frozen=True)
class Submovement:
    """A minimum-jerk movement, `v(t) = d / T 30 s^2 (1 - s)^2` with `s = t / T` [FlashHogan1985, eq. 5].

    Attributes:
        distance: How far it goes along each direction (n,), m or rad.
        start: When it starts, s.
        duration: How long it takes, s.
    """

    distance: np.ndarray
    start: float
    duration: float

    def velocity(self, time: float) -> np.ndarray:
        """Return the velocity at a time (n,), m/s or rad/s; zero before and after the movement."""
        s = min(max((time - self.start) / self.duration, 0.0), 1.0)
        return self.distance * (30.0 * s * s * (1.0 - s) * (1.0 - s) / self.duration)

    @property
    def end(self) -> float:
        """When it ends, s."""
        return self.start + self.duration
