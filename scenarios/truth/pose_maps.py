"""Small-signal dynamics over the workspace: how local is a model identified at one pose?"""

from dataclasses import dataclass

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, Arm
from hmtb_twin.parameters.values import MOTIONS
from scenarios.files.errors import ScenarioError
from scenarios.truth.local_dynamics import COLUMNS, MOVING, LocalDynamics, Progress, local_dynamics

INSET = np.radians(1.0)
"""Poses keep this far inside the joints' ranges, rad: the stop of a joint is no part of its servo."""

TOLERANCE = 0.1
"""A bandwidth counts as the same as long as it stays within this part of that at the operating pose."""

STUDIED = [MOVING.index(name) for name in STUDIED_JOINTS]
"""Columns of the studied joints among the moving ones."""

PLANE = ("shoulder_pitch", "elbow_pitch")
"""The two joints that bend the arm: the axes of the map over the workspace."""


@dataclass(frozen=True, eq=False)
class Plane:
    """Two joints over their ranges, the others at the operating pose.

    Attributes:
        joints: The two joints.
        axes: Angles of each, rad: (a,) and (b,).
        dynamics: At all a b poses, the second joint varying fastest.
    """

    joints: tuple[str, str]
    axes: tuple[np.ndarray, np.ndarray]
    dynamics: LocalDynamics

    def grid(self, values: np.ndarray) -> np.ndarray:
        """Return values (a b, ...) of the poses as (a, b, ...)."""
        return np.asarray(values).reshape(*(len(axis) for axis in self.axes), *np.shape(values)[1:])


@dataclass(frozen=True, eq=False)
class Cut:
    """One joint over its range, the others at the operating pose.

    Attributes:
        joint: The joint.
        angles: Its angles (n,), rad.
        dynamics: At these.
    """

    joint: str
    angles: np.ndarray
    dynamics: LocalDynamics


@dataclass(frozen=True, eq=False)
class Sample:
    """Poses drawn at random.

    Attributes:
        dynamics: At these poses.
        distance: Largest turn of any joint from the operating pose (n,), rad.
    """

    dynamics: LocalDynamics
    distance: np.ndarray


def plane(arm: Arm, angles: np.ndarray, counts: tuple[int, int], progress: Progress | None = None) -> Plane:
    """Linearise over the two joints that bend the arm.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad.
        counts: Angles of each joint.
        progress: Called now and then.
    """
    first, second = (_range(name, count) for name, count in zip(PLANE, counts, strict=True))
    i, j = (JOINTS.index(name) for name in PLANE)
    poses = np.tile(angles, (len(first) * len(second), 1))
    poses[:, i] = np.repeat(first, len(second))
    poses[:, j] = np.tile(second, len(first))
    return Plane((PLANE[0], PLANE[1]), (first, second), local_dynamics(arm, poses, progress))


def cuts(arm: Arm, angles: np.ndarray, count: int, progress: Progress | None = None) -> tuple[Cut, ...]:
    """Linearise along each joint's range through the operating pose.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad.
        count: Angles of each joint.
        progress: Called now and then.
    """
    turns = [_range(name, count) for name in MOVING]
    poses = np.tile(angles, (len(MOVING) * count, 1))
    for number, column in enumerate(COLUMNS):
        poses[number * count : (number + 1) * count, column] = turns[number]
    whole = local_dynamics(arm, poses, progress)
    parts = [slice(number * count, (number + 1) * count) for number in range(len(MOVING))]
    return tuple(Cut(n, t, _part(whole, part)) for n, t, part in zip(MOVING, turns, parts, strict=True))


def anywhere(arm: Arm, angles: np.ndarray, count: int, seed: int, progress: Progress | None = None) -> Sample:
    """Linearise at poses drawn evenly from the whole joint space.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad, from which the distance is measured; indexed joints stay at it.
        count: How many.
        seed: Of the draw.
        progress: Called now and then.
    """
    low, high = _limits()
    turns = np.random.default_rng([seed, 0]).uniform(low, high, (count, len(MOVING)))
    return _sample(arm, angles, turns, progress)


def near(arm: Arm, angles: np.ndarray, count: int, seed: int, reach: float, progress: Progress | None = None) -> Sample:
    """Linearise at poses about the operating pose, spread evenly over the distance from it.

    Each is drawn on the surface of the box of its half-width about the operating pose: one joint turned by all of it,
    the others by any part. Poses out of a joint's range are drawn again.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad.
        count: How many.
        seed: Of the draw.
        reach: Largest half-width, rad.
        progress: Called now and then.

    Raises:
        ScenarioError: The operating pose is out of range, so that no pose near it is in range.
    """
    low, high = _limits()
    middle = angles[COLUMNS]
    if not ((middle >= low) & (middle <= high)).all():
        raise ScenarioError("the operating pose given lies within a degree of the end of a joint's range")
    rng = np.random.default_rng([seed, 1])
    turns = np.empty((count, len(MOVING)))
    for number, width in enumerate(np.linspace(0.0, reach, count + 1)[1:]):
        while True:
            offset = rng.uniform(-width, width, len(MOVING))
            offset[rng.integers(len(MOVING))] = width * rng.choice([-1.0, 1.0])
            turns[number] = middle + offset
            if ((turns[number] >= low) & (turns[number] <= high)).all():
                break
    return _sample(arm, angles, turns, progress)


def change(dynamics: LocalDynamics, reference: LocalDynamics) -> np.ndarray:
    """Return by which part each bandwidth differs from that at the operating pose (n, m)."""
    return np.asarray(dynamics.bandwidth / reference.bandwidth[0] - 1.0)


def reach(cut: Cut, reference: LocalDynamics, start: float, tolerance: float = TOLERANCE) -> tuple[float, float]:
    """Return how far a joint may turn either way before any studied bandwidth leaves its tolerance.

    Args:
        cut: The joint's cut.
        reference: At the operating pose.
        start: The joint's angle there, rad.
        tolerance: Part by which a bandwidth may differ.

    Returns:
        Largest turns down and up, rad, by linear interpolation between the cut's poses, or up to the last pose before
        one that has no bandwidth; infinite where no bandwidth of the joint's whole range leaves it.
    """
    worst = np.abs(change(cut.dynamics, reference)[:, STUDIED]).max(axis=1)
    down, up = cut.angles < start, cut.angles > start
    return (
        _first_beyond(start - cut.angles[down][::-1], worst[down][::-1], tolerance),
        _first_beyond(cut.angles[up] - start, worst[up], tolerance),
    )


def _first_beyond(turns: np.ndarray, values: np.ndarray, tolerance: float) -> float:
    # At the operating pose itself nothing has changed.
    turns, values = np.concatenate([[0.0], turns]), np.concatenate([[0.0], values])
    beyond = np.flatnonzero(~(values <= tolerance))
    if not len(beyond):
        return float("inf")
    k = beyond[0]
    if not np.isfinite(values[k]):
        return float(turns[k - 1])
    part = (tolerance - values[k - 1]) / (values[k] - values[k - 1])
    return float(turns[k - 1] + part * (turns[k] - turns[k - 1]))


def _sample(arm: Arm, angles: np.ndarray, turns: np.ndarray, progress: Progress | None) -> Sample:
    poses = np.tile(angles, (len(turns), 1))
    poses[:, COLUMNS] = turns
    return Sample(local_dynamics(arm, poses, progress), np.abs(turns - angles[COLUMNS]).max(axis=1))


def _limits() -> tuple[np.ndarray, np.ndarray]:
    low, high = np.array([(MOTIONS[name].lower, MOTIONS[name].upper) for name in MOVING]).T
    return low + INSET, high - INSET


def _range(joint: str, count: int) -> np.ndarray:
    motion = MOTIONS[joint]
    return np.linspace(motion.lower + INSET, motion.upper - INSET, count)


def _part(dynamics: LocalDynamics, rows: slice) -> LocalDynamics:
    return LocalDynamics(**{name: value[rows] for name, value in vars(dynamics).items()})
