"""Accuracy against the Cramér-Rao bound: efficiency, and agreement with a second implementation.

Here too are the records on which accuracy and claims are judged, and the verdict on a mean over records.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import DRAWS, NAN, UNLIMITED, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.statistics import (
    bound_for,
    error_against_bound,
    in_variances,
    interval_of_mean_share,
    interval_of_positive_mean,
    limits_of_mean,
    limits_of_pooled_mean,
    null_distribution,
    variance_ratio,
)
from scenarios.bench.theory import Expectation, expectation
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import MODEL
from scenarios.files.errors import ScenarioError
from scenarios.problems.problem import Bound
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray

QUICK = ("p2", "p3", "p4", "p5")
"""One problem for each kind of disturbance: output error, ARMAX, Box-Jenkins, equation error."""

FULL = {
    **dict.fromkeys(("p1", *QUICK), 1000),
    **dict.fromkeys(("published-4.7", "published-4.12"), 1000),
    **{f"random-{difficulty}-{number}": 1000 for difficulty in ("easy", "medium", "hard") for number in (1, 2)},
    "mimo@24000": 100,
}
"""Records of each problem by the full effort. Three inputs and outputs have nine responses each, so fewer records do;
these must be long: what the bound leaves out, of second order, is 10 % of the variance at 12 000 samples."""

RECORDS = 100
"""Of each problem by the quick effort."""

AGREEMENT_RECORDS = 20
"""Of each problem of `QUICK` by the quick effort."""

TOGETHER = "together"

CLAIMED = 0.9
"""Least share of the records with a model for which a quantity must be claimed, if it is claimed for any: a covariance
that is singular to rounding now and then is not a selection of favourable records."""

GREATEST_DIFFERENCE = 4.0
"""Of the mean squared difference of two efficient estimators in variances: their deviations add at most."""

SECOND_ORDER = 1.05
"""Slack for what asymptotic theory leaves out of variances."""

IMPLAUSIBLE = 1e-9
"""Answers of the second implementation are ignored if a perfect one is as far from the truth with this probability."""


@dataclass(frozen=True)
class Acceptance:
    """Which means over records pass.

    Attributes:
        expected: Mean of a perfect estimator.
        ratio: Slack as a factor on the limits.
        points: Slack as a difference.
        low: Whether there is a lower limit.
        shares: Whether the values are shares, from 0 to 1; otherwise they are positive.
    """

    expected: float
    ratio: float = 1.0
    points: float = 0.0
    low: bool = True
    shares: bool = False

    def limits(self, nulls: Sequence[FloatArray], draws: Sequence[int], false_alarm: float) -> tuple[float, float]:
        """Limits for the mean over the records of several problems, slack included."""
        return self.with_slack(*limits_of_pooled_mean(nulls, draws, false_alarm, low=self.low))

    def with_slack(self, low: float, high: float) -> tuple[float, float]:
        """Limits widened by the slack."""
        least, most = (0.0, 1.0) if self.shares else UNLIMITED
        return (max(low / self.ratio - self.points, least), min(high * self.ratio + self.points, most))

    def interval(self, values: FloatArray) -> tuple[float, float]:
        """The 95 % Monte-Carlo interval of the mean; NaN where it is infinite."""
        return interval_of_mean_share(values) if self.shares else interval_of_positive_mean(values)


EFFICIENT = Acceptance(expected=1.0, ratio=1.05, low=False)
"""Better than the bound is no fault: an estimator that knows more, or one that is biased, which other metrics show."""


@dataclass(frozen=True, eq=False)
class RecordStatistic:
    """A statistic of the records of one problem.

    Attributes:
        label: Of the part.
        values: One for each record that has a value (n,).
        run: Records that were run.
        null: Values for single records of a perfect estimator (M,); None: there is no bound, and so no verdict.
        theory: What theory expects.
        missing: Why there are no values, where there are none.
        models: Records with a model, which should have a value if any has; 0 where none need have.
    """

    label: str
    values: FloatArray
    run: int
    null: FloatArray | None
    theory: Expectation
    missing: str = ""
    models: int = 0

    @property
    def selective(self) -> bool:
        """Whether some records with a model have a value but too many have none."""
        return 0 < len(self.values) < CLAIMED * self.models and enough(self.models, self.run)

    def part(self, acceptance: Acceptance, false_alarm: float) -> Part:
        """The mean over the records, judged.

        An estimator that makes claims for some records and none for more than a few fails: it would select what it is
        judged by.
        """
        count = len(self.values)
        reason = self.theory.why
        if self.selective and self.null is not None:
            reason = (
                f"claimed of {count} of {self.models} records with a model, expected of all of a problem or of none"
            )
            return replace(_mean_part(self.label, self.values, acceptance, None, True, reason), passed=False)
        limits = None
        if count == 0 and self.missing:
            reason = self.missing
        elif not enough(count, self.run):
            reason = f"no verdict: {count} of {self.run} records have a value, at least {needed(self.run)} are needed"
        elif self.null is None:
            reason = "no verdict: the problem has no Cramér-Rao bound"
        else:
            limits = acceptance.limits([self.null], [count], false_alarm)
        return _mean_part(self.label, self.values, acceptance, limits, self.theory.passes, reason)


def pooled_part(
    label: str, statistics: Sequence[RecordStatistic], acceptance: Acceptance, false_alarm: float
) -> list[Part]:
    """The mean over the records of all problems on which theory expects the estimator to pass.

    Returns:
        The part; none where there are fewer than two such problems.
    """
    chosen = [s for s in statistics if s.theory.passes and s.null is not None and enough(len(s.values), s.run)]
    if len(chosen) < 2:
        return []
    nulls = [s.null for s in chosen if s.null is not None]
    limits = acceptance.limits(nulls, [len(s.values) for s in chosen], false_alarm)
    values = np.concatenate([s.values for s in chosen])
    reason = f"all records of {', '.join(s.label.split()[0] for s in chosen)}"
    return [_mean_part(label, values, acceptance, limits, True, reason)]


def mean_parts(statistics: Sequence[RecordStatistic], acceptance: Acceptance, budget: float) -> list[Part]:
    """The mean of each problem and that of all together, which share the probability of a false alarm evenly."""
    share = budget / (len(statistics) + 1)
    return [
        *[statistic.part(acceptance, share) for statistic in statistics],
        *pooled_part(TOGETHER, statistics, acceptance, share),
    ]


def _mean_part(
    label: str,
    values: FloatArray,
    acceptance: Acceptance,
    limits: tuple[float, float] | None,
    theory: bool,
    why: str,
) -> Part:
    with np.errstate(over="ignore"):
        mean = float(np.mean(values)) if len(values) else NAN
    return Part(
        label=label,
        value=mean,
        expected=acceptance.expected,
        interval=acceptance.interval(values),
        limits=limits or UNLIMITED,
        passed=bool(limits[0] <= mean <= limits[1]) if limits else None,
        theory=theory,
        why=why,
        draws=len(values),
    )


def accuracy_trials(effort: str) -> tuple[Trial, ...]:
    """Trials that efficiency, coverage, normalised error and frequency response share.

    Raises:
        ScenarioError: There is no such effort.
    """
    if effort not in DRAWS:
        raise ScenarioError(f"effort {effort!r} given, expected one of {', '.join(DRAWS)}")
    records = dict.fromkeys(QUICK, RECORDS) if effort == "quick" else FULL
    return tuple(Trial(name, draw) for name, count in records.items() for draw in range(count))


def by_problem(measurements: Measurements) -> dict[str, tuple[list[Measurement], int]]:
    """Measurements with a model by problem, in their order, each with the number of trials that were run."""
    groups: dict[str, tuple[list[Measurement], int]] = {}
    for m in measurements:
        good, run = groups.setdefault(m.trial.problem, ([], 0))
        if m.kind == MODEL and m.response is not None and np.isfinite(m.response).all():
            good.append(m)
        groups[m.trial.problem] = (good, run + 1)
    return groups


def enough(count: int, run: int) -> bool:
    """Whether there are values of enough records for a verdict."""
    return count >= needed(run)


def needed(run: int) -> int:
    """Number of records with a value that a verdict needs: at least half of those that were run, and two."""
    return max(2, (run + 1) // 2)


class AccuracyMetric(MetricDefinition):
    """A metric on the records of accuracy."""

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of one problem for each kind of disturbance, or of many problems."""
        return accuracy_trials(effort)


class Efficiency(AccuracyMetric):
    """Mean over records and frequencies of |error|^2 over the variance of the bound [Ljung1999, sec. 7.4 and ch. 9]."""

    name = "efficiency"
    title = "Efficiency: variance against the Cramér-Rao bound"
    unit = "variance / bound"
    verdicts = len(QUICK) + 1  # of each problem of the quick effort and of all; with more problems each gets less

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Compare the errors with the bound of the estimator's structure, or else of the truth's own."""
        statistics = [
            RecordStatistic(
                label=name,
                values=error_against_bound(good, name, estimator.structure),
                run=run,
                null=null_distribution(name, estimator.structure, variance_ratio, 1.0),
                theory=expectation(estimator, name, self.name),
            )
            for name, (good, run) in by_problem(measurements).items()
        ]
        budget = false_alarm * self.verdicts
        return self.of_parts(
            mean_parts(statistics, EFFICIENT, budget) if statistics else [],
            budget,
            "mean square error of the response over the Cramér-Rao variance, frequency by frequency, averaged; "
            "more than 1.05 times what chance allows a perfect estimator fails",
            {"records": {statistic.label: statistic.values.tolist() for statistic in statistics}},
        )


class Agreement(MetricDefinition):
    """Mean of |difference|^2 / variance of the responses of the estimator and of a second implementation.

    Two efficient estimates of one truth differ by at most 4 variances in the mean, since var(a - b) <= (sa + sb)^2
    whatever their covariance. Two that are independent of each other differ by 2, two that are efficient functions of
    the same record by hardly anything: the covariance of an unbiased estimate with an efficient one is the latter's
    variance, so that var(a - b) = var(a) - var(b) [Rao1973, sec. 5a]. The limit is 4 with the spread that the mean has
    then: nothing efficient fails it.
    """

    name = "agreement"
    title = "Agreement with a second implementation"
    unit = "Cramér-Rao variances"
    verdicts = len(QUICK)

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """The first records of problems that other metrics use too."""
        return tuple(Trial(name, draw) for name in QUICK for draw in range(AGREEMENT_RECORDS * DRAWS[effort]))

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Compare both responses on the same records."""
        second = {m.trial: m.response for m in reference if m.kind == MODEL and m.response is not None}
        parts, digits = [], {}
        for name in QUICK:
            own = [m for m in measurements if m.trial.problem == name and m.trial.ask == "fit"]
            theirs = {trial: response for trial, response in second.items() if trial.problem == name}
            part, digits[name] = _agreement_on(name, own, theirs, estimator, false_alarm)
            parts.append(part)
        known = [value for value in digits.values() if np.isfinite(value)]
        agreed = f"; the responses agree to {min(known):.1f} digits or better in the median" if known else ""
        return self.of_parts(
            parts,
            false_alarm * self.verdicts,
            f"two efficient estimators of one truth differ by at most {GREATEST_DIFFERENCE:g} in the mean, those of "
            f"one record by hardly anything{agreed}",
            {"digits": digits},
        )


def _agreement_on(
    name: str,
    own: Measurements,
    second: Mapping[Trial, ComplexArray],
    estimator: Estimator,
    false_alarm: float,
) -> tuple[Part, float]:
    """The part of a problem, and the median number of digits that agree."""
    truth = bound_for(name, None)
    bound = bound_for(name, estimator.structure)
    null = null_distribution(name, estimator.structure, variance_ratio, 1.0)
    if truth is None or bound is None or null is None:
        return unjudged(name, "there is no Cramér-Rao bound to measure differences by"), NAN
    plausible = _plausible(name, truth, second)
    common = [m for m in own if m.trial in plausible]
    if not common:
        return unjudged(name, "the second implementation gave nothing to compare with"), NAN
    pairs = [
        (m.response, plausible[m.trial])
        for m in common
        if m.kind == MODEL and m.response is not None and m.response.shape == truth.response.shape
    ]
    if not enough(len(pairs), len(common)):
        why = f"{len(pairs)} of {len(common)} records can be compared, at least {needed(len(common))} are needed"
        return unjudged(name, why, len(pairs)), NAN
    difference = np.array([one - other for one, other in pairs])
    values = in_variances(difference, bound)
    _, high = limits_of_mean(GREATEST_DIFFERENCE * null, len(pairs), false_alarm, low=False)
    high *= SECOND_ORDER
    length = np.sqrt(np.mean(np.abs(difference) ** 2, axis=(1, 2, 3)) / np.mean(np.abs(truth.response) ** 2))
    digits = float(np.median(-np.log10(np.maximum(length, 1e-16))))
    # an estimator that need not be efficient may differ by more than two efficient ones do
    theory = expectation(estimator, name, "efficiency")
    interval = interval_of_positive_mean(values)
    return Part.judged(name, float(np.mean(values)), 0.0, interval, (0.0, high), theory, len(pairs)), digits


def _plausible(name: str, truth: Bound, second: Mapping[Trial, ComplexArray]) -> dict[Trial, ComplexArray]:
    """Responses of the second implementation that are not implausibly far from the truth."""
    null = null_distribution(name, None, variance_ratio, 1.0)
    fitting = {trial: response for trial, response in second.items() if response.shape == truth.response.shape}
    if not fitting or null is None:
        return {}
    _, most = limits_of_mean(null, 1, IMPLAUSIBLE, low=False)
    values = in_variances(np.array(list(fitting.values())) - truth.response, truth)
    return {trial: fitting[trial] for trial, value in zip(fitting, values, strict=True) if value <= most}
