"""Scripted operator at the hand controller: moves the stick in discrete movements and watches the forces."""

from collections import deque
from dataclasses import dataclass
from math import radians

import numpy as np
import pinocchio as pin

from hmtb_twin import Motion, View
from hmtb_twin.parameters.values import SAMPLE_TIME
from hmtb_twin.parameters.variants import LINKS
from hmtb_twin.parameters.worksite import UNIT

PEAK = 1.875
"""Peak speed of a minimum-jerk movement over its mean speed [FlashHogan1985]."""


@dataclass(frozen=True)
class Submovement:
    """Minimum-jerk movement, `v(t) = d / T 30 s^2 (1 - s)^2` with `s = t / T` [FlashHogan1985, eq. 5].

    Attributes:
        distance: Distance along each direction (n,), m or rad.
        start: Start time, s.
        duration: Duration, s.
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
        """End time, s."""
        return self.start + self.duration


GRAVITY = 9.81
"""m/s^2."""

Pose = tuple[np.ndarray, np.ndarray]
"""Position (3,), m, and rotation (3, 3) in the world."""


@dataclass(frozen=True)
class Step:
    """One step of a script.

    Attributes:
        name: Name of its phase.
        target: Target pose of the tool, or of the unit where it is carried; None for the unit, wherever it is.
        carry: Whether the operator watches the unit instead of the tool.
        near: Distance at which the target counts as reached, m.
        aside: The same across the tool's axis, m; `near` by default.
        turn: Angle at which the target counts as reached, rad.
        speed: Peak speed, m/s.
        stride: Longest submovement, m.
        touching: Whether contact is expected: the operator watches the force display, yields sideways, backs off from
            large forces, and takes resistance near the target for the target.
        closed: Whether the end effector closes at the target.
        pause: Waiting time at the target, s.
    """

    name: str
    target: Pose | None
    carry: bool = False
    near: float = 0.004
    aside: float | None = None
    turn: float = radians(4.0)
    speed: float = 0.10
    stride: float = 1.0
    touching: bool = False
    closed: bool = False
    pause: float = 0.3


@dataclass(frozen=True)
class Skill:
    """Perception and movement of the operator; assumed, within what is measured of people.

    Attributes:
        reaction: Time from seeing to moving, s.
        blur: Standard deviation of a seen distance close up, m.
        tilt: Standard deviation of a seen angle, rad.
        weber: Further standard deviation, as a fraction of the seen distance or angle.
        spread: Standard deviation of a movement's length, as a fraction of it.
        stray: Standard deviation of its sideways error, as a fraction of its length.
        quickest: Shortest movement, s.
        turning: Peak angular speed, rad/s.
        yields_at: Force beyond which the operator stops and backs off, N.
        resistance: Force near the target that shows that the unit stands in its seat, N.
        stiffness: The operator's estimate of the arm's stiffness, N/m: the stick yields by force over stiffness.
        recoil: Additional distance of backing off along the tool, m.
    """

    reaction: float = 0.25
    blur: float = 0.001
    tilt: float = radians(0.6)
    weber: float = 0.03
    spread: float = 0.06
    stray: float = 0.03
    quickest: float = 0.5
    turning: float = 0.15
    yields_at: float = 30.0
    resistance: float = 15.0
    stiffness: float = 8000.0
    recoil: float = 0.004


def way_to(target: Pose | None, view: View, *, carry: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return offset (3,), m, and rotation (3,), rad, to a target in the tool frame.

    Args:
        target: Target pose of the tool, or of the unit where it is carried; None for the unit, wherever it is.
        view: The view.
        carry: Whether the unit is carried there instead of the tool.
    """
    tool = (view.tool_position, view.tool_rotation)
    unit = (view.unit.position, view.unit.rotation) if view.unit else None
    position, rotation = unit if carry and unit else tool
    # In free space there is no unit: without a target the way is then none.
    goal_position, goal_rotation = target or unit or (position, rotation)
    return view.tool_rotation.T @ (goal_position - position), pin.log3(rotation.T @ goal_rotation)


class ScriptedOperator:
    """Works through a script with six axes of the hand controller in Cartesian rate mode.

    Args:
        script: The steps, in order.
        gains: Velocity per volt of the six axes, m/(s V) and rad/(s V).
        seed: Seed of the operator's errors.
        skill: Perception and movement.
    """

    def __init__(self, script: tuple[Step, ...], gains: np.ndarray, seed: int, skill: Skill | None = None) -> None:
        self._script = script
        self._gains = gains
        self._skill = skill = skill or Skill()
        # A stream of its own: one seed draws the noise of the laboratory too.
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6,)))
        # What the operator acts on is as old as the reaction time.
        self._seen: deque[View] = deque(maxlen=1 + round(skill.reaction / SAMPLE_TIME))
        self._index = 0
        self._movement: Submovement | None = None
        self._look_at = skill.reaction
        self._reached: float | None = None
        self._eased = self._yielding = False
        self._grip = script[0].closed

    def move(self, view: View) -> Motion:
        """Return the stick motion of a tick from what the operator sees; called once per tick."""
        self._seen.append(view)
        seen, time = self._seen[0], view.time
        if self._index >= len(self._script):
            return Motion(np.zeros(6), self._grip)
        step = self._script[self._index]
        if self._movement is not None:
            force = self._force(seen)
            if step.touching and not self._yielding and np.linalg.norm(force) > self._skill.yields_at:
                # Yield to the contact force in every direction, and a little more along the tool.
                away = force / self._skill.stiffness
                away[0] += np.copysign(self._skill.recoil, away[0])
                self._start(away, np.zeros(3), step, time, yielding=True)
            if time >= self._movement.end:
                self._movement = None
                self._look_at = time + self._skill.reaction * self._rng.uniform(1.0, 1.6)
        elif time >= self._look_at:
            self._decide(step, seen, time)
        velocity = self._movement.velocity(time) if self._movement else np.zeros(6)
        # Just within the ±10 V of the converter.
        return Motion(np.clip(velocity / self._gains, -9.9, 9.9), self._grip)

    def _decide(self, step: Step, seen: View, time: float) -> None:
        """Choose what to do next: wait at the target, grip or release there, or move towards it."""
        skill = self._skill
        if self._reached is not None:
            self._wait_at_target(step, seen, time, self._reached)
            return
        offset, turn = self._error(step, seen)
        force = self._force(seen) if step.touching else np.zeros(3)
        aside = step.near if step.aside is None else step.aside
        stands_on_seat = abs(offset[0]) < 2.0 * step.near and np.linalg.norm(force) > skill.resistance
        if stands_on_seat and not self._eased:
            # Take the load off before releasing the unit.
            self._eased = True
            self._start(force / skill.stiffness, np.zeros(3), step, time, yielding=True)
            return
        near_enough = abs(offset[0]) <= step.near and np.abs(offset[1:]).max() <= aside
        at_target = near_enough and np.abs(turn).max() <= step.turn
        if self._eased or at_target:
            self._reached, self._grip, self._eased = time, step.closed, False
            # The operator sees the result of a grip only after the reaction time.
            self._look_at = time + 1.5 * skill.reaction
            return
        turn = np.where(np.abs(turn) > 0.5 * step.turn, turn, 0.0)
        if step.touching:
            # Sideways the stick yields to contact forces and leaves small offsets to the guides.
            seen_aside = np.where(np.abs(offset[1:]) > 0.5 * aside, offset[1:], 0.0)
            pushed = np.abs(force[1:]) > 0.3 * skill.resistance
            offset[1:] = np.where(pushed, force[1:] / skill.stiffness, seen_aside)
        self._start(offset, turn, step, time)

    def _wait_at_target(self, step: Step, seen: View, time: float, reached: float) -> None:
        """Go on to the next step after the pause; look again if the end effector closed beside the unit."""
        if step.closed and seen.unit is not None and not seen.unit.held:
            self._grip, self._reached, self._look_at = False, None, time + 2.0 * self._skill.reaction
        elif time >= reached + step.pause:
            self._index, self._reached = self._index + 1, None

    def _start(self, offset: np.ndarray, turn: np.ndarray, step: Step, time: float, *, yielding: bool = False) -> None:
        """Begin a submovement, as far as a stride reaches, with errors that grow with its length."""
        skill, length = self._skill, float(np.linalg.norm(offset))
        # The way may be none.
        offset = offset * min(1.0, step.stride / max(length, 1e-9))
        length = float(np.linalg.norm(offset))
        angle = float(np.linalg.norm(turn))
        duration = max(skill.quickest, PEAK * length / step.speed, PEAK * angle / skill.turning)
        offset = offset * (1.0 + skill.spread * self._rng.standard_normal())
        offset = offset + skill.stray * length * self._rng.standard_normal(3)
        turn = turn * (1.0 + skill.spread * self._rng.standard_normal())
        turn = turn + skill.stray * angle * self._rng.standard_normal(3)
        self._movement = Submovement(np.concatenate([offset, turn]), time, duration)
        self._yielding = yielding

    def _force(self, seen: View) -> np.ndarray:
        """Return the contact force on the tool, in its frame (3,), N: the wrist force less the known weight."""
        held_mass = UNIT.mass if seen.unit and seen.unit.held else 0.0
        mass = LINKS["end_effector"].mass + held_mass
        return np.asarray(mass * GRAVITY * seen.tool_rotation[2] - seen.wrench[:3])

    def _error(self, step: Step, seen: View) -> tuple[np.ndarray, np.ndarray]:
        """Return offset (3,), m, and rotation (3,), rad, to the target as the operator sees them, in the tool frame."""
        offset, turn = way_to(step.target, seen, carry=step.carry)
        skill = self._skill
        offset = offset + (skill.blur + skill.weber * np.linalg.norm(offset)) * self._rng.standard_normal(3)
        turn = turn + (skill.tilt + skill.weber * np.linalg.norm(turn)) * self._rng.standard_normal(3)
        return offset, turn
