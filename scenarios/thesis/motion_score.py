"""Score of the settings of a motion campaign against everything that the thesis prints, decided on 2026-11-23.

docs/motion.md lists the items with their distances and tolerances, fixed before any result of the campaign had been
seen. A distance counts at most `FARTHEST` tolerances, which a number that does not exist gets too. The score of a cell
is the mean over its items: 0 is the thesis to the letter, up to `EXPLAINS` the cell explains the joint.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from math import log

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.thesis.motion import Row, Setting, model_numbers
from scenarios.truth.published import BREAK_FREQUENCY, PERCENT_DESCRIBED, published

FARTHEST = 3.0
"""Largest distance of an item, tolerances."""

EXPLAINS = 1.0
"""Largest score of a joint that counts as explained: on average its items lie within their tolerances."""

TOLERANCES = {
    "slow_pole": ("slowest pole", log(1.25)),
    "second_pole": ("second pole", log(1.5)),
    "dc_gain": ("gain at 0 Hz", log(1.1)),
    "gain_half_hz": ("gain at 0.5 Hz", log(1.15)),
    "half_power": ("gain 0.707 at", log(1.15)),
}
"""Items of every printed model: name, and tolerance of the logarithm of the ratio.

The second pole is hardly fixed by a record of 2 s; the gain at 0 Hz moves by a tenth with the digits of (4.7) and
(4.9); the others follow the rounding of the print and the scatter of records of this length.
"""

DELAYS = (2.0, 5.0)
"""Samples from input to output [Morris1996, sec. III.3]."""

ORDERS_BELOW = {"shoulder_yaw": 2.0, "shoulder_pitch": 1.0, "elbow_pitch": 1.0}
"""Orders of magnitude of the disturbance below the output [Morris1996, sec. III.2C and III.3]."""


Distance = Callable[[Mapping[str, float]], float]
"""From the numbers of a record to the distance of an item, in tolerances; NaN where a number is missing."""


def _ratio(key: str, printed: float, tolerance: float) -> Distance:
    """Distance of a number from the printed one: the logarithm of their ratio, in tolerances."""

    def distance(row: Mapping[str, float]) -> float:
        # Not `<=`: a number that is missing is NaN.
        if not row[key] > 0.0:
            return float("nan")
        return abs(log(row[key] / printed)) / tolerance

    return distance


def _claim(holds: Callable[[Mapping[str, float]], bool]) -> Distance:
    """Distance of a claim in words, which has no tolerance: none where it holds, the largest otherwise."""

    def distance(row: Mapping[str, float]) -> float:
        return 0.0 if holds(row) else FARTHEST

    return distance


_RESIDUALS: Mapping[str, Mapping[str, Callable[[Mapping[str, float]], bool]]] = {
    "shoulder_yaw": {
        "residuals of ARMAX white": lambda row: row["armax_white"] == 1.0,
        "residuals of ARMAX independent of the input": lambda row: row["armax_independent"] == 1.0,
        "residuals of OE not white": lambda row: row["oe_white"] == 0.0,
    },
    "shoulder_pitch": {"residuals of OE independent of the input": lambda row: row["oe_independent"] == 1.0},
    "elbow_pitch": {
        "residuals of ARMAX whiter than of OE": lambda row: row["armax_correlation"] < row["oe_correlation"]
    },
}
"""Claims on residuals by joint [Morris1996, sec. IV.3A, IV.4]; whiteness and independence at 99 %."""


@cache
def items(joint: str) -> Mapping[str, Distance]:
    """Return everything that the thesis prints of a joint, numbers and claims, by name."""
    low, high = DELAYS
    orders = ORDERS_BELOW[joint]
    distances: dict[str, Distance] = {}
    for model in published(joint):
        printed = model_numbers(model.model)
        for key, (name, tolerance) in TOLERANCES.items():
            distances[f"{model.label}, {name}"] = _ratio(f"{model.method}_{key}", printed[key], tolerance)
    # The tail is what the printed share of two states leaves.
    distances["tail of OKID"] = _ratio("okid_tail_percent", 100.0 - PERCENT_DESCRIBED[joint], log(2.0))
    distances["break of the spectrum"] = _ratio("break_rad_s", BREAK_FREQUENCY[joint], log(1.1))
    # A tolerance is one sample outside the printed range, and half an order of magnitude; see docs/motion.md.
    distances["delay"] = lambda row: max(low - row["peak_lag"], row["peak_lag"] - high, 0.0)
    distances["disturbance"] = lambda row: abs(row["disturbance_orders"] - orders) / 0.5
    for name, holds in _RESIDUALS[joint].items():
        distances[name] = _claim(holds)
    return distances


@dataclass(frozen=True)
class Cell:
    """Score of one joint in one setting, by one excitation and amplitude, with one noise in the log and one drift.

    Attributes:
        score: Mean over items and seeds.
        spread: Standard deviation of the score over seeds.
        within: Items whose median distance over seeds is at most one tolerance.
        distances: Median distance of every item over seeds, tolerances.
        medians: Median of every number over seeds; NaN where most are missing.
    """

    setting: Setting
    excitation: str
    volts: float
    logged: float
    drift: float
    score: float
    spread: float
    seeds: int
    within: int
    distances: tuple[float, ...]
    medians: Mapping[str, float]

    def record(self) -> dict[str, object]:
        """Return the cell as one row of a table."""
        names = ("excitation", "volts", "logged", "drift", "score", "spread", "seeds", "within")
        fields = {name: getattr(self, name) for name in names}
        return {**asdict(self.setting), **fields, "items": len(self.distances), **self.medians}


def cells(results: Mapping[Setting, Sequence[Row]]) -> tuple[Cell, ...]:
    """Score every cell of a campaign from the rows of its settings; see `run_campaign`."""
    return tuple(itertools.chain.from_iterable(_cells(setting, rows) for setting, rows in results.items()))


def _cells(setting: Setting, rows: Sequence[Row]) -> Iterator[Cell]:
    """Group the rows of a setting by excitation, amplitude and logged noise, and score each group."""
    groups: dict[tuple[str, float, float, float], list[dict[str, float]]] = {}
    spectra: dict[tuple[float, float], list[dict[str, float]]] = {}
    for row in rows:
        # `motion_record` lists failed experiments with their reasons.
        if "failed" in row:
            continue
        numbers = _numbers_of(row)
        if row["excitation"] == "sines":
            spectra.setdefault((row["logged"], row["drift"]), []).append(numbers)
        else:
            key = (row["excitation"], row["volts"], row["logged"], row["drift"])
            groups.setdefault(key, []).append(numbers)
    for (excitation, volts, logged, drift), records in groups.items():
        # The spectra of chapter III are of another test: its records go round.
        spectra_in_turn = itertools.cycle(spectra.get((logged, drift)) or [{}])
        joined = []
        for numbers, spectrum in zip(records, spectra_in_turn, strict=False):
            of_spectrum = {key: spectrum[key] for key in ("break_rad_s", "disturbance_orders") if key in spectrum}
            joined.append(_Numbers(of_spectrum | numbers))
        yield _cell(setting, excitation, volts, (logged, drift), joined)


def _numbers_of(row: Row) -> dict[str, float]:
    """The numbers of a row; NaN where the record has none."""
    numbers = {}
    for name, value in row.items():
        if name != "excitation":
            numbers[name] = float("nan") if value is None else float(value)
    return numbers


def _cell(
    setting: Setting,
    excitation: str,
    volts: float,
    disturbance: tuple[float, float],
    records: Sequence["_Numbers"],
) -> Cell:
    """Score the records of one cell, one for each seed."""
    distance_functions = items(setting.joint).values()
    distances = []
    for record in records:
        distances.append([distance(record) for distance in distance_functions])
    # The smaller of the two, and the limit where a distance is NaN: `minimum` would keep the NaN.
    limited = np.fmin(distances, FARTHEST)
    medians: dict[str, float] = {}
    for record in records:
        for name in record:
            if name not in ("volts", "seed", "logged", "drift") and name not in medians:
                medians[name] = float(np.median([numbers[name] for numbers in records]))
    median_distances = tuple(float(distance) for distance in np.median(limited, axis=0))
    # A single seed has no spread.
    spread = float(limited.mean(axis=1).std(ddof=1)) if len(limited) > 1 else float("nan")
    return Cell(
        setting,
        excitation,
        volts,
        *disturbance,
        score=float(limited.mean()),
        spread=spread,
        seeds=len(limited),
        within=sum(distance <= 1.0 for distance in median_distances),
        distances=median_distances,
        medians=medians,
    )


class _Numbers(dict[str, float]):
    """Numbers of a record; NaN where one is missing."""

    def __missing__(self, key: str) -> float:
        return float("nan")


@dataclass(frozen=True)
class ArmScore:
    """Three joints, a cell each, under one servo and one chain, each with the friction and drift that suit it best."""

    cells: tuple[Cell, ...]

    @property
    def score(self) -> float:
        """Mean over the joints."""
        return float(np.mean([cell.score for cell in self.cells]))

    @property
    def error(self) -> float:
        """Standard error of the score over seeds."""
        variances = [cell.spread**2 / cell.seeds for cell in self.cells]
        return float(np.sqrt(np.sum(variances)) / len(variances))

    @property
    def explains(self) -> tuple[str, ...]:
        """The joints that it explains."""
        return tuple(cell.setting.joint for cell in self.cells if cell.score <= EXPLAINS)


COMMON = ("servo", "slope", "gain", "presliding", "hold", "noise", "volts", "logged")
"""Factors that all joints of one arm share."""

OWN = ("friction", "drift")
"""Factors that differ from joint to joint of one arm."""


def factors(cell: Cell) -> dict[str, object]:
    """Return the levels of all factors of a cell by name, those that each joint has for itself last."""
    levels = {**asdict(cell.setting), "volts": cell.volts, "logged": cell.logged, "drift": cell.drift}
    return {name: levels[name] for name in (*COMMON, *OWN)}


def arms(scored: Iterable[Cell]) -> tuple[ArmScore, ...]:
    """Return every arm that was tried by binary tests of all joints under one servo and one chain, the best first."""
    groups: dict[tuple[object, ...], dict[str, Cell]] = {}
    for cell in scored:
        # The thesis' models come from binary tests.
        if cell.excitation != "prbs":
            continue
        levels = factors(cell)
        best = groups.setdefault(tuple(levels[name] for name in COMMON), {})
        joint = cell.setting.joint
        if joint not in best or cell.score < best[joint].score:
            best[joint] = cell
    complete = []
    for best in groups.values():
        if len(best) == len(STUDIED_JOINTS):
            complete.append(ArmScore(tuple(best[joint] for joint in STUDIED_JOINTS)))
    return tuple(sorted(complete, key=lambda arm: arm.score))


def profile(every: Sequence[ArmScore]) -> dict[str, dict[str, float]]:
    """Return by factor and level the score of the best arm of that level: what it costs to fix the level."""
    table: dict[str, dict[str, float]] = {}
    # The best arm comes first: in reverse it is the last to write the levels that it has.
    for arm in reversed(every):
        levels = factors(arm.cells[0])
        for name in COMMON:
            table.setdefault(name, {})[str(levels[name])] = arm.score
    return {name: dict(sorted(by_level.items())) for name, by_level in table.items()}
