"""Resolved-rate control of the tool: joint commands, tick by tick, toward a target tool pose.

Resolved rates [Whitney1969] with the tool's orientation as the task of first priority:

- **Orientation** is exact at every tick, limited or not: the wrist takes it up in closed form (`ToolKinematics`), and
  the three joints before it position the wrist centre.
- **Position** follows the straight line from the command to the target. The end of each step is known in closed
  form too, so that nothing drifts. Near singular poses, where joints turn fast for a slow tool, the step is damped
  [NakamuraHanafusa1986; Wampler1986], the more so the more singular the pose [Chiaverini1997], and the tool lags.
- **Velocity limits**: the whole step is shortened along its path until every joint keeps its limit. The tool slows down
  and stays on its line.
- **Joint ranges**: a joint at the end of its range stays there, and the others bring the tool as near to where it is
  wanted as they can without turning it. A turn that a range forbids stops.
- **Singular surfaces** are not crossed: the elbow stays bent its way, the wrist centre keeps clear of the yaw axis, and
  the wrist yaw of its quarter turn. The arm stays on its branch and comes back from a limit as it went there.

Limits leave no memory: each tick starts from the last command alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import cos, isfinite, pi, sin

import numpy as np
import pinocchio as pin

from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.control.bounded_qp import bounded_step
from hmtb_twin.control.tool_kinematics import Posture, Rotation, ToolKinematics, Vector, WristAngles
from hmtb_twin.files.errors import TwinError
from hmtb_twin.parameters.variants import INDEXED_JOINTS, JOINTS

SINGULAR = 0.05
"""Damping begins where the joints have to turn by 1 rad for this much motion of the tool, m/rad."""

DAMPING = 0.05
"""Damping at a singular pose, m/rad."""

BEND = 0.05
"""A straighter elbow is damped as if it were bent by this much, rad: a straight one has no gradient to leave by."""

CLEARANCE = 0.05
"""How near the wrist centre comes to the axis of the shoulder yaw, m."""

QUARTER_TURN = pi / 2 - 0.01
"""How far the wrist yaw goes, rad: at a quarter turn, tilt and wrist roll turn the tool about one axis."""

STRIDE = 0.1
"""Without velocity limits a tick takes as many strides as it needs, no joint moving more than this in each, rad."""

STRIDES = 500
"""Largest number of strides in a tick."""

CORRECTIONS = 6
"""Largest number of Newton corrections where joints slide along the ends of their ranges."""

HELD = 1e-7
"""Largest change of orientation that needs no path, rad."""

SLACK = 1e-3
"""Fraction of a velocity limit that a shortened step keeps in reserve for its curvature."""

ATTEMPTS = 12
"""Largest number of shortenings of a step before the command holds."""

HALVINGS = 3
"""Largest number of halvings of a rotation that meets the end of a range before it stops."""

ARRIVED = 1e-9
"""Distance at which a tool has reached its target, m; motion at which joints are at rest, rad."""

ROUNDING = 1e-12
"""Excess over the end of a range that is cut off, rad: the tool turns by no more."""

GUARDS = frozenset({4, 6})
"""Limits that keep the arm off singular surfaces: of the wrist yaw, and of the wrist centre's radius."""


@dataclass(frozen=True, eq=False)
class CartesianStep:
    """Command of one tick.

    Attributes:
        angles: Commanded joint angles (7,), rad.
        velocity_limited: A joint moves as fast as it may, and the tool slower than asked.
        joint_limited: A joint stands at an end of its range and holds the tool back.
        singular: The pose is near singular, and the tool lags or stops for it.
    """

    angles: np.ndarray
    velocity_limited: bool = False
    joint_limited: bool = False
    singular: bool = False


Path = Callable[[float], tuple[Vector, Rotation]]
"""Wrist centre and rotation, behind the shoulder roll, at a share of the way from the command to the wanted pose."""


class ResolvedRate:
    """Follows wanted tool poses, tick by tick, with the joints behind the shoulder roll.

    Args:
        controller: The controller's own model.
        lower: Lower ends of the joint ranges (7,), rad.
        upper: Upper ends (7,), rad.
        step: Largest change of each joint's command in one tick (7,), rad; all infinite without velocity limits.
        locked: Joints that keep their command: the shoulder roll at its index.

    Raises:
        TwinError: A limit has the wrong shape or sign, other joints are locked, or the model has other axes.
    """

    def __init__(
        self,
        controller: ControllerModel,
        *,
        lower: np.ndarray,
        upper: np.ndarray,
        step: np.ndarray,
        locked: Sequence[str] = INDEXED_JOINTS,
    ) -> None:
        for name, limit in (("lower", lower), ("upper", upper), ("step", step)):
            if np.shape(limit) != (len(JOINTS),) or np.isnan(limit).any():
                raise TwinError(
                    f"{name} of shape {np.shape(limit)} given, expected {len(JOINTS)} numbers, one per joint"
                )
        if not (np.asarray(step) > 0.0).all() or not (np.asarray(lower) < upper).all():
            raise TwinError("expected steps above zero and lower ends of the ranges below the upper ones")
        if tuple(locked) != JOINTS[:1]:
            raise TwinError(f"locked joints {', '.join(locked) or 'none'} given, expected {JOINTS[0]} alone")
        self._controller = controller
        self._kinematics = ToolKinematics(controller)
        low, high = np.array(lower, float), np.array(upper, float)
        # The elbow bends one way only, and the wrist yaw stays clear of its quarter turn.
        low[3] = max(low[3], 0.0)
        low[5], high[5] = max(low[5], -QUARTER_TURN), min(high[5], QUARTER_TURN)
        # The shoulder roll keeps its command, wherever that is.
        low[0], high[0] = -np.inf, np.inf
        self._low: list[float] = low.tolist()
        self._high: list[float] = high.tolist()
        self._fastest: list[float] = np.array(step, float).tolist()
        self._unlimited = bool(np.isinf(step).all())
        self._step: list[float] = [STRIDE] * len(low) if self._unlimited else self._fastest

    def follow(self, previous: np.ndarray, position: np.ndarray, rotation: np.ndarray) -> CartesianStep:
        """Return the command of the next tick.

        Args:
            previous: The command of this tick (7,), rad. Where it exceeds a range it may stay, but goes no further.
            position: Wanted position of the tool (3,), m.
            rotation: Wanted rotation of the tool (3, 3).

        Returns:
            The command, with the tool as wanted or, where that is further than one tick, on the straight line and the
            shortest turn toward it; and what was limited.

        Raises:
            TwinError: The wanted pose or the command is not finite.
        """
        # Plain numbers, which the closed form takes.
        angles, target, rows = previous.tolist(), position.tolist(), rotation.tolist()
        if not isfinite(sum(angles) + sum(target) + sum(map(sum, rows))):
            raise TwinError(f"tool pose {target}, {rows} wanted from command {angles}, expected finite numbers")
        # Most ticks meet no limit: the closed form alone gives their command.
        ordinary = self._ordinary(angles, target, rows)
        if ordinary is not None:
            return ordinary
        reached = self._advance(angles, target, rows)
        if self._unlimited:
            for _ in range(STRIDES):
                before, reached = reached, self._advance(reached.angles.tolist(), target, rows)
                if np.abs(reached.angles - before.angles).max() <= ARRIVED:
                    return replace(reached, velocity_limited=False)
        return reached

    def _ordinary(self, previous: list[float], position: list[float], rotation: Rotation) -> CartesianStep | None:
        """Return the command that reaches the target in this tick; None if a limit prevents it."""
        roll, _, shoulder, elbow, pitch, wrist_yaw, wrist_roll = previous
        wrist = WristAngles(shoulder - elbow + pitch, wrist_yaw, wrist_roll)
        arrived = self._kinematics.reaching(*self._kinematics.target(roll, position, rotation), wrist)
        if arrived is None or arrived.radius < CLEARANCE or arrived.rigidity < SINGULAR:
            return None
        angles = [roll, *arrived.angles]
        for angle, before, low, high, step in zip(angles, previous, self._low, self._high, self._fastest, strict=True):
            if not (low <= angle <= high and -step <= angle - before <= step):
                return None
        return CartesianStep(np.array(angles))

    def _advance(
        self, previous: list[float], position: list[float], rotation: Rotation, kept: bool = False
    ) -> CartesianStep:
        """Return the command one step nearer to the wanted pose, whose rotation may be known to be the command's."""
        kinematics = self._kinematics
        roll, yaw, shoulder, elbow, pitch, wrist_yaw, wrist_roll = previous
        wrist = WristAngles(shoulder - elbow + pitch, wrist_yaw, wrist_roll)
        centre, orientation = kinematics.target(roll, position, rotation)
        start = kinematics.posture(yaw, shoulder, elbow, centre, orientation, wrist)
        offset = [new - old for new, old in zip(start.wrist, wrist, strict=True)]
        held = kept or (max(offset) <= HELD and min(offset) >= -HELD)
        path: Path | None = None
        share, shortened, halvings = 1.0, False, 0
        for _ in range(ATTEMPTS):
            arrived, damped, ratio = self._arrive(start, centre, orientation, previous, share < 1.0)
            if arrived is None or ratio > 1.0:
                # A joint is too fast: go a shorter way along the same line, so that the tool only slows down.
                share, shortened = share * (1.0 - SLACK) / ratio, True
            else:
                beyond = self._beyond(arrived, previous)
                if not beyond:
                    singular = damped and max(map(abs, start.error)) > ARRIVED
                    return CartesianStep(self._command(arrived, previous), shortened, halvings > 0, singular)
                if held:
                    return self._slide(start, centre, orientation, previous, beyond)
                # A range is in the way of a turn, which cannot slide along it: turn half as far.
                if halvings == HALVINGS:
                    break
                halvings, share = halvings + 1, 0.5 * share
            if path is None:
                if held:
                    path = _straight_line(start, centre, orientation)
                else:
                    path = self._line_with_turn(previous, position, rotation)
            centre, orientation = path(share)
            start = kinematics.posture(yaw, shoulder, elbow, centre, orientation, wrist)
        if held:
            return CartesianStep(np.array(previous), shortened, False, True)
        # The turn cannot go on: the tool keeps its orientation, and moves on if it can.
        _, kept_rotation = self._controller.tool_pose(np.array(previous))
        return replace(self._advance(previous, position, kept_rotation.tolist(), kept=True), joint_limited=True)

    def _arrive(
        self, start: Posture, centre: Vector, orientation: Rotation, previous: list[float], shorter: bool
    ) -> tuple[Posture | None, bool, float]:
        """Return where one step leads, whether it is damped, and the fastest joint's motion over its limit.

        There is no posture where the estimate to first order is over the limit already. A step that is shorter for such
        an estimate needs another only where it leads to a singular pose.
        """
        if not shorter:
            change, ratio = self._estimate(start, previous)
            if ratio > 1.0:
                return None, False, ratio
        arrived = self._kinematics.reaching(centre, orientation, start.wrist, start.radius)
        if arrived is not None and arrived.rigidity >= SINGULAR:
            return arrived, False, self._ratio(arrived.angles, previous)
        if shorter:
            change, ratio = self._estimate(start, previous)
            if ratio > 1.0:
                return None, True, ratio
        # Out of reach, or near a singular pose: the step of first order, damped, leads on.
        yaw, shoulder, elbow = start.yaw + change[0], start.shoulder + change[1], start.elbow + change[2]
        damped = self._kinematics.posture(yaw, shoulder, elbow, centre, orientation, start.wrist)
        return damped, True, self._ratio(damped.angles, previous)

    def _estimate(self, start: Posture, previous: list[float]) -> tuple[Vector, float]:
        """Return the first-order step, damped near singular poses, and the largest motion of a joint over its limit."""
        rigidity = start.rigidity
        if rigidity >= SINGULAR:
            step = start.resolved()
        else:
            yaw, shoulder, elbow = np.linalg.solve(*_damped(start, rigidity)).tolist()
            step = (yaw, shoulder, elbow)
        return step, self._ratio(start.angles_after(step), previous)

    def _slide(
        self, start: Posture, centre: Vector, orientation: Rotation, previous: list[float], beyond: set[int]
    ) -> CartesianStep:
        """Return the command that brings the tool nearest to its target when joints are at the ends of their ranges.

        The ranges bound the linear step; what its curvature adds is taken back by Newton's method on the joints beyond.
        """
        lower, upper = self._room(start, previous)
        rows = start.rates()
        step, active = bounded_step(*_damped(start, start.rigidity), rows, lower, upper)
        beyond = beyond | set(active)
        singular = bool(beyond & GUARDS) or start.rigidity < SINGULAR
        flags = {"joint_limited": bool(beyond - GUARDS), "singular": singular}
        ratio = self._ratio(start.angles_after(tuple(step)), previous)
        if ratio > 1.0 - SLACK:
            step = step * (1.0 - SLACK) / ratio
        start_angles = np.array((start.yaw, start.shoulder, start.elbow))
        command = np.array((*previous[1:], start.radius))
        for _ in range(ATTEMPTS):
            trial = step
            for _ in range(CORRECTIONS):
                yaw, shoulder, elbow = (start_angles + trial).tolist()
                arrived = self._kinematics.posture(yaw, shoulder, elbow, centre, orientation, start.wrist)
                motion = np.array((*arrived.angles, arrived.radius)) - command
                excess = np.maximum(motion - upper, 0.0) + np.minimum(motion - lower, 0.0)
                over = np.abs(excess) > ROUNDING
                if not over.any():
                    ratio = self._ratio(arrived.angles, previous)
                    if ratio <= 1.0:
                        # A step that was shortened to the limit ends next to it, by its curvature.
                        at_limit = ratio > 1.0 - 2.0 * SLACK
                        return CartesianStep(self._command(arrived, previous), at_limit, **flags)
                    break
                # The smallest correction of the three joints that brings those beyond back to their ends.
                trial = trial - np.linalg.pinv(rows[over]) @ excess[over]
            step = 0.5 * step
        return CartesianStep(np.array(previous), False, **flags)

    def _room(self, start: Posture, previous: list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Return how far the six joints and the wrist centre's radius may go down and up from the command."""
        command = np.array((*previous[1:], start.radius))
        lower, upper = np.array((*self._low[1:], -np.inf)), np.array((*self._high[1:], np.inf))
        # The wrist centre stays on its side of the yaw axis.
        if start.radius >= 0.0:
            lower[6] = CLEARANCE
        else:
            upper[6] = -CLEARANCE
        # A command beyond its range may stay there, so that the zero step is always allowed.
        return np.minimum(lower - command, 0.0), np.maximum(upper - command, 0.0)

    def _beyond(self, arrived: Posture, previous: list[float]) -> set[int]:
        """Return which of the six joints (0-5), and the wrist centre's radius (6), have gone beyond their limits."""
        beyond = set()
        for joint, angle in enumerate(arrived.angles):
            low, high, before = self._low[joint + 1], self._high[joint + 1], previous[joint + 1]
            # Most joints are well within their range: only at its ends does it matter where they come from.
            if low <= angle <= high:
                continue
            if not min(low, before) - ROUNDING <= angle <= max(high, before) + ROUNDING:
                beyond.add(joint)
        if abs(arrived.radius) < CLEARANCE:
            _, _, shoulder, elbow, pitch, _, _ = previous
            before = self._kinematics.radius(shoulder, elbow, shoulder - elbow + pitch)
            # It may stay too near where it already is, but neither come nearer nor cross the axis.
            if abs(arrived.radius) < abs(before) - ROUNDING or arrived.radius * before < 0.0:
                beyond.add(6)
        return beyond

    def _ratio(self, angles: tuple[float, ...], previous: list[float]) -> float:
        """Return the fastest joint's motion over its limit."""
        ratio = 0.0
        for angle, before, step in zip(angles, previous[1:], self._step[1:], strict=True):
            ratio = max(ratio, abs(angle - before) / step)
        return ratio

    def _command(self, arrived: Posture, previous: list[float]) -> np.ndarray:
        """Return the joint angles of a posture, clipped to their ranges, or to the previous command beyond."""
        angles = [previous[0], *arrived.angles]
        for joint, (angle, low, high) in enumerate(zip(angles, self._low, self._high, strict=True)):
            if not low <= angle <= high:
                before = previous[joint]
                angles[joint] = min(max(angle, min(low, before)), max(high, before))
        return np.array(angles)

    def _line_with_turn(self, previous: list[float], position: list[float], rotation: Rotation) -> Path:
        """Return the tool's path to a wanted pose: on a straight line, with the shortest turn of its orientation."""
        start_position, start_rotation = self._controller.tool_pose(np.array(previous))
        way, turn = np.array(position) - start_position, pin.log3(start_rotation.T @ np.array(rotation))

        def path(share: float) -> tuple[Vector, Rotation]:
            turned = start_rotation @ pin.exp3(share * turn)
            return self._kinematics.target(previous[0], (start_position + share * way).tolist(), turned.tolist())

        return path


def _straight_line(start: Posture, centre: Vector, orientation: Rotation) -> Path:
    """Return the path of the wrist centre on a straight line to its target, the tool's orientation held."""
    along, across, up = start.error
    c, s = cos(start.yaw), sin(start.yaw)
    x, y, z = centre
    dx, dy = c * along - s * across, s * along + c * across

    def path(share: float) -> tuple[Vector, Rotation]:
        remaining = 1.0 - share
        return (x - remaining * dx, y - remaining * dy, z - remaining * up), orientation

    return path


def _damped(start: Posture, rigidity: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal equations of the damped step: its Hessian (3, 3) and gradient (3,).

    The step minimises the square of the error that remains and, times `DAMPING**2` at a singular pose, that of the
    motion of all six joints [NakamuraHanafusa1986].
    """
    jacobian = start.jacobian(BEND)
    rates = start.rates()[:6]
    # The square grows from nothing at the border of the singular region [Chiaverini1997].
    damping = DAMPING**2 * max(1.0 - (rigidity / SINGULAR) ** 2, 1e-6)
    return jacobian.T @ jacobian + damping * rates.T @ rates, jacobian.T @ np.array(start.error)
