"""Accuracy against the Cramér-Rao bound: efficiency, and agreement with a second implementation.

Here too are the records on which accuracy and claims are judged, and the verdict on a mean over records.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from scenarios.bench.metric import DRAWS, NAN, UNLIMITED, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.null_distributions import SLACK, bound_for, error_against_bound, in_variances, null_distribution
from scenarios.bench.theory import Expectation, expectation
from scenarios.estimators.outcome import MODEL
from scenarios.problems.trial import Trial
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation import CramerRaoBound
from sysid.validation.monte_carlo import interval_of_mean_share, interval_of_positive_mean, limits_of_mean
from sysid.validation.response_errors import variance_ratio

QUICK = ("p2", "p3", "p4", "p5")
"""One problem for each kind of disturbance: output error, ARMAX, Box-Jenkins, equation error."""

RECORDS = 100
"""Of each problem by the quick effort."""

_RANDOM = [f"random-{difficulty}-{index}" for difficulty, index in product(("easy", "medium", "hard"), (1, 2))]
FULL = {
    **dict.fromkeys(("p1", *QUICK, "published-4.7", "published-4.12"), 1000),
    **dict.fromkeys(_RANDOM, 1000),
    "mimo@24000": 100,
}
"""Records of each problem by the full effort. Three inputs and outputs have nine responses each, so fewer records do;
these must be long: what the bound leaves out, of second order, is 10 % of the variance at 12 000 samples."""

AGREEMENT_RECORDS = 20
"""Of each problem of `QUICK` by the quick effort."""

TOGETHER = "together"

CLAIMED = 0.9
"""Least share of the records with a model for which a quantity must be claimed, if it is claimed for any: a covariance
that is singular to rounding now and then is not a selection of favourable records."""

GREATEST_DIFFERENCE = 4.0
"""Of the mean squared difference of two efficient estimators in variances: their deviations add at most."""

IMPLAUSIBLE = 1e-9
"""Answers of the second implementation are ignored if a perfect one is as far from the truth with this probability."""


@dataclass(frozen=True)
class Acceptance:
    """Criterion by which a mean over records passes.

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
        return self.with_slack(*limits_of_mean(nulls, draws, false_alarm, low=self.low))

    def with_slack(self, low: float, high: float) -> tuple[float, float]:
        """Limits widened by the slack."""
        lowest, highest = (0.0, 1.0) if self.shares else UNLIMITED
        return (max(low / self.ratio - self.points, lowest), min(high * self.ratio + self.points, highest))

    def mean(self, label: str, values: FloatArray, theory: Expectation, limits: tuple[float, float] | None) -> Part:
        """A part whose value is the mean of values (n,); without limits it has no verdict."""
        mean = NAN
        # Errors of an estimator that is far off may have squares beyond the largest number.
        with np.errstate(over="ignore"):
            if len(values):
                mean = float(np.mean(values))
        interval = interval_of_mean_share(values) if self.shares else interval_of_positive_mean(values)
        return Part.judged(label, mean, self.expected, interval, limits, theory, len(values))


EFFICIENT = Acceptance(expected=1.0, ratio=SLACK, low=False)
"""Better than the bound is no fault: an estimator that knows more, or one that is biased, which other metrics show."""


@dataclass(frozen=True, eq=False)
class RecordStatistic:
    """A statistic of the records of one problem.

    Attributes:
        label: Of the part.
        values: One for each record that has a value (n,).
        run: Records that were run.
        null: Values for single records of a perfect estimator (M,).
        theory: What theory expects.
        missing: Why there are no values, where there are none.
        models: Records with a model, which should have a value if any has; 0 where none need have.
    """

    label: str
    values: FloatArray
    run: int
    null: FloatArray
    theory: Expectation
    missing: str = ""
    models: int = 0

    def part(self, acceptance: Acceptance, false_alarm: float) -> Part:
        """The mean over the records, judged.

        An estimator that makes claims for some records and none for more than a few fails: it would select what it is
        judged by.
        """
        count, limits, why = len(self.values), None, ""
        # With too few models there is no verdict in any case.
        if 0 < count < CLAIMED * self.models and self.models >= needed(self.run):
            why = f"claimed of {count} of {self.models} records with a model, expected of all of a problem or of none"
            return replace(acceptance.mean(self.label, self.values, Expectation(True, why), None), passed=False)
        if count == 0 and self.missing:
            why = self.missing
        elif count < needed(self.run):
            why = f"no verdict: {count} of {self.run} records have a value, at least {needed(self.run)} are needed"
        else:
            limits = acceptance.limits([self.null], [count], false_alarm)
        return acceptance.mean(self.label, self.values, replace(self.theory, why=why or self.theory.why), limits)


def pooled_part(
    label: str, statistics: Sequence[RecordStatistic], acceptance: Acceptance, false_alarm: float
) -> list[Part]:
    """The mean over the records of all problems on which theory expects the estimator to pass.

    Returns:
        The part; none where there are fewer than two such problems.
    """
    judged = [s for s in statistics if len(s.values) >= needed(s.run)]
    chosen = [s for s in judged if s.theory.passes]
    # Of a single problem the mean is that of its own part.
    if len(chosen) < 2:
        return []
    counts = [len(s.values) for s in chosen]
    limits = acceptance.limits([s.null for s in chosen], counts, false_alarm)
    # A label begins with the name of its problem.
    problems = ", ".join(s.label.split()[0] for s in chosen)
    values = np.concatenate([s.values for s in chosen])
    return [acceptance.mean(label, values, Expectation(True, f"all records of {problems}"), limits)]


def mean_parts(statistics: Sequence[RecordStatistic], acceptance: Acceptance, budget: float) -> list[Part]:
    """The mean of each problem and that of all together, which share the probability of a false alarm evenly."""
    # One more for the mean of all problems together.
    share = budget / (len(statistics) + 1)
    metric_parts = [statistic.part(acceptance, share) for statistic in statistics]
    return metric_parts + pooled_part(TOGETHER, statistics, acceptance, share)


def needed(run: int) -> int:
    """Number of records with a value that a verdict needs: at least half of those that were run, and two."""
    return max(2, (run + 1) // 2)


class AccuracyMetric(MetricDefinition):
    """A metric on the records that efficiency, coverage, normalised error and frequency response share."""

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Records of one problem for each kind of disturbance, or of many problems."""
        records = {"quick": dict.fromkeys(QUICK, RECORDS), "full": FULL}[effort]
        trials = []
        for name, count in records.items():
            trials += [Trial(name, draw) for draw in range(count)]
        return tuple(trials)


class Efficiency(AccuracyMetric):
    """Mean over records and frequencies of |error|^2 over the variance of the bound [Ljung1999, sec. 7.4 and ch. 9].

    The bound is that of the estimator's structure, or else of the truth's own.
    """

    name = "efficiency"
    title = "Efficiency: variance against the Cramér-Rao bound"
    unit = "variance / bound"
    verdicts = len(QUICK) + 1  # of each problem of the quick effort and of all; with more problems each gets less

    def evaluate(self, evidence: Evidence) -> Metric:
        """Compare the errors with the bound."""
        estimator, budget = evidence.estimator, evidence.false_alarm * self.verdicts
        statistics = []
        for name, (good, run) in evidence.by_problem().items():
            values = error_against_bound(good, name, estimator.structure)
            null = null_distribution(name, estimator.structure, variance_ratio, 1.0)
            theory = expectation(estimator, name, self.name)
            statistics.append(RecordStatistic(name, values, run, null, theory))
        return self.of_parts(
            mean_parts(statistics, EFFICIENT, budget),
            budget,
            "mean square error of the response over the Cramér-Rao variance, frequency by frequency, averaged, where "
            "the orders and the delay of the truth are given; more than 1.05 times what chance allows a perfect "
            "estimator fails",
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
        draws = range(AGREEMENT_RECORDS * DRAWS[effort])
        return tuple(Trial(name, draw) for name, draw in product(QUICK, draws))

    def evaluate(self, evidence: Evidence) -> Metric:
        """Compare both responses on the same records."""
        answered = [m for m in evidence.reference if m.kind == MODEL]
        second = {m.trial: m.response for m in answered if m.response is not None}
        metric_parts, digits = [], {}
        for name in QUICK:
            agreement, digits[name] = _agreement_on(name, evidence, second)
            metric_parts.append(agreement)
        finite = [value for value in digits.values() if np.isfinite(value)]
        agreed = f"; the responses agree to {min(finite):.1f} digits or better in the median" if finite else ""
        return self.of_parts(
            metric_parts,
            evidence.false_alarm * self.verdicts,
            f"two efficient estimators of one truth differ by at most {GREATEST_DIFFERENCE:g} in the mean, those of "
            f"one record by hardly anything{agreed}",
            {"digits": digits},
        )


def _agreement_on(name: str, evidence: Evidence, second: Mapping[Trial, ComplexArray]) -> tuple[Part, float]:
    """The part of agreement on one problem, and the median number of digits to which both responses agree."""
    truth, bound = (bound_for(name, structure) for structure in (None, evidence.estimator.structure))
    null = null_distribution(name, evidence.estimator.structure, variance_ratio, 1.0)
    plausible = _plausible(name, truth, second)
    common = [m for m in evidence.on(name) if m.trial in plausible]
    if not common:
        return unjudged(name, "the second implementation gave nothing to compare with"), NAN
    differences = []
    for m in common:
        if m.kind == MODEL and m.response is not None and m.response.shape == truth.response.shape:
            differences.append(m.response - plausible[m.trial])
    difference, count = np.array(differences), len(differences)
    if count < needed(len(common)):
        why = f"{count} of {len(common)} records can be compared, at least {needed(len(common))} are needed"
        return unjudged(name, why, count), NAN
    values = in_variances(difference, bound)
    # Four times the squares of a perfect estimator: the greatest mean, with the spread that it has then.
    _, high = limits_of_mean([GREATEST_DIFFERENCE * null], [count], evidence.false_alarm, low=False)
    squares = np.mean(np.abs(difference) ** 2, axis=(1, 2, 3))
    relative = np.sqrt(squares / np.mean(np.abs(truth.response) ** 2))
    # Responses that are equal to the last bit agree to 16 digits.
    digits = float(np.median(-np.log10(np.maximum(relative, 1e-16))))
    # an estimator that need not be efficient may differ by more than two efficient ones do
    theory = expectation(evidence.estimator, name, "efficiency")
    interval, limits = interval_of_positive_mean(values), (0.0, SLACK * high)
    return Part.judged(name, float(np.mean(values)), 0.0, interval, limits, theory, count), digits


def _plausible(name: str, truth: CramerRaoBound, second: Mapping[Trial, ComplexArray]) -> dict[Trial, ComplexArray]:
    """Responses of the second implementation that are not implausibly far from the truth."""
    shape = truth.response.shape
    of_problem = {trial: response for trial, response in second.items() if trial.problem == name}
    of_problem = {trial: response for trial, response in of_problem.items() if response.shape == shape}
    if not of_problem:
        return {}
    null = null_distribution(name, None, variance_ratio, 1.0)
    _, limit = limits_of_mean([null], [1], IMPLAUSIBLE, low=False)
    values = in_variances(np.array(list(of_problem.values())) - truth.response, truth)
    pairs = zip(of_problem.items(), values, strict=True)
    return {trial: response for (trial, response), value in pairs if value <= limit}
