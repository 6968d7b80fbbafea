"""All 13 metrics of the test bench: eleven of models, and two over every trial, reliability and speed."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from scenarios.bench.accuracy import Agreement, Efficiency
from scenarios.bench.amplitude_split import AmplitudeSplit
from scenarios.bench.bandwidth import BandwidthMetric
from scenarios.bench.bias import Bias
from scenarios.bench.claimed_accuracy import Coverage, NormalisedError, ResponseError
from scenarios.bench.consistency import Consistency, NoiseFreeRecovery
from scenarios.bench.metric import FALSE_ALARM, NAN, Evidence, Metric, MetricDefinition, Part, unjudged
from scenarios.bench.tests_and_orders import ResidualTestsAndOrders
from scenarios.bench.theory import LIMITATIONS, Expectation
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.errors import ScenarioError, unknown
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray
from sysid.validation.monte_carlo import exact_interval_of_share

FAILURES = tuple(kind for kind in KINDS if kind not in (MODEL, REFUSED))
UNSTABLE = "unstable"
REASONS = 20
"""Reasons that are counted, the most frequent ones."""

SLOW = 1200.0
"""Median multiple beyond which an estimator is slow.

A search takes about one such problem for each of its steps, some tens of them; this leaves a factor of twenty or more
for several starts and for interpreted code.
"""


@dataclass(frozen=True)
class OverAllTrials(MetricDefinition):
    """A metric over the trials of other metrics.

    Attributes:
        others: The other metrics.
    """

    others: tuple[MetricDefinition, ...] = ()

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Trials of all other metrics, each once, in the order of the metrics."""
        trials = chain.from_iterable(metric.trials(effort) for metric in self.others)
        return tuple(dict.fromkeys(trials))


class Reliability(OverAllTrials):
    """Share of failures among all requests that were not refused.

    A single one fails: a perfect estimator has none, so that chance raises no false alarm. An estimator that refuses a
    kind of request must refuse it on every record: refusing some records of a problem and answering others is a failure
    too, or else it could select what it is judged by. Methods without any guarantee of stability may give unstable
    models, as theory says, where most requests still end with a model.
    """

    name = "reliability"
    title = "Failures"
    unit = "%"

    def evaluate(self, evidence: Evidence) -> Metric:
        """Count the failures, by kind."""
        requests = [(m, (m.trial.problem, m.trial.ask)) for m in evidence.measurements]
        answered = {request for m, request in requests if m.kind != REFUSED}
        counted = [m for m, request in requests if request in answered]
        failed = [m for m in counted if m.kind != MODEL]
        kinds, total, refused = Counter(m.kind for m in counted), len(counted), len(requests) - len(counted)
        theory = {failure: Expectation(True, KINDS[failure]) for failure in FAILURES}
        no_guarantee = LIMITATIONS.get(f"{UNSTABLE}_{evidence.estimator.method}")
        if no_guarantee is not None and 2 * kinds[MODEL] >= total:
            theory[UNSTABLE] = Expectation(False, no_guarantee.why)
        if kinds[REFUSED]:
            theory[REFUSED] = Expectation(True, "refused on some records of a problem and answered on others")
        metric_parts = []
        if total:
            for failure, expected in theory.items():
                percent, interval = _percent(kinds[failure], total), _interval(kinds[failure], total)
                metric_parts.append(Part.judged(failure, percent, 0.0, interval, (0.0, 0.0), expected, total))
        why = f"{len(failed)} of {total} requests failed"
        if refused:
            why += f"; {refused} more were refused, which is no failure"
        reasons: Counter[str] = Counter()
        for m in failed:
            reason = f"{m.kind}: {m.why}" if m.why else m.kind
            reasons[reason] += 1
        curves = {
            "reasons": dict(reasons.most_common(REASONS)),
            "problems": dict(Counter(m.trial.problem for m in failed).most_common()),
            "refused": refused,
        }
        share = _percent(len(failed), total), 0.0, _interval(len(failed), total)
        shown = unjudged("all", "no verdict: no request was answered", total, *share)
        return self.of_parts(metric_parts or [shown], 0.0, why, curves, shown=shown)


def _interval(count: int, total: int) -> tuple[float, float]:
    return exact_interval_of_share(count, total, 100.0)


def _percent(count: int, total: int) -> float:
    return 100.0 * count / total if total else NAN


class Speed(OverAllTrials):
    """Processor time of estimates that ended with a model, in units of a reference time.

    The reference is the processor time of a fixed least-squares problem on the same record in the same run, so that
    neither the machine nor the length of the records matters much. The verdict is on the median, which chance hardly
    turns.
    """

    name = "speed"
    title = "Time of an estimate"
    unit = "times the reference time"

    def evaluate(self, evidence: Evidence) -> Metric:
        """Median and 95th percentile of the multiples, memory beside them."""
        answered = [m for m in evidence.measurements if m.kind == MODEL]
        timed = [m for m in answered if m.seconds >= 0.0 and m.ruler_seconds > 0.0]
        memory = max((m.peak_bytes for m in answered), default=0)
        curves = {"percentile_95": NAN, "ruler_seconds": NAN, "peak_bytes": memory}
        # A median of fewer than half of the answers is not that of the estimator.
        if not timed or 2 * len(timed) < len(answered):
            why = f"the time of {len(timed)} of {len(answered)} answers is known: no verdict"
            return self.of_parts([unjudged("all", why, len(timed))], 0.0, why, curves)
        multiples = np.array([m.seconds / m.ruler_seconds for m in timed])
        problems = [m.trial.problem for m in timed]
        median = float(np.median(multiples))
        interval = _interval_of_median(multiples)
        metric_parts = [Part.judged("all", median, NAN, interval, (-np.inf, SLOW), Expectation(True), len(timed))]
        of_all = "not judged: the verdict is on the median of all"
        for name in sorted(set(problems)):
            on_problem = multiples[[problem == name for problem in problems]]
            interval = _interval_of_median(on_problem)
            metric_parts.append(unjudged(name, of_all, len(on_problem), float(np.median(on_problem)), NAN, interval))
        # Not judged: the time of a few hard records.
        curves["percentile_95"] = float(np.percentile(multiples, 95.0))
        curves["ruler_seconds"] = float(np.median([m.ruler_seconds for m in timed]))
        milliseconds = 1000.0 * float(np.median([m.seconds for m in timed]))
        why = (
            f"{milliseconds:.3g} ms in the median on this machine; slow beyond {SLOW:g} times the reference time; "
            f"largest memory {memory / 2**20:.0f} MiB"
        )
        return self.of_parts(metric_parts, 0.0, why, curves)


def _interval_of_median(values: FloatArray) -> tuple[float, float]:
    """Order statistics about the median by the normal approximation of their ranks."""
    ordered = np.sort(values)
    # 1.96 deviations of a binomial count of one half.
    half = 0.98 * np.sqrt(len(ordered))
    low = max(0, int(np.floor(len(ordered) / 2 - half)))
    high = min(len(ordered) - 1, int(np.ceil(len(ordered) / 2 + half)))
    return (float(ordered[low]), float(ordered[high]))


MODEL_METRICS: tuple[MetricDefinition, ...] = (
    NoiseFreeRecovery(),
    Consistency(),
    Efficiency(),
    Coverage(),
    NormalisedError(),
    ResponseError(),
    AmplitudeSplit(),
    Bias(),
    ResidualTestsAndOrders(),
    Agreement(),
    BandwidthMetric(),
)
"""Metrics of models: ten with a verdict, and the recovered bandwidth, which is only shown."""

ALL_METRICS: tuple[MetricDefinition, ...] = (*MODEL_METRICS, Reliability(MODEL_METRICS), Speed(MODEL_METRICS))
"""In the order in which they are reported."""


def false_alarm_of_each() -> float:
    """Allowed probability of a false alarm of each verdict, so that of any in a run is at most `FALSE_ALARM`."""
    return FALSE_ALARM / max(1, sum(metric.verdicts for metric in ALL_METRICS))


def metrics_named(names: Sequence[str]) -> tuple[MetricDefinition, ...]:
    """Metrics by name, in their usual order; reliability and speed cover the trials of the chosen others, if any.

    Args:
        names: Empty for all.

    Raises:
        ScenarioError: There is no metric of a name.
    """
    all_names = {metric.name: metric for metric in ALL_METRICS}
    for name in names:
        if name not in all_names:
            raise ScenarioError(unknown("figure", name, all_names))
    if not names:
        return ALL_METRICS
    chosen = tuple(m for m in ALL_METRICS if m.name in names and not isinstance(m, OverAllTrials))
    # Alone they are over the trials of all metrics.
    over_all = [metric(chosen or MODEL_METRICS) for metric in (Reliability, Speed) if metric.name in names]
    return (*chosen, *over_all)
