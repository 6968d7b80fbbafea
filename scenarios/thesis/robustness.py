"""Robustness of methods: models from records with disturbances of rising degree, and the orders that suffice.

Every model is identified from a part of the estimation record, disturbed [Morris1996, sec. VI.6]; its bandwidth is
compared with the best linear truth and its simulation with clean records of other waveforms. The PRBS of twice the
amplitude is none of them: it plays the same sequence, which every model has seen.
"""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product, takewhile
from statistics import median
from types import MappingProxyType

import numpy as np

from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.log_review import settled
from scenarios.experiments.model_structures import STRUCTURES, SUFFICIENT, Structure, every_structure
from scenarios.identification.methods import estimate
from scenarios.identification.recovered_bandwidth import intervals_agree
from scenarios.thesis.attribution import best_linear_of
from scenarios.thesis.campaign import ESTIMATION_TEST, Campaign
from scenarios.thesis.disturbances import AS_IT_IS, DISTURBANCES, TREATMENTS, Disturbance
from scenarios.thesis.estimates import simulation_fit
from scenarios.thesis.finding import CLAIMS
from scenarios.thesis.steps import NO_REPORT, Part
from scenarios.truth.bla_of_test import BestLinearOfTest
from sysid import IOData, SysidError, SysidWarning

JUDGES = (2, 7, 8)
"""Tests that judge a model by its median fit to those that there are: two tones, pulses, chirp, one of each waveform
that the single-joint tests have beside binary sequences (a single tone is one of the two)."""

JUDGED = 3000
"""Samples of them that a model is compared with, a minute: every waveform repeats in a few seconds."""

SEED = 25
"""Second seed of all random draws here, beside the study's own."""

PART, SHORT_PART = 2000, 1000
"""Samples of the disturbed part, from the start; of the part for orders: larger ones than needed take long to fit."""

ORDERS: Mapping[str, tuple[str, tuple[int, ...]]] = MappingProxyType(
    {"SysID": ("oe", (1, 2, 3)), "OKID": ("okid", (1, 2, 3, 4))}
)
"""Kinds of model with a single order: output error with as many coefficients of B as of F, and OKID; its estimator, and
the numbers of states compared, up to the largest in the thesis."""

MARGIN = 1.0
"""An order suffices whose fit is at most so far below the best order's on the same record, percent points."""

DETRENDED, WITH_MEANS = "detrended", "with its means"
"""The record as the study uses it; the same with the angle about which the joint moves, in command and measurement."""

CONSTANT, OUTLIERS = "with a constant in the output", "with outliers"
"""The detrended record with a constant added to the output alone, and with outliers in the output."""

COMPARABLE = (10.0, 5.0)
"""A model is comparable to the one from the clean record when its bandwidth moves by at most so many percent (never
where it has none) and its median fit in simulation to records of other waveforms falls by at most so many points."""

Range = tuple[float, float, float]
"""Median, smallest and largest over draws; NaN where there is none."""


@dataclass(frozen=True)
class OrderNeeded:
    """Number of sufficient states on one record.

    Attributes:
        joint: The joint.
        method: `SysID` or `OKID`.
        record: What the record is like.
        fits: In simulation to records of other waveforms, percent, median, by order; minus infinity where there is no
            stable model.
    """

    joint: str
    method: str
    record: str
    fits: Mapping[int, float]

    @property
    def needed(self) -> int:
        """The smallest order whose fit is within `MARGIN` of the best on the same record."""
        return self.sufficient(max(self.fits.values()), MARGIN)

    def sufficient(self, best: float, points: float) -> int:
        """Return the smallest order whose fit is within some points of another, or one more than the largest tried."""
        return min((n for n, fit in self.fits.items() if fit >= best - points), default=max(self.fits) + 1)


@dataclass(frozen=True)
class RobustnessOutcome:
    """One model from one disturbed record; keys of `STRUCTURES`, `DISTURBANCES` and `TREATMENTS` name it.

    The degree is in the disturbance's unit. Bandwidth (Hz) and its departure from the best linear truth (percent) are
    NaN where the estimator refused, the model is unstable or its gain never falls by 3 dB; the fit in simulation to the
    records that judge (percent, their median) where the estimator refused.
    """

    joint: str
    method: str
    chosen: bool
    disturbance: str
    treatment: str
    degree: float
    bandwidth_hz: float
    error: float
    covers: bool
    fit: float


@dataclass(frozen=True, eq=False)
class Robustness:
    """Results of the whole robustness experiment.

    Attributes:
        outcomes: Every model; none where only the orders were asked for.
        orders: How many states suffice, on the detrended record and on others.
        judged_by: Numbers of the tests that judge, by joint.
    """

    outcomes: tuple[RobustnessOutcome, ...]
    orders: tuple[OrderNeeded, ...]
    judged_by: Mapping[str, tuple[int, ...]]

    def of(
        self, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
    ) -> dict[float, tuple[RobustnessOutcome, ...]]:
        """Draws by degree, of one disturbance, joint, method and treatment."""
        asked = (disturbance, joint, method, treatment)
        draws: dict[float, tuple[RobustnessOutcome, ...]] = {}
        for entry in self.outcomes:
            if (entry.disturbance, entry.joint, entry.method, entry.treatment) == asked:
                draws[entry.degree] = (*draws.get(entry.degree, ()), entry)
        return draws

    def curve(
        self, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
    ) -> dict[float, tuple[Range, Range]]:
        """By degree the errors of the bandwidths that there are, and the fits in simulation, percent; see `of`."""
        draws = self.of(disturbance, joint, method, treatment)
        return {
            degree: (_spread(entry.error for entry in entries), _spread(entry.fit for entry in entries))
            for degree, entries in draws.items()
        }


def _spread(values: Iterable[float]) -> Range:
    known = [value for value in values if not np.isnan(value)]
    return (median(known), min(known), max(known)) if known else (float("nan"),) * 3


def comparable(entries: tuple[RobustnessOutcome, ...], reference: RobustnessOutcome) -> bool:
    """Whether the median draw stays comparable; a failed estimate is not comparable."""
    percent, points = COMPARABLE
    if any(np.isnan(entry.fit) for entry in entries):
        return False
    shifts = [np.nan_to_num(abs(100 * (one.bandwidth_hz / reference.bandwidth_hz - 1)), nan=np.inf) for one in entries]
    return bool(median(shifts) <= percent and median(reference.fit - entry.fit for entry in entries) <= points)


def tolerance(robustness: Robustness, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]) -> str:
    """Describe the largest degree of a disturbance up to which every one tried leaves a comparable model.

    Such as "up to 2", "all, up to 5", "none", or a dash where it was not tried.
    """
    kind = DISTURBANCES[disturbance]
    draws = robustness.of(disturbance, joint, method, treatment)
    levels = sorted((d for d in draws if d or kind.decibel), reverse=kind.falling)
    if not levels:
        return "–"
    reference = robustness.of("bias", joint, method)[0.0][0]  # not disturbed
    tolerated = list(takewhile(lambda degree: comparable(draws[degree], reference), levels))
    if not tolerated:
        return "none"
    largest = f"{'down' if kind.falling else 'up'} to {tolerated[-1]:g}"
    return f"all, {largest}" if tolerated == levels else largest


def sysid_method(joint: str) -> str:
    """The prediction-error method that the thesis chose for a joint."""
    return next(entry.method for entry in STRUCTURES[joint] if entry.chosen and entry.method != "okid")


def other_structures(joint: str) -> tuple[Structure, ...]:
    """Return the structures that the thesis tried and did not choose: the other prediction-error structure, and ARX."""
    return tuple(
        entry for entry in every_structure(joint) if entry.method in ("armax", "oe", "arx") and not entry.chosen
    )


def robustness(campaign: Campaign, *, thorough: bool = True, part: Part = NO_REPORT) -> Robustness:
    """Disturb the estimation records by degree and identify models from them.

    A joint without the estimation record or any that judges is left out. Unless thorough, only the orders are compared
    that finding F25 rests on.
    """
    outcomes: list[RobustnessOutcome] = []
    orders: list[OrderNeeded] = []
    judged_by: dict[str, tuple[int, ...]] = {}
    for joint, of_joint in part.split(STUDIED_JOINTS):
        data = campaign.singles(joint)
        numbers = tuple(number for number in JUDGES if number in data)
        if not numbers or ESTIMATION_TEST not in data:
            continue
        judged_by[joint] = numbers
        judges = tuple(data[number][:JUDGED] for number in numbers)
        truth = best_linear_of(campaign.condition, joint)
        trial = _Trial(data[ESTIMATION_TEST], judges, truth, campaign.seed or 0)
        with warnings.catch_warnings():
            # Warnings are what this experiment provokes; failures are counted.
            warnings.simplefilter("ignore", SysidWarning)
            for disturbance, share in of_joint.split(tuple(DISTURBANCES.values()) if thorough else ()):
                outcomes += trial.outcomes(disturbance, share)
            orders += trial.orders(settled(campaign.log(data[ESTIMATION_TEST].name), joint))
    return Robustness(tuple(outcomes), tuple(orders), judged_by)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Estimation and validation records of one joint."""

    data: IOData
    judges: Sequence[IOData]
    truth: BestLinearOfTest
    seed: int

    def outcomes(self, disturbance: Disturbance, part: Part) -> list[RobustnessOutcome]:
        outcomes = []
        clean = self.data if disturbance.whole else self.data[:PART].detrend()
        chosen = tuple(entry for entry in STRUCTURES[self.truth.joint] if entry.chosen)
        for (treatment, degree), _ in part.split(list(product(disturbance.treatments, disturbance.degrees))):
            for draw in range(self._draws(disturbance, degree)):
                spoilt = disturbance.spoil(clean, degree, self._chance(disturbance, degree, draw))
                record = TREATMENTS[treatment](spoilt)
                # The others stand beside the chosen ones, untreated and of the first draw.
                also = disturbance.other_structures and not draw and treatment == AS_IT_IS[0]
                outcomes += [
                    self._outcome(structure, record, disturbance.key, treatment, degree)
                    for structure in (*chosen, *(other_structures(self.truth.joint) if also else ()))
                ]
        return outcomes

    def _draws(self, disturbance: Disturbance, degree: float) -> int:
        """No draw of parts longer than the record, and one of the record as a whole."""
        if disturbance.key != "length":
            return disturbance.draws
        length, whole = round(degree / self.data.dt), len(self.data)
        return disturbance.draws if length < whole else int(length == whole)

    def _chance(self, disturbance: Disturbance, degree: float, draw: int) -> np.random.Generator:
        """Seed of a draw: the same for every structure and treatment."""
        # Held and marked drop-outs lose the same samples.
        kind = list(DISTURBANCES).index(disturbance.key.replace("marked", "held"))
        joint = STUDIED_JOINTS.index(self.truth.joint)
        step = disturbance.degrees.index(degree)
        return np.random.default_rng(np.random.SeedSequence((SEED, self.seed, joint, kind, step, draw)))

    def _outcome(
        self, structure: Structure, disturbed: IOData, key: str, treatment: str, degree: float
    ) -> RobustnessOutcome:
        place = (self.truth.joint, structure.method, structure.chosen, key, treatment, degree)
        try:
            model = estimate(disturbed, structure.estimator, structure.orders)
        except SysidError:
            return RobustnessOutcome(*place, np.nan, np.nan, False, np.nan)
        band = model.bandwidth().path() if model.model.is_stable() else (np.nan,) * 3
        agrees = intervals_agree(band, (self.truth.hz, *self.truth.ci95))
        error = 100 * (band[0] / self.truth.hz - 1)
        return RobustnessOutcome(*place, band[0], error, agrees, simulation_fit(model, self.judges))

    def orders(self, with_means: IOData) -> list[OrderNeeded]:
        """Order that suffices on the detrended record and on three that are disturbed, for both methods."""
        joint, limits = self.truth.joint, CLAIMS["F25"].limits
        part = self.data[:SHORT_PART].detrend()
        records = {DETRENDED: part, WITH_MEANS: with_means[:SHORT_PART]}
        for name, key in ((CONSTANT, "bias"), (OUTLIERS, "outliers")):
            records[name] = DISTURBANCES[key].spoil(part, limits[key], np.random.default_rng(0))
        return [
            OrderNeeded(joint, method, name, {n: self._fit(record, estimator, n) for n in tried})
            for method, (estimator, tried) in ORDERS.items()
            for name, record in records.items()
        ]

    def _fit(self, record: IOData, estimator: str, n: int) -> float:
        try:
            model = estimate(
                record, estimator, (n, 5) if estimator == "okid" else (n, n, SUFFICIENT[self.truth.joint][2])
            )
        except SysidError:
            return float("-inf")
        return simulation_fit(model, self.judges) if model.model.is_stable() else float("-inf")
