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
        selection = (disturbance, joint, method, treatment)
        draws: dict[float, tuple[RobustnessOutcome, ...]] = {}
        for outcome in self.outcomes:
            if (outcome.disturbance, outcome.joint, outcome.method, outcome.treatment) == selection:
                draws[outcome.degree] = (*draws.get(outcome.degree, ()), outcome)
        return draws

    def curve(
        self, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]
    ) -> dict[float, tuple[Range, Range]]:
        """By degree the ranges over draws of the bandwidth's error and of the fit in simulation, percent; see `of`."""
        ranges = {}
        for degree, draws in self.of(disturbance, joint, method, treatment).items():
            errors, fits = [draw.error for draw in draws], [draw.fit for draw in draws]
            ranges[degree] = (_range_of(errors), _range_of(fits))
        return ranges


def _range_of(values: Iterable[float]) -> Range:
    not_nan = [value for value in values if not np.isnan(value)]
    if not not_nan:
        return (float("nan"),) * 3
    return median(not_nan), min(not_nan), max(not_nan)


def comparable(entries: tuple[RobustnessOutcome, ...], reference: RobustnessOutcome) -> bool:
    """Whether the median draw stays comparable; a failed estimate is not comparable."""
    percent, points = COMPARABLE
    # A fit is missing only where the estimator refused the record.
    if any(np.isnan(draw.fit) for draw in entries):
        return False
    shifts = []
    for draw in entries:
        shift = abs(100 * (draw.bandwidth_hz / reference.bandwidth_hz - 1))
        # A model without a bandwidth is as far off as can be; NaN would make the median depend on the order of draws.
        shifts.append(np.nan_to_num(shift, nan=np.inf))
    losses = [reference.fit - draw.fit for draw in entries]
    return bool(median(shifts) <= percent and median(losses) <= points)


def tolerance(robustness: Robustness, disturbance: str, joint: str, method: str, treatment: str = AS_IT_IS[0]) -> str:
    """Describe the largest degree of a disturbance that a method tolerates: the model stays comparable up to there.

    Such as "up to 2", "all, up to 5", "none", or a dash where it was not tried.
    """
    kind = DISTURBANCES[disturbance]
    draws = robustness.of(disturbance, joint, method, treatment)
    # Degree 0 is the undisturbed record, except in decibels, where 0 is a ratio of one.
    levels = sorted((degree for degree in draws if degree or kind.decibel), reverse=kind.falling)
    if not levels:
        return "–"
    # A bias of zero is the undisturbed record, and nothing of it is random.
    undisturbed = robustness.of("bias", joint, method)[0.0][0]
    tolerated = list(takewhile(lambda degree: comparable(draws[degree], undisturbed), levels))
    if not tolerated:
        return "none"
    direction = "down" if kind.falling else "up"
    largest = f"{direction} to {tolerated[-1]:g}"
    return f"all, {largest}" if tolerated == levels else largest


def sysid_method(joint: str) -> str:
    """The prediction-error method that the thesis chose for a joint."""
    return next(structure.method for structure in STRUCTURES[joint] if structure.chosen and structure.method != "okid")


def other_structures(joint: str) -> tuple[Structure, ...]:
    """Return the structures that the thesis tried and did not choose: the other prediction-error structure, and ARX."""
    tried = ("armax", "oe", "arx")
    return tuple(
        structure for structure in every_structure(joint) if structure.method in tried and not structure.chosen
    )


def robustness(campaign: Campaign, *, thorough: bool = True, part: Part = NO_REPORT) -> Robustness:
    """Disturb the estimation records by degree and identify models from them.

    A joint without the estimation record or any that judges is left out. Unless thorough, only the orders are compared
    that finding F25 rests on.
    """
    outcomes: list[RobustnessOutcome] = []
    orders: list[OrderNeeded] = []
    judged_by: dict[str, tuple[int, ...]] = {}
    disturbances = tuple(DISTURBANCES.values()) if thorough else ()
    for joint, of_joint in part.split(STUDIED_JOINTS):
        data = campaign.singles(joint)
        tests = tuple(test for test in JUDGES if test in data)
        if not tests or ESTIMATION_TEST not in data:
            continue
        judged_by[joint] = tests
        judges = tuple(data[test][:JUDGED] for test in tests)
        truth = best_linear_of(campaign.condition, joint)
        trial = _Trial(data[ESTIMATION_TEST], judges, truth, campaign.seed or 0)
        with warnings.catch_warnings():
            # Warnings are what this experiment provokes; failures are counted.
            warnings.simplefilter("ignore", SysidWarning)
            for disturbance, share in of_joint.split(disturbances):
                outcomes += trial.outcomes(disturbance, share)
            # With its means, which the records of the campaign have lost.
            orders += trial.orders(settled(campaign.log(data[ESTIMATION_TEST].name), joint))
    return Robustness(tuple(outcomes), tuple(orders), judged_by)


@dataclass(frozen=True, eq=False)
class _Trial:
    """Estimation and validation records of one joint."""

    data: IOData
    judges: Sequence[IOData]
    truth: BestLinearOfTest
    seed: int

    def outcomes(self, disturbance: Disturbance, progress: Part) -> list[RobustnessOutcome]:
        """Models from the record under one disturbance, of every treatment, degree and draw."""
        outcomes = []
        # A part has a mean of its own, which is not that of the record.
        clean = self.data if disturbance.whole else self.data[:PART].detrend()
        chosen = tuple(structure for structure in STRUCTURES[self.truth.joint] if structure.chosen)
        for (treatment, degree), _ in progress.split(list(product(disturbance.treatments, disturbance.degrees))):
            for draw in range(self._draws(disturbance, degree)):
                spoilt = disturbance.spoil(clean, degree, self._generator(disturbance, degree, draw))
                record = TREATMENTS[treatment](spoilt)
                structures = chosen
                # Structures that the thesis did not choose stand beside the chosen ones, untreated and of the first
                # draw.
                if disturbance.other_structures and draw == 0 and treatment == AS_IT_IS[0]:
                    structures += other_structures(self.truth.joint)
                outcomes += [
                    self._outcome(structure, record, disturbance.key, treatment, degree) for structure in structures
                ]
        return outcomes

    def _draws(self, disturbance: Disturbance, degree: float) -> int:
        """Number of draws of a degree: none of parts longer than the record, and one of the record as a whole."""
        if disturbance.key != "length":
            return disturbance.draws
        samples = round(degree / self.data.dt)
        if samples > len(self.data):
            return 0
        # The whole record has only one segment.
        return 1 if samples == len(self.data) else disturbance.draws

    def _generator(self, disturbance: Disturbance, degree: float, draw: int) -> np.random.Generator:
        """Random numbers of a draw, the same for every structure and treatment."""
        # Held and marked drop-outs lose the same samples.
        disturbance_index = list(DISTURBANCES).index(disturbance.key.replace("marked", "held"))
        joint_index = STUDIED_JOINTS.index(self.truth.joint)
        degree_index = disturbance.degrees.index(degree)
        # A seed of its own for every cell: further draws of one disturbance leave the others as they were.
        entropy = (SEED, self.seed, joint_index, disturbance_index, degree_index, draw)
        return np.random.default_rng(np.random.SeedSequence(entropy))

    def _outcome(
        self, structure: Structure, disturbed: IOData, key: str, treatment: str, degree: float
    ) -> RobustnessOutcome:
        keys = (self.truth.joint, structure.method, structure.chosen, key, treatment, degree)
        try:
            model = estimate(disturbed, structure.estimator, structure.orders)
        except SysidError:
            return RobustnessOutcome(*keys, bandwidth_hz=np.nan, error=np.nan, covers=False, fit=np.nan)
        # Value and ends of its interval.
        # An unstable model has no response to read a bandwidth off.
        bandwidth = model.bandwidth().path() if model.model.is_stable() else (np.nan,) * 3
        return RobustnessOutcome(
            *keys,
            bandwidth_hz=bandwidth[0],
            error=100 * (bandwidth[0] / self.truth.hz - 1),
            covers=intervals_agree(bandwidth, (self.truth.hz, *self.truth.ci95)),
            fit=simulation_fit(model, self.judges),
        )

    def orders(self, with_means: IOData) -> list[OrderNeeded]:
        """Order that suffices on the detrended record and on three that are disturbed, for both methods."""
        joint, limits = self.truth.joint, CLAIMS["F25"].limits
        part = self.data[:SHORT_PART].detrend()
        records = {DETRENDED: part, WITH_MEANS: with_means[:SHORT_PART]}
        for name, key in ((CONSTANT, "bias"), (OUTLIERS, "outliers")):
            # One fixed draw: on every joint and in every study the same samples are outliers.
            records[name] = DISTURBANCES[key].spoil(part, limits[key], np.random.default_rng(0))
        results = []
        for method, (estimator, orders) in ORDERS.items():
            for name, record in records.items():
                fits = {order: self._fit(record, estimator, order) for order in orders}
                results.append(OrderNeeded(joint, method, name, fits))
        return results

    def _fit(self, record: IOData, estimator: str, states: int) -> float:
        """Median fit of a model of so many states, percent; minus infinity where there is no stable one."""
        if estimator == "okid":
            # p = 5 observer Markov parameters, as in the thesis [Morris1996, sec. V.2A].
            orders: tuple[int, ...] = (states, 5)
        else:
            orders = (states, states, SUFFICIENT[self.truth.joint][2])
        try:
            model = estimate(record, estimator, orders)
        except SysidError:
            return float("-inf")
        return simulation_fit(model, self.judges) if model.model.is_stable() else float("-inf")
