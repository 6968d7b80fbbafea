"""A figure's part that is a mean over records, with its verdict; and the mean over the records of several parts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarios.bench.accuracy_records import enough, needed
from scenarios.bench.interval_of_mean import interval_of_mean_share, interval_of_positive_mean
from scenarios.bench.metric import Part
from scenarios.bench.perfect_mean import limits_of_pooled_mean
from scenarios.bench.theory import Expectation
from sysid.records.arrays import FloatArray

TOGETHER = "together"
CLAIMED = 0.9
"""Least share of the records with a model of which something must be claimed, where it is of any: a matrix that is
singular to rounding now and then is no choice."""
NOWHERE = (-np.inf, np.inf)
SHARES = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Values:
    """A statistic of the records of one problem.

    Attributes:
        label: Of the part.
        values: One per record that has a value (n,).
        run: Records that were run.
        single: For many single records of a perfect estimator (M,); None: there is no bound, and so no verdict.
        theory: What theory says.
        why_not: Why there are no values, where there are none.
        models: Records with a model that should have a value if any has; 0 where none need have.
    """

    label: str
    values: FloatArray
    run: int
    single: FloatArray | None
    theory: Expectation
    why_not: str = ""
    models: int = 0

    @property
    def of_some_only(self) -> bool:
        """Whether some records with a model have a value and more than a few have none: claimed at its own choice."""
        return 0 < len(self.values) < CLAIMED * self.models and enough(self.models, self.run)


@dataclass(frozen=True)
class Judgement:
    """How a mean is judged.

    Attributes:
        expected: Mean of a perfect estimator.
        ratio: Slack as a factor on the limits.
        points: Slack as a difference.
        low: Whether there is a lower limit.
        high: Whether there is an upper one.
        shares: Whether the values are shares, from 0 to 1; otherwise they are positive.
    """

    expected: float
    ratio: float = 1.0
    points: float = 0.0
    low: bool = True
    high: bool = True
    shares: bool = False

    def limits(self, singles: Sequence[FloatArray], draws: Sequence[int], false_alarm: float) -> tuple[float, float]:
        """Limits for the mean over the records of several problems, the slack included."""
        return self.widened(*limits_of_pooled_mean(singles, draws, false_alarm, low=self.low, high=self.high))

    def widened(self, low: float, high: float) -> tuple[float, float]:
        """Limits with the slack."""
        least, most = SHARES if self.shares else NOWHERE
        return (max(low / self.ratio - self.points, least), min(high * self.ratio + self.points, most))

    def interval(self, values: FloatArray) -> tuple[float, float]:
        """The 95 % Monte-Carlo interval of the mean; NaN where it is infinite."""
        return interval_of_mean_share(values) if self.shares else interval_of_positive_mean(values)


def part_of_mean(given: Values, judgement: Judgement, false_alarm: float) -> Part:
    """The mean over the records of one problem.

    An estimator that claims something of some records, and nothing of more than a few, fails: it would choose what it
    is judged by.
    """
    count = len(given.values)
    reason = given.theory.why
    judged = False
    if given.of_some_only and given.single is not None:
        reason = f"claimed of {count} of {given.models} records with a model, expected of all of a problem or of none"
        return replace(_part(given.label, given.values, judgement, NOWHERE, False, True, reason), passed=False)
    if count == 0 and given.why_not:
        reason = given.why_not
    elif not enough(count, given.run):
        reason = f"no verdict: {count} of {given.run} records have a value, at least {needed(given.run)} are needed"
    elif given.single is None:
        reason = "no verdict: the problem has no Cramér-Rao bound"
    else:
        judged = True
    limits = NOWHERE
    if judged and given.single is not None:
        limits = judgement.limits([given.single], [count], false_alarm)
    return _part(given.label, given.values, judgement, limits, judged, given.theory.passes, reason)


def parts_together(label: str, given: Sequence[Values], judgement: Judgement, false_alarm: float) -> list[Part]:
    """The mean over the records of all problems on which theory expects the estimator to pass.

    Returns:
        The part; none where there are fewer than two such problems.
    """
    chosen = [g for g in given if g.theory.passes and g.single is not None and enough(len(g.values), g.run)]
    if len(chosen) < 2:
        return []
    singles = [g.single for g in chosen if g.single is not None]
    limits = judgement.limits(singles, [len(g.values) for g in chosen], false_alarm)
    values = np.concatenate([g.values for g in chosen])
    reason = f"all records of {', '.join(g.label.split()[0] for g in chosen)}"
    return [_part(label, values, judgement, limits, True, True, reason)]


def parts_of_means(given: Sequence[Values], judgement: Judgement, budget: float) -> list[Part]:
    """The mean of each problem and that of all together, which share the probability of a false alarm evenly.

    Args:
        given: Of each problem.
        judgement: How they are judged.
        budget: Probability of a false alarm in any of them.
    """
    share = budget / (len(given) + 1)
    return [
        *[part_of_mean(values, judgement, share) for values in given],
        *parts_together(TOGETHER, given, judgement, share),
    ]


def _part(
    label: str,
    values: FloatArray,
    judgement: Judgement,
    limits: tuple[float, float],
    judged: bool,
    theory: bool,
    why: str,
) -> Part:
    with np.errstate(over="ignore"):
        mean = float(np.mean(values)) if len(values) else float("nan")
    return Part(
        label=label,
        value=mean,
        expected=judgement.expected,
        interval=judgement.interval(values),
        limits=limits,
        passed=bool(limits[0] <= mean <= limits[1]) if judged else None,
        theory=theory,
        why=why,
        draws=len(values),
    )
