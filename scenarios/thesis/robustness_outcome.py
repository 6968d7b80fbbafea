"""Outcomes of the experiment on disturbed records, one by one and by degree."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal

import numpy as np

from scenarios.thesis.disturbances import AS_IT_IS
from scenarios.thesis.orders_needed import OrderNeeded

Failure = Literal["", "refused", "unstable", "no bandwidth"]
"""Failures: the estimator refused, the model is unstable, its gain never falls by 3 dB."""


@dataclass(frozen=True)
class RobustnessOutcome:
    """One model from one spoilt record.

    Attributes:
        joint: The joint.
        method: Of the structure, as in `STRUCTURES`.
        chosen: Whether the thesis took the structure.
        disturbance: Key in `DISTURBANCES`.
        treatment: Key in `TREATMENTS`.
        degree: How much, in the disturbance's unit.
        draw: Number of the draw.
        failure: What went wrong, or nothing.
        bandwidth_hz: Bandwidth, Hz; NaN after a failure.
        error: What it departs from the truth by, percent; NaN after a failure.
        covers: Whether its 95 % interval holds the truth.
        fit: In simulation to the records that judge, percent, their median, also of a model that is unstable; NaN where
            the estimator refused.
        half_power_hz: Where the gain is 0.707, whatever it is at 0 Hz, Hz; NaN where it never is, and after a refusal.
        slowest: Largest modulus of its poles; NaN where the estimator refused.
    """

    joint: str
    method: str
    chosen: bool
    disturbance: str
    treatment: str
    degree: float
    draw: int
    failure: Failure
    bandwidth_hz: float
    error: float
    covers: bool
    fit: float
    half_power_hz: float
    slowest: float


@dataclass(frozen=True)
class Summary:
    """All draws of one point.

    Attributes:
        degree: How much.
        draws: How many.
        failures: How many failed, by what went wrong.
        error: Median, smallest and largest error of the bandwidths that there are, percent; NaN if there is none.
        fit: The same of the fits in simulation, percent.
        covered: Share of the draws whose interval holds the truth; a failure holds nothing.
    """

    degree: float
    draws: int
    failures: Mapping[str, int]
    error: tuple[float, float, float]
    fit: tuple[float, float, float]
    covered: float


@dataclass(frozen=True, eq=False)
class Robustness:
    """The whole experiment.

    Attributes:
        outcomes: Every model.
        orders: How many states suffice, with and without detrending.
        judged_by: Numbers of the tests that judge, by joint.
    """

    outcomes: tuple[RobustnessOutcome, ...]
    orders: tuple[OrderNeeded, ...]
    judged_by: Mapping[str, tuple[int, ...]]

    def of(
        self, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
    ) -> dict[float, tuple[RobustnessOutcome, ...]]:
        """Draws by degree, of one disturbance, joint, method and treatment."""
        found: dict[float, tuple[RobustnessOutcome, ...]] = {}
        for entry in self.outcomes:
            if (entry.disturbance, entry.joint, entry.method, entry.treatment) == (
                disturbance,
                joint,
                method,
                treatment,
            ):
                found[entry.degree] = (*found.get(entry.degree, ()), entry)
        return found

    def curve(self, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]) -> tuple[Summary, ...]:
        """Medians and spreads by degree; see `of`."""
        draws = self.of(disturbance, joint, method, treatment)
        return tuple(_summary(degree, entries) for degree, entries in draws.items())

    def methods(self, disturbance: str, joint: str) -> tuple[str, ...]:
        """Methods that were tried."""
        return tuple(
            dict.fromkeys(
                entry.method for entry in self.outcomes if (entry.disturbance, entry.joint) == (disturbance, joint)
            )
        )


def _summary(degree: float, entries: Sequence[RobustnessOutcome]) -> Summary:
    failures: dict[str, int] = {}
    for entry in entries:
        if entry.failure:
            failures[entry.failure] = failures.get(entry.failure, 0) + 1
    return Summary(
        degree,
        len(entries),
        failures,
        _spread(entry.error for entry in entries),
        _spread(entry.fit for entry in entries),
        sum(entry.covers for entry in entries) / len(entries),
    )


def _spread(values: Iterable[float]) -> tuple[float, float, float]:
    known = [value for value in values if not np.isnan(value)]
    return (median(known), min(known), max(known)) if known else (float("nan"),) * 3
