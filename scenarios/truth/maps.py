"""All maps of one arm: over the workspace, over what it carries and runs on, over amplitude and friction."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from hmtb_twin import Arm, Truth, linearize, load_arm
from scenarios.experiments.multisines import Multisines
from scenarios.files.errors import ScenarioError
from scenarios.truth.amplitude_maps import AMPLITUDES, LEVELS, MEASUREMENT, LargeSignals, large_signals
from scenarios.truth.condition_maps import Conditions, conditions
from scenarios.truth.local_dynamics import LocalDynamics, Progress, described
from scenarios.truth.pose_maps import Cut, Plane, Sample, anywhere, cuts, near, plane

REACH = np.radians(60.0)
"""How far from the operating pose the neighbourhood is sampled, rad."""

MOST = 10**4
"""More points than that are a slip of the keyboard."""

PREVIEW = 0.5
"""Density below which the large-signal maps are a preview."""


@dataclass(frozen=True)
class Density:
    """How finely the maps are sampled; the default takes about a minute and a half of one core.

    Attributes:
        plane: Angles of shoulder pitch and of elbow pitch.
        cut: Angles of each joint in turn.
        sample: Random poses, in the whole joint space and again near the operating pose.
        condition: Supply pressures and oil temperatures.
        amplitudes: Amplitudes of the command, rad, root mean square; none leaves the large-signal maps out.
        levels: Levels of dry friction.
        measurement: How each best linear approximation is measured.
    """

    plane: tuple[int, int] = (19, 16)
    cut: int = 25
    sample: int = 400
    condition: int = 9
    amplitudes: tuple[float, ...] = AMPLITUDES
    levels: tuple[float, ...] = LEVELS
    measurement: Multisines = MEASUREMENT

    def __post_init__(self) -> None:
        counts = {"plane": min(self.plane), "cut": self.cut, "sample": self.sample, "condition": self.condition}
        for name, count in counts.items():
            if not 3 <= count <= MOST:
                raise ScenarioError(f"maps: {name} = {getattr(self, name)} given, expected 3 to {MOST} points")

    @classmethod
    def scaled(cls, factor: float) -> "Density":
        """Return the default grid with so many times as many poses.

        Below a half the large-signal maps become a preview: every other amplitude and level, two realisations of each.

        Raises:
            ScenarioError: The factor is not from 0.05 to 20.
        """
        if not 0.05 <= factor <= 20.0:
            raise ScenarioError(f"density of the maps: {factor:g} given, expected 0.05 to 20 times the default grid")
        side = np.sqrt(factor)

        def many(count: int, by: float) -> int:
            return max(3, round(count * by))

        default = cls()
        preview = factor < PREVIEW
        return cls(
            plane=(many(default.plane[0], side), many(default.plane[1], side)),
            cut=many(default.cut, factor),
            sample=many(default.sample, factor),
            condition=many(default.condition, factor),
            amplitudes=default.amplitudes[1::2] if preview else default.amplitudes,
            levels=default.levels[::2] if preview else default.levels,
            measurement=replace(default.measurement, realisations=2) if preview else default.measurement,
        )


@dataclass(frozen=True, eq=False)
class Maps:
    """The maps of one arm.

    Attributes:
        arm: The arm.
        truth: Small-signal truth at the operating pose.
        here: The same in few numbers.
        plane: Over shoulder pitch and elbow pitch.
        cuts: Over each joint in turn.
        anywhere: At random poses of the whole joint space.
        near: At random poses about the operating pose.
        conditions: Over payload, supply pressure, oil temperature.
        large: Over amplitude and friction; None where they were not asked for.
    """

    arm: Arm
    truth: Truth
    here: LocalDynamics
    plane: Plane
    cuts: tuple[Cut, ...]
    anywhere: Sample
    near: Sample
    conditions: tuple[Conditions, ...]
    large: LargeSignals | None


Stage = Callable[[str], AbstractContextManager[Progress]]
"""Opens a bar with a label, and yields what to call with the work done and the work in all."""


@contextmanager
def silent(label: str) -> Iterator[Progress]:
    """Show no progress."""
    yield lambda done, total: None


def maps(
    arm: Arm,
    pose: str | np.ndarray,
    density: Density | None = None,
    *,
    seed: int = 0,
    threads: int | None = None,
    stage: Stage = silent,
) -> Maps:
    """Make all maps of one arm.

    Args:
        arm: The arm.
        pose: Operating pose, by name or as angles (7,), rad; large-signal maps need a name.
        density: How finely.
        seed: Of the random poses.
        threads: Threads for the physics of the large-signal maps; all processors by default.
        stage: Shows the progress of each part.

    Returns:
        The maps.

    Raises:
        ScenarioError: The pose is at the end of a joint's range, or angles were given where a name is needed.
        TwinError: There is no such pose.
    """
    density = density or Density()
    if density.amplitudes and not isinstance(pose, str):
        raise ScenarioError("large-signal maps start from a pose of the model; expected its name, given angles")
    # Noise of the drives changes no path from command to angle, but makes every linearisation slower.
    quiet = load_arm(arm.variant, arm.payload, plant=replace(arm.plant, process_noise=0.0), specimen=arm.specimen)
    truth = linearize(quiet, pose, amplitudes=())
    angles = truth.angles
    with stage("near the pose") as step:
        nearby = near(quiet, angles, density.sample, seed, REACH, step)
    with stage("workspace") as step:
        surface = plane(quiet, angles, density.plane, step)
    with stage("joint by joint") as step:
        lines = cuts(quiet, angles, density.cut, step)
    with stage("anywhere") as step:
        everywhere = anywhere(quiet, angles, density.sample, seed, step)
    with stage("conditions") as step:
        varied = conditions(quiet, angles, density.condition, step)
    large = None
    if density.amplitudes and isinstance(pose, str):
        with stage("amplitude and friction") as step:
            large = large_signals(
                arm,
                pose,
                amplitudes=density.amplitudes,
                levels=density.levels,
                measurement=density.measurement,
                threads=threads,
                progress=step,
            )
    return Maps(arm, truth, described(truth), surface, lines, everywhere, nearby, varied, large)
