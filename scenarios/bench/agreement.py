"""Agreement with a second implementation on the same records."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.bench.accuracy_records import enough, needed
from scenarios.bench.interval_of_mean import interval_of_positive_mean
from scenarios.bench.measured import Measured
from scenarios.bench.metric import DRAWS, Figure, Part
from scenarios.bench.perfect_mean import limits_of_mean
from scenarios.bench.perfect_records import bound_for, single_records
from scenarios.bench.response_statistics import free_parts, parts_of, power
from scenarios.bench.theory import expectation
from scenarios.bench.worst_part import figure_of_parts, unjudged
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.outcome import MODEL
from scenarios.problems.bound import response_covariance
from scenarios.problems.problem import Bound
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

PROBLEMS = ("p2", "p3", "p4", "p5")
RECORDS = 20
BOUND = 4.0
"""Of the mean squared difference of two efficient estimators in variances: deviations add at most."""

SLACK = 1.05
"""For what asymptotic theory leaves out of variances."""

ABSURD = 1e-9
"""A second implementation further from the truth than a perfect one is with this probability has failed itself."""


@dataclass(frozen=True)
class Agreement:
    """Mean of |difference|^2 / variance of the responses of the estimator and of the second implementation.

    Two efficient estimates of one truth differ by at most 4 variances in the mean, since var(a - b) <= (sa + sb)^2
    whatever their covariance. Two that are independent of each other differ by 2, two that are efficient functions of
    the same record by hardly anything: the covariance of an unbiased estimate with an efficient one is the latter's
    variance, so that var(a - b) = var(a) - var(b) [Rao1973, sec. 5a]. The limit is 4 with the spread that the mean has
    then: nothing efficient fails it.
    """

    name: str = "agreement"
    title: str = "Agreement with a second implementation"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The first records of some problems that other figures use too."""
        return tuple(Trial(name, draw) for name in PROBLEMS for draw in range(RECORDS * DRAWS[effort]))

    def verdicts(self) -> int:
        """One per problem."""
        return len(PROBLEMS)

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Compare what both gave for the same records."""
        second = {m.trial: m.response for m in referee if m.kind == MODEL and m.response is not None}
        parts, digits = [], {}
        for name in PROBLEMS:
            own = [m for m in measured if m.trial.problem == name and m.trial.ask == "fit"]
            theirs = {trial: response for trial, response in second.items() if trial.problem == name}
            part, digits[name] = _part(name, own, theirs, contestant, false_alarm)
            parts.append(part)
        known = [value for value in digits.values() if np.isfinite(value)]
        told = f"; the responses agree to {min(known):.1f} digits or better in the median" if known else ""
        return figure_of_parts(
            self.name,
            self.title,
            "Cramér-Rao variances",
            parts,
            false_alarm * len(PROBLEMS),
            f"two efficient estimators of one truth differ by at most {BOUND:g} in the mean, of one record by hardly "
            f"anything{told}",
            {"digits": digits},
        )


def _part(
    name: str,
    own: Sequence[Measured],
    second: Mapping[Trial, ComplexArray],
    contestant: Contestant,
    false_alarm: float,
) -> tuple[Part, float]:
    """The part of a problem, and the digits of agreement in the median."""
    nan = float("nan")
    truth = bound_for(name, None)
    bound = bound_for(name, contestant.structure)
    single = single_records(name, contestant.structure, power, 1.0)
    if truth is None or bound is None or single is None:
        return unjudged(name, "no bound is known that differences could be measured by"), nan
    usual = _usual(name, truth, second)
    asked = [m for m in own if m.trial in usual]
    if not asked:
        return unjudged(name, "the second implementation gave nothing to compare with"), nan
    pairs = [
        (m.response, usual[m.trial])
        for m in asked
        if m.kind == MODEL and m.response is not None and m.response.shape == truth.response.shape
    ]
    if not enough(len(pairs), len(asked)):
        told = f"{len(pairs)} of {len(asked)} records can be compared, at least {needed(len(asked))} are needed"
        return unjudged(name, told, len(pairs)), nan
    difference = np.array([one - other for one, other in pairs])
    values = _variances(difference, bound)
    _, high = limits_of_mean(BOUND * single, len(pairs), false_alarm, low=False)
    high *= SLACK
    length = np.sqrt(np.mean(np.abs(difference) ** 2, axis=(1, 2, 3)) / np.mean(np.abs(truth.response) ** 2))
    digits = float(np.median(-np.log10(np.maximum(length, 1e-16))))
    value = float(np.mean(values))
    # where it need not be efficient it may differ by more than what two efficient ones do
    theory = expectation(contestant, name, "efficiency")
    part = Part(
        label=name,
        value=value,
        expected=0.0,
        interval=interval_of_positive_mean(values),
        limits=(0.0, high),
        passed=bool(value <= high),
        theory=theory.passes,
        why=theory.why,
        draws=len(pairs),
    )
    return part, digits


def _variances(difference: ComplexArray, bound: Bound) -> FloatArray:
    covariance = response_covariance(bound)
    return power(parts_of(difference), covariance, free_parts(covariance))


def _usual(name: str, truth: Bound, second: Mapping[Trial, ComplexArray]) -> dict[Trial, ComplexArray]:
    """Answers of the second implementation that are not absurdly far from the truth."""
    single = single_records(name, None, power, 1.0)
    fitting = {trial: response for trial, response in second.items() if response.shape == truth.response.shape}
    if not fitting or single is None:
        return {}
    _, most = limits_of_mean(single, 1, ABSURD, low=False)
    values = _variances(np.array(list(fitting.values())) - truth.response, truth)
    return {trial: fitting[trial] for trial, value in zip(fitting, values, strict=True) if value <= most}
