"""A metric of the test bench: a number, its expected value, its uncertainty and a verdict."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.theory import Expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL
from scenarios.files.codec import Extended
from scenarios.problems.trial import Trial

NAN = float("nan")
UNLIMITED = (-math.inf, math.inf)

DRAWS = {"quick": 1, "full": 10}
"""Efforts, with the factor on the number of records that each metric takes."""

FALSE_ALARM = 0.005
"""Probability that a perfect estimator fails any verdict of a run, shared evenly among all verdicts."""

INFORMATIVE_ONLY = ("reliability", "speed", "bandwidth")
"""Metrics that say nothing about whether a model is right."""

NEVER_JUDGED = ("bandwidth",)
"""Metrics that never give a verdict."""


class Verdict(Enum):
    """A verdict: its word, the sign that tells it apart without colour, its marker in drawings; from good to bad."""

    PASSES = ("passes", "✓", "o")
    FAILS_AS_THEORY_SAYS = ("fails as theory says", "△", "^")
    NONE = ("no verdict", "–", "$○$")
    FAILS = ("fails", "✗", "X")

    def __init__(self, word: str, sign: str, marker: str) -> None:
        self.word, self.sign, self.marker = word, sign, marker


@dataclass(frozen=True)
class Part:
    """A metric on one problem.

    Attributes:
        label: The problem, or another part of the metric.
        value: NaN where it could not be measured.
        expected: Value of a perfect estimator.
        interval: 95 % Monte-Carlo interval of the value.
        limits: Range of values that pass; infinite on a side without a limit.
        passed: Whether the value lies within the limits; None where there is no verdict.
        theory: Whether theory expects it to pass.
        why: Explanation from theory, or why there is no verdict.
        draws: Number of records that it rests on.
    """

    label: str
    value: Extended
    expected: Extended
    interval: tuple[Extended, Extended]
    limits: tuple[Extended, Extended]
    passed: bool | None
    theory: bool = True
    why: str = ""
    draws: int = 0

    @classmethod
    def judged(
        cls,
        label: str,
        value: float,
        expected: float,
        interval: tuple[float, float],
        limits: tuple[float, float] | None,
        theory: Expectation,
        draws: int,
    ) -> "Part":
        """A part that passes if its value lies within the limits; without limits it has no verdict."""
        low, high = limits or UNLIMITED
        passed = None if limits is None else bool(low <= value <= high)  # JSON does not take NumPy's truth values
        return cls(label, value, expected, interval, (low, high), passed, theory.passes, theory.why, draws)

    @property
    def surprises(self) -> bool:
        """Whether it fails although theory expects it to pass."""
        return self.passed is False and self.theory

    @property
    def verdict(self) -> Verdict:
        """Its verdict."""
        if self.passed is None:
            return Verdict.NONE
        if self.passed:
            return Verdict.PASSES
        return Verdict.FAILS if self.theory else Verdict.FAILS_AS_THEORY_SAYS


@dataclass(frozen=True)
class Metric:
    """The value and verdict of a metric: those of its worst part.

    Attributes:
        name: Key in results.
        title: Name for people.
        unit: Of the value.
        value: Value of the worst part, see `worst_part`; NaN where nothing could be measured. `reliability` and
            `bandwidth` define their own.
        expected: Of that part.
        interval: Of that part.
        passed: Whether all parts pass that theory expects to pass; None where there is no verdict. Only here are the
            parts left out that theory expects to fail.
        false_alarm: Probability that a perfect estimator fails.
        why: What the verdict rests on, and what theory says.
        parts: All parts.
        curves: Numbers for drawing, by name.
    """

    name: str
    title: str
    unit: str
    value: Extended
    expected: Extended
    interval: tuple[Extended, Extended]
    passed: bool | None
    false_alarm: float
    why: str
    parts: tuple[Part, ...] = ()
    curves: Mapping[str, Any] = field(default_factory=dict)

    @property
    def verdict(self) -> Verdict:
        """Its verdict: a part that fails where theory expects it to pass outweighs all others."""
        # A file may say of a metric that it passes and of its part that it fails.
        if self.passed is False or any(part.surprises for part in self.parts):
            return Verdict.FAILS
        if any(part.passed is False for part in self.parts):
            return Verdict.FAILS_AS_THEORY_SAYS
        return Verdict.NONE if self.passed is None else Verdict.PASSES

    def record(self) -> dict[str, Any]:
        """Return what `hmtb verify --json` prints of it."""
        records = []
        for metric_part in self.parts:
            # JSON has no infinity, and null would be a limit that is not known.
            ends = [str(end) if math.isinf(end) else end for end in metric_part.limits]
            records.append(vars(metric_part) | {"limits": ends})
        keys = ("title", "value", "unit", "expected", "interval", "passed", "false_alarm", "why")
        return {**{key: getattr(self, key) for key in keys}, "verdict": self.verdict.word, "parts": records}


@dataclass(frozen=True)
class Evidence:
    """Measurements of an estimator, and what they are judged by.

    Attributes:
        measurements: Of a metric's own trials, as far as they were run, in the order of `MetricDefinition.trials`.
        estimator: The estimator that was measured.
        false_alarm: Allowed probability of a false alarm of each verdict.
        reference: Measurements of the second implementation on the trials of `agreement`.
    """

    measurements: Measurements
    estimator: Estimator
    false_alarm: float
    reference: Measurements = ()

    def on(self, problem: str, ask: str = "fit") -> list[Measurement]:
        """Measurements of one kind of request on a problem."""
        on_problem = [m for m in self.measurements if m.trial.problem == problem]
        return [m for m in on_problem if m.trial.ask == ask]

    def by_problem(self) -> dict[str, tuple[list[Measurement], int]]:
        """Measurements with a model by problem, in their order, each with the number of trials that were run."""
        groups: dict[str, tuple[list[Measurement], int]] = {}
        for m in self.measurements:
            good, run = groups.get(m.trial.problem, ([], 0))
            # One infinite response would make every mean infinite.
            if m.kind == MODEL and m.response is not None and np.isfinite(m.response).all():
                good.append(m)
            # Trials without a model count as run, so that a share of models can be told.
            groups[m.trial.problem] = (good, run + 1)
        return groups


class MetricDefinition(ABC):
    """A metric as it is computed: the trials that it needs, and its value from their measurements.

    Attributes:
        name: Key in results.
        title: Name for people.
        unit: Of its value.
        verdicts: Most verdicts that chance can turn; the probability of a false alarm is shared among those of all
            metrics.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    unit: ClassVar[str] = ""
    verdicts: ClassVar[int] = 0

    @abstractmethod
    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Trials that it needs; trials that several metrics need are run once.

        Args:
            effort: One of `DRAWS`.
        """

    @abstractmethod
    def evaluate(self, evidence: Evidence) -> Metric:
        """Compute the numbers and verdicts of this metric from the measurements of its trials."""

    def of_parts(
        self,
        parts: Sequence[Part],
        false_alarm: float,
        why: str,
        curves: Mapping[str, Any] | None = None,
        *,
        shown: Part | None = None,
    ) -> Metric:
        """Combine parts: the metric fails if any part fails that theory expects to pass.

        It has no verdict where theory expects no judged part to pass. Reasons of parts that fail as expected are added
        to `why`.

        Args:
            parts: None of them: there was no record.
            false_alarm: Probability that a perfect estimator fails.
            why: What the verdict rests on.
            curves: Numbers for drawing.
            shown: Part whose value is the metric's; `worst_part` by default.
        """
        parts = parts or [unjudged("all", "no verdict: no record was run")]
        shown = shown or worst_part(parts)
        # Parts that theory expects to fail excuse no others and decide nothing.
        decisive = any(p.passed is not None and p.theory for p in parts)
        reasons = [p.why for p in parts if p.passed is False and not p.theory]
        if not decisive:
            reasons += [p.why for p in parts if p.passed is None]
        passed = not any(p.surprises for p in parts) if decisive else None
        # Many parts share a reason: each is told once.
        distinct_reasons = dict.fromkeys(filter(None, (why, *reasons)))
        return Metric(
            name=self.name,
            title=self.title,
            unit=self.unit,
            value=shown.value,
            expected=shown.expected,
            interval=shown.interval,
            passed=passed,
            false_alarm=false_alarm,
            why="; ".join(distinct_reasons),
            parts=tuple(parts),
            curves=curves or {},
        )


def unjudged(
    label: str,
    why: str,
    draws: int = 0,
    value: float = NAN,
    expected: float = NAN,
    interval: tuple[float, float] = (NAN, NAN),
    *,
    theory: bool = True,
) -> Part:
    """A part without verdict, and the reason."""
    return Part(label, value, expected, interval, UNLIMITED, None, theory, why, draws)


def worst_part(parts: Sequence[Part]) -> Part:
    """The part whose value is shown as that of the metric: the one furthest beyond its limits.

    Parts that fail although theory expects them to pass come first, so that a metric that fails shows the number that
    fails it; then those that fail as expected; where all pass it is the one nearest to its limits.

    Args:
        parts: At least one; without any verdict it is the first that has a value.
    """
    judged = [p for p in parts if p.surprises] or [p for p in parts if p.passed is not None]
    if judged:
        return max(judged, key=lambda p: (p.passed is False, excess(p)))
    return next((p for p in parts if np.isfinite(p.value)), parts[0])


def excess(part: Part) -> float:
    """Distance from the expected value in units of the distance to the limit: 0 as expected, 1 at a limit.

    0 without a verdict. Where the limit is the expected value itself, what exceeds it counts in units of the limit.
    """
    if part.passed is not None and np.isnan(part.value):
        return float("inf")
    distance = 0.0
    for limit, outwards in ((part.limits[0], -1.0), (part.limits[1], 1.0)):
        room = limit - part.expected
        # On a side without a limit nothing is too far.
        if not np.isfinite(room):
            continue
        if room != 0.0:
            distance = max(distance, (part.value - part.expected) / room)
        elif (part.value - limit) * outwards > 0.0:
            distance = max(distance, 1.0 + abs(part.value - limit) / (abs(limit) or 1.0))
    return float(distance)


def all_pass(metrics: Mapping[str, Metric]) -> bool:
    """Whether no metric fails that theory expects to pass, and at least one was judged.

    An estimator that refuses everything, or has too few models for any verdict, has not passed. Where only metrics were
    chosen that say nothing about whether a model is right, one of them must have a value.
    """
    if any(metric.passed is False for metric in metrics.values()):
        return False
    judging = [metric for name, metric in metrics.items() if name not in INFORMATIVE_ONLY]
    if not judging:
        return any(math.isfinite(metric.value) for metric in metrics.values())
    # A verdict that theory expects to fail counts too: it is one of a part, not of the metric.
    verdicts = [metric.passed for metric in judging]
    for metric in judging:
        verdicts += [p.passed for p in metric.parts]
    return any(passed is not None for passed in verdicts)
