"""Operator's motion in free space: the stick moves the tool from one drawn place to the next, without looking."""

import numpy as np

from hmtb_twin import Motion, View
from scenarios.experiments.operator import PEAK, Skill, Step, Submovement

REACH = 0.12
"""Largest distance of a target from the start along each direction of the tool, m."""

TURN = 0.15
"""Largest angle of a target about each direction of the tool, rad."""

PAUSE = (0.3, 0.8)
"""Shortest and longest pause between movements, s."""


class ReachingOperator:
    """Moves the tool in minimum-jerk movements [FlashHogan1985] in Cartesian rate mode.

    Speeds and the shortest movement are those of the exchange of the replacement unit. The operator does not look: runs
    with one seed have the same motion of the stick, whatever the arm does.

    Args:
        gains: Velocity per volt of the six axes, m/(s V) and rad/(s V).
        seed: Draws targets and pauses.
    """

    def __init__(self, gains: np.ndarray, seed: int) -> None:
        self._gains = gains
        # A stream of its own: one seed draws the noise of the laboratory too.
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(7,)))
        self._place = np.zeros(6)
        self._movement = Submovement(np.zeros(6), 0.0, Skill.quickest)
        self._next = self._movement.end

    def move(self, view: View) -> Motion:
        """Return the stick motion of a tick; called once per tick."""
        if view.time >= self._next:
            target = self._rng.uniform(-1.0, 1.0, 6) * np.repeat((REACH, TURN), 3)
            way = target - self._place
            # As long as the slower of translation and rotation takes at its peak speed.
            times_at_peak_speed = np.linalg.norm(way[:3]) / Step.speed, np.linalg.norm(way[3:]) / Skill.turning
            duration = max(Skill.quickest, PEAK * float(max(times_at_peak_speed)))
            self._movement = Submovement(way, view.time, duration)
            self._place, self._next = target, self._movement.end + self._rng.uniform(*PAUSE)
        return Motion(self._movement.velocity(view.time) / self._gains, grip=False)
