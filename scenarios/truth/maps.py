"""Maps of the truth: how the dynamics of one arm vary with pose, payload, supply, oil, amplitude and friction."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace

import numpy as np

from hmtb_twin import IDEAL, PAYLOADS, Arm, Plant, Truth, linearize, load_arm
from hmtb_twin.parameters.drives import COLDEST, HOTTEST
from hmtb_twin.parameters.variants import MOTIONS
from scenarios.experiments.multisines import Multisines
from scenarios.files.errors import ScenarioError
from scenarios.truth.best_linear import BestLinearTruth, measured_best_linear, slow_gain
from scenarios.truth.map_table import COLUMNS, MOVING, SHAPES, MapTable, linear_row, stacked, table_row, truth_row
from scenarios.truth.truth_summary import hydraulic
from sysid.models.bandwidth import response_bandwidth

REACH = np.radians(60.0)
"""Largest turn of a joint in the sample near the operating pose, rad."""

INSET = np.radians(1.0)
"""Poses stay this far inside the joints' ranges, rad: the stop of a joint is no part of its servo."""

PLANE = ("shoulder_pitch", "elbow_pitch")
"""The two joints that bend the arm: the axes of the map over the workspace."""

PRESSURES = (5.0, 35.0)
"""Range of supply pressures, MPa: from a third of the nominal one to the 350 bar of industrial hydraulics."""

LEVEL_AMPLITUDE = 1e-2
"""Amplitude at which the level of friction is varied, rad, root mean square."""

CHAIN = replace(IDEAL, friction=True, velocity_limit=True)
"""Chain of signals of the best linear approximations: noise and rounding, which are no part of the arm, are off."""

LARGE_SIGNAL = ("bandwidth", "interval", "gain", "stick_bandwidth", "distortion", "slewing")
"""Quantities of a best linear approximation in the table."""

MOST = 10**4
"""Largest number of points: more are a slip of the keyboard."""

PREVIEW = 0.5
"""Density below which the best linear approximations are a preview."""

Point = tuple[str, float | str, Arm, np.ndarray]
"""One point of a map: the parameter that varies, its value, the arm and its pose (7,), rad."""

Progress = Callable[[int, int], None]
"""Called with the work done and the total."""

Stage = Callable[[str], AbstractContextManager[Progress]]
"""Opens a progress bar with a label."""


@dataclass(frozen=True)
class Density:
    """How finely the maps are sampled; the default takes about a minute and a half of one core.

    Attributes:
        plane: Angles of shoulder pitch and of elbow pitch.
        cut: Angles of each joint in turn.
        sample: Random poses, in the whole joint space and again near the operating pose.
        condition: Supply pressures and oil temperatures.
        amplitudes: Amplitudes of the command, rad, root mean square; none leaves best linear approximations out.
        levels: Levels of dry friction, multiples of the variant's.
        measurement: How each best linear approximation is measured: by default an interval of a few percent, in one
            second of one core.
    """

    plane: tuple[int, int] = (19, 16)
    cut: int = 25
    sample: int = 400
    condition: int = 9
    amplitudes: tuple[float, ...] = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
    levels: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
    measurement: Multisines = field(default_factory=lambda: Multisines(realisations=4))

    def __post_init__(self) -> None:
        counts = {"plane": min(self.plane), "cut": self.cut, "sample": self.sample, "condition": self.condition}
        for name, count in counts.items():
            if not 3 <= count <= MOST:
                raise ScenarioError(f"maps: {name} = {getattr(self, name)} given, expected 3 to {MOST} points")

    @classmethod
    def scaled(cls, factor: float) -> "Density":
        """Return the default density times a factor.

        Below a half, best linear approximations become a preview: every other amplitude and level, two realisations.

        Raises:
            ScenarioError: The factor is not from 0.05 to 20.
        """
        if not 0.05 <= factor <= 20.0:
            raise ScenarioError(f"density of the maps: {factor:g} given, expected 0.05 to 20 times the default grid")
        # Points of the plane grow with the product of its sides.
        full, side = cls(), np.sqrt(factor)
        counts = {name: max(3, round(getattr(full, name) * factor)) for name in ("cut", "sample", "condition")}
        across, up = (max(3, round(count * side)) for count in full.plane)
        scaled = replace(full, plane=(across, up), **counts)
        if factor >= PREVIEW:
            return scaled
        measurement = replace(full.measurement, realisations=2)
        return replace(scaled, amplitudes=full.amplitudes[1::2], levels=full.levels[::2], measurement=measurement)


@dataclass(frozen=True, eq=False)
class Maps:
    """The maps of one arm.

    Attributes:
        arm: The arm.
        truth: Small-signal truth at the operating pose.
        table: Dynamics at all operating points.
    """

    arm: Arm
    truth: Truth
    table: MapTable

    @property
    def here(self) -> MapTable:
        """The row of the operating pose."""
        return self.table.rows("operating pose")

    def change(self, table: MapTable) -> np.ndarray:
        """Return the relative difference of each bandwidth from that at the operating pose (n, m)."""
        return np.asarray(table.bandwidth / self.here.bandwidth[0] - 1.0)


def maps(
    arm: Arm,
    pose: str | np.ndarray,
    density: Density | None = None,
    *,
    seed: int = 0,
    threads: int | None = None,
    stage: Stage = lambda label: nullcontext(lambda done, total: None),
) -> Maps:
    """Compute the maps of one arm: how its dynamics vary with pose, payload, supply, oil, amplitude and friction.

    Args:
        arm: The arm.
        pose: Operating pose, by name or as angles (7,), rad; best linear approximations need a name.
        density: How finely.
        seed: Of the random poses.
        threads: Threads for the physics of best linear approximations; all processors by default.
        stage: Shows the progress of each part; none by default.

    Raises:
        ScenarioError: The pose is at the end of a joint's range, or angles were given where a name is needed; see
            `best_linear`.
        TwinError: There is no such pose.
    """
    density = density or Density()
    if density.amplitudes and not isinstance(pose, str):
        raise ScenarioError("large-signal maps start from a pose of the model; expected its name, given angles")
    # Noise of the drives changes no path from command to angle, but makes every linearisation slower.
    noiseless = _with(arm, replace(arm.plant, process_noise=0.0))
    truth = linearize(noiseless, pose, amplitudes=())
    points = list(_poses(noiseless, truth.angles, density, seed))
    points.extend(conditions(noiseless, truth.angles, density.condition))
    rows = [truth_row("operating pose", np.nan, truth)]
    with stage("linear models") as step:
        for done, point in enumerate(points, 1):
            rows.append(linear_row(*point))
            if done % 20 == 0 or done == len(points):
                step(done, len(points))
    if isinstance(pose, str) and density.amplitudes:
        with stage("amplitude and friction") as step:
            rows.extend(_large_signals(arm, pose, linearize(arm, pose, amplitudes=()), density, threads, step))
    return Maps(arm, truth, stacked(rows))


def _with(arm: Arm, plant: Plant, payload: str | None = None) -> Arm:
    """Load the same arm, deviations of the specimen included, with another plant or payload."""
    return load_arm(arm.variant, payload or arm.payload, plant=plant, specimen=arm.specimen)


def _poses(arm: Arm, angles: np.ndarray, density: Density, seed: int) -> Iterator[Point]:
    """Poses over the workspace, along each joint's range, and at random near the operating pose and anywhere."""
    low = np.array([MOTIONS[name].lower for name in MOVING]) + INSET
    high = np.array([MOTIONS[name].upper for name in MOVING]) - INSET
    middle = angles[COLUMNS]
    if not ((middle >= low) & (middle <= high)).all():
        raise ScenarioError("the operating pose given lies within a degree of the end of a joint's range")
    first, second = (MOVING.index(name) for name in PLANE)
    for first_angle in np.linspace(low[first], high[first], density.plane[0]):
        for second_angle in np.linspace(low[second], high[second], density.plane[1]):
            pose = _turned(angles, COLUMNS[[first, second]], (first_angle, second_angle))
            yield "workspace", np.nan, arm, pose
    for k, name in enumerate(MOVING):
        for angle in np.linspace(low[k], high[k], density.cut):
            yield name, float(np.degrees(angle)), arm, _turned(angles, [COLUMNS[k]], angle)
    # Each sample has a generator of its own, so that a denser one does not change the other.
    rng = np.random.default_rng([seed, 1])
    for width in np.linspace(0.0, REACH, density.sample + 1)[1:]:
        turned = _on_box(middle, width, low, high, rng)
        yield "near", _largest_turn(turned, middle), arm, _turned(angles, COLUMNS, turned)
    for turned in np.random.default_rng([seed, 0]).uniform(low, high, (density.sample, len(MOVING))):
        yield "anywhere", _largest_turn(turned, middle), arm, _turned(angles, COLUMNS, turned)


def _turned(angles: np.ndarray, columns: np.ndarray | list[int], values: object) -> np.ndarray:
    """Copy a pose (7,), rad, with other angles in some columns."""
    pose = angles.copy()
    pose[columns] = values
    return pose


def _on_box(
    middle: np.ndarray, width: float, low: np.ndarray, high: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Draw angles (m,), rad, in range on the surface of a box of half-width `width` about the operating pose.

    One joint turns by all of the half-width, the others by any part, so that distances are spread evenly.
    """
    # Poses out of range are drawn again: moved to the end of the range they would crowd there.
    while True:
        offset = rng.uniform(-width, width, len(MOVING))
        offset[rng.integers(len(MOVING))] = width * rng.choice([-1.0, 1.0])
        turned = middle + offset
        if ((turned >= low) & (turned <= high)).all():
            return np.asarray(turned)


def _largest_turn(turned: np.ndarray, middle: np.ndarray) -> float:
    """Largest turn of a joint from the operating pose, deg."""
    return float(np.degrees(np.abs(turned - middle).max()))


def conditions(arm: Arm, angles: np.ndarray, count: int) -> Iterator[Point]:
    """Yield every payload, lightest first, and supply pressures and oil temperatures where there is oil.

    Servo gains stay. The lowest pressures may be too low to hold the arm.

    Args:
        arm: The arm.
        angles: Operating pose (7,), rad.
        count: Values of each pressure and temperature.
    """

    def mass(name: str) -> float:
        payload = PAYLOADS[name]
        return payload.mass if payload else 0.0

    for name in sorted(PAYLOADS, key=mass):
        yield "payload", name, _with(arm, arm.plant, name), angles
    if hydraulic(arm):
        for pressure in np.linspace(*PRESSURES, count).tolist():
            yield "supply pressure", pressure, _with(arm, replace(arm.plant, supply_pressure=pressure)), angles
        for celsius in np.linspace(COLDEST, HOTTEST, count).tolist():
            yield "oil temperature", celsius, _with(arm, replace(arm.plant, oil_temperature=celsius)), angles


def _large_signals(
    arm: Arm, pose: str, truth: Truth, density: Density, threads: int | None, step: Progress
) -> Iterator[MapTable]:
    """Best linear approximations over amplitude and, where the arm has dry friction, over its level."""
    level = arm.plant.friction_level if arm.friction else 0.0
    points = [("amplitude", amplitude, (amplitude, level)) for amplitude in density.amplitudes]
    if arm.friction:
        points += [("friction", multiple, (LEVEL_AMPLITUDE, multiple)) for multiple in density.levels]
    # The amplitude at which friction varies is one of the amplitudes: it is measured once.
    measurements = len({key for *_, key in points})
    measured: dict[tuple[float, float], dict[str, np.ndarray]] = {}
    for varied, value, (amplitude, multiple) in points:
        if (amplitude, multiple) not in measured:
            # Without dry friction there is nothing to multiply.
            rubbing = _with(arm, replace(arm.plant, friction_level=multiple)) if arm.friction else arm
            multisines = replace(density.measurement, rms=amplitude)
            approximations = measured_best_linear(rubbing, pose, multisines, chain=CHAIN, threads=threads)
            measured[amplitude, multiple] = _large_signal_columns(approximations, truth)
            step(len(measured), measurements)
        yield table_row(varied, value, truth.angles, True, **measured[amplitude, multiple])


def _large_signal_columns(approximations: Mapping[str, BestLinearTruth], truth: Truth) -> dict[str, np.ndarray]:
    """Columns of the table from the best linear approximation of each studied joint; NaN for the other joints."""
    columns = {name: np.full(SHAPES[name], np.nan) for name in LARGE_SIGNAL}
    for joint, approximation in approximations.items():
        hz, *interval = approximation.bandwidth.path()
        stick_hz, *_ = response_bandwidth(approximation.chain.response).path()
        distortion, gain = approximation.distortion_percent[0], slow_gain(approximation, truth)
        quantities = (hz, interval, gain, stick_hz, distortion, approximation.slewing)
        for name, quantity in zip(LARGE_SIGNAL, quantities, strict=True):
            columns[name][MOVING.index(joint)] = quantity
    return columns
