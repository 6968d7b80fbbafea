"""Results of the robustness study: orders needed, errors of each method and tolerated noise."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from types import MappingProxyType
from typing import Literal

import numpy as np

import sysid
from scenarios.experiments.log_review import settled
from scenarios.experiments.model_structures import STRUCTURES
from scenarios.thesis.campaign import Campaign
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, biased, frequent_outliers
from scenarios.thesis.finding import CLAIMS
from sysid import Estimate, IOData, SysidError, SysidWarning, predict
from sysid.validation import fit_percent

ORDERS: Mapping[str, tuple[int, ...]] = MappingProxyType({"SysID": (1, 2, 3), "OKID": (1, 2, 3, 4)})
"""Numbers of states compared, by kind of model, up to the largest in the thesis."""

PART = 1000
"""Samples of the part that is used, 20 s from the start: larger orders than needed take long to fit."""

MARGIN = 1.0
"""An order suffices whose fit is at most so far below the best order's on the same record, percent points."""

BIAS, SHARE = CLAIMS["F25"].limits["bias"], CLAIMS["F25"].limits["outliers"]
"""Constant in the output of the biased record, standard deviations of the output; outliers in percent of samples."""

DETRENDED = "detrended"
"""Name of the detrended record, as the study uses it."""

WITH_MEANS = "with its means"
"""The same with the joint's angle about which it moves, in the command as in the measurement."""

CONSTANT = "with a constant in the output"
"""The detrended record with a constant added to the output alone."""

OUTLIERS = "with outliers"
"""The detrended record with outliers in the output."""

METHODS: Mapping[str, Callable[[IOData, int, int], Estimate]] = MappingProxyType(
    {
        "SysID": lambda data, n, nk: sysid.oe(data, n, n, nk),
        "OKID": lambda data, n, _: sysid.okid(data, n, p=5),
    }
)
"""Output error with as many zeros' coefficients as poles, the one structure that has a single order; and OKID."""


@dataclass(frozen=True)
class OrderNeeded:
    """Number of sufficient states on one record.

    Attributes:
        joint: The joint.
        method: `SysID` or `OKID`.
        record: What the record is like.
        fits: In simulation to records of other waveforms, percent, median, by order; minus infinity where there is no
            stable model.
        needed: The smallest order that suffices.
    """

    joint: str
    method: str
    record: str
    fits: Mapping[int, float]
    needed: int

    def sufficient(self, best: float, points: float) -> int:
        """Return the smallest order whose fit is within some points of another, or one more than the largest tried."""
        return min((n for n, fit in self.fits.items() if fit >= best - points), default=max(self.fits) + 1)


def orders_needed(joint: str, campaign: Campaign, data: IOData, judges: Sequence[IOData]) -> tuple[OrderNeeded, ...]:
    """Find the order that suffices on the detrended record and on two that are not.

    Args:
        joint: The joint.
        campaign: Holds the log that the record comes from, with its means.
        data: The record that models are identified from, without its means.
        judges: Records of other waveforms, not disturbed.

    Returns:
        One entry for each method and record.
    """
    nk = next(entry.orders[-1] for entry in STRUCTURES[joint] if entry.method == "oe")
    part = data[:PART].detrend()
    records = {
        DETRENDED: part,
        WITH_MEANS: settled(campaign.log(data.name), joint)[:PART],
        CONSTANT: biased(part, BIAS, np.random.default_rng(0)),
        OUTLIERS: frequent_outliers(part, SHARE, np.random.default_rng(0)),
    }
    orders = []
    for method in METHODS:
        for name, record in records.items():
            fits = {n: _fit(method, record, n, nk, judges) for n in ORDERS[method]}
            orders.append(OrderNeeded(joint, method, name, fits, needed(fits)))
    return tuple(orders)


def needed(fits: Mapping[int, float]) -> int:
    """The smallest order whose fit is within `MARGIN` of the best."""
    best = max(fits.values())
    return min(n for n, fit in fits.items() if fit >= best - MARGIN)


def _fit(method: str, record: IOData, n: int, nk: int, judges: Sequence[IOData]) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        try:
            model = METHODS[method](record, n, nk)
        except SysidError:
            return float("-inf")
        return simulated_fit(model, judges) if model.model.is_stable() else float("-inf")


def simulated_fit(model: Estimate, judges: Sequence[IOData]) -> float:
    """Median fit in simulation of one output, percent; minus infinity where the model grows beyond all numbers."""
    return median(_simulated(model, judge) for judge in judges)


def _simulated(model: Estimate, judge: IOData) -> float:
    with np.errstate(all="ignore"):
        simulated = np.nan_to_num(predict(model, judge, steps=None), nan=np.inf, posinf=np.inf, neginf=-np.inf)
    return float(fit_percent(judge.y, simulated)[0])


Failure = Literal["", "refused", "unstable", "no bandwidth"]
"""Failures: the estimator raised an error, the model is unstable, its gain never falls by 3 dB."""


@dataclass(frozen=True)
class RobustnessOutcome:
    """One model from one disturbed record.

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
    """Summary of all draws at one degree.

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
    """Results of the whole robustness experiment.

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
        draws: dict[float, tuple[RobustnessOutcome, ...]] = {}
        for entry in self.outcomes:
            if (entry.disturbance, entry.joint, entry.method, entry.treatment) == (
                disturbance,
                joint,
                method,
                treatment,
            ):
                draws[entry.degree] = (*draws.get(entry.degree, ()), entry)
        return draws

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


COMPARABLE = (10.0, 5.0)
"""A model is comparable to the one from the clean record when its bandwidth moves by at most so many percent and its
median fit in simulation to records of other waveforms falls by at most so many points."""

NO_BANDWIDTH = 100.0
"""Change of bandwidth, percent, assumed where the disturbed record gives none."""


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a method to a disturbance on one joint.

    Attributes:
        degree: The largest degree up to which every one tried is tolerated, in the disturbance's unit; None where the
            smallest is not.
        everything: Whether the largest one tried is tolerated.
    """

    degree: float | None
    everything: bool


def clean(robustness: Robustness, joint: str, method: str) -> RobustnessOutcome:
    """The model from the undisturbed record."""
    return robustness.of("bias", joint, method)[0.0][0]


def shift(entry: RobustnessOutcome, reference: RobustnessOutcome) -> float:
    """Change of the bandwidth, percent."""
    return NO_BANDWIDTH if entry.failure else 100 * abs(entry.bandwidth_hz / reference.bandwidth_hz - 1)


def comparable(entries: tuple[RobustnessOutcome, ...], reference: RobustnessOutcome) -> bool:
    """Whether the median draw stays comparable; a failed estimate is not comparable."""
    percent, points = COMPARABLE
    if any(entry.failure == "refused" for entry in entries):
        return False
    return (
        median(shift(entry, reference) for entry in entries) <= percent
        and median(reference.fit - entry.fit for entry in entries) <= points
    )


def tolerance(
    robustness: Robustness, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
) -> Tolerance | None:
    """Find the largest tolerated degree of a disturbance.

    Args:
        robustness: The experiment.
        disturbance: Key of the disturbance.
        joint: The joint.
        method: The method.
        treatment: What is taken off the record before.

    Returns:
        The tolerance; None where it was not tried.
    """
    kind = DISTURBANCES[disturbance]
    draws = robustness.of(disturbance, joint, method, treatment)
    levels = sorted((d for d in draws if d or kind.decibel), reverse=kind.falling)
    if not levels:
        return None
    reference = clean(robustness, joint, method)
    last = None
    for degree in levels:
        if not comparable(draws[degree], reference):
            return Tolerance(last, False)
        last = degree
    return Tolerance(last, True)
