"""All metrics of the test bench, with the two over every trial: reliability and speed."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenarios.bench.accuracy import Agreement, Efficiency
from scenarios.bench.amplitude_split import AmplitudeSplit
from scenarios.bench.bandwidth import BandwidthMetric
from scenarios.bench.bias import Bias
from scenarios.bench.claims import Coverage, NormalisedError, ResponseError
from scenarios.bench.consistency import Consistency, NoiseFreeRecovery
from scenarios.bench.measurement import Measurements
from scenarios.bench.metric import (
    FALSE_ALARM,
    NAN,
    UNLIMITED,
    Metric,
    MetricDefinition,
    Part,
    union_of_trials,
)
from scenarios.bench.statistics import interval_of_percentage
from scenarios.bench.tests_and_orders import ResidualTestsAndOrders
from scenarios.bench.theory import UNSTABLE_MODELS
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import KINDS, MODEL, REFUSED
from scenarios.files.errors import ScenarioError, unknown
from scenarios.problems.trial import Trial
from sysid.records.arrays import FloatArray

FAILURES = tuple(kind for kind in KINDS if kind not in (MODEL, REFUSED))
UNSTABLE = "unstable"
SOME_REFUSED = "refused on some records of a problem and answered on others"

REASONS = 20
"""Reasons that are counted, the most frequent ones."""

SLOW = 1200.0
"""Median multiple beyond which an estimator is slow.

A search takes about one such problem for each of its steps, some tens of them; this leaves a factor of twenty or more
for several starts and for interpreted code.
"""

MIB = 2.0**20


@dataclass(frozen=True)
class Reliability(MetricDefinition):
    """Share of failures among all requests that were not refused.

    A single one fails: a perfect estimator has none, so that chance raises no false alarm. An estimator that refuses a
    kind of request must refuse it on every record: refusing some records of a problem and answering others is a failure
    too, or else it could select what it is judged by. Methods without any guarantee of stability may give unstable
    models, as theory says, where most requests still end with a model.

    Attributes:
        others: The metrics whose trials are counted.
    """

    others: tuple[MetricDefinition, ...] = ()
    name = "reliability"
    title = "Failures"
    unit = "%"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Those of all other metrics, each once."""
        return union_of_trials(self.others, effort)

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Count the failures, by kind."""
        answered = {(m.trial.problem, m.trial.ask) for m in measurements if m.kind != REFUSED}
        counted = [m for m in measurements if (m.trial.problem, m.trial.ask) in answered]
        kinds = Counter(m.kind for m in counted)
        failed = [m for m in counted if m.kind != MODEL]
        total = len(counted)
        refused = len(measurements) - total
        no_guarantee = UNSTABLE_MODELS.get(estimator.method or "", "")
        expected = bool(no_guarantee) and 2 * kinds[MODEL] >= total
        unexpected = len(failed) - (kinds[UNSTABLE] if expected else 0)
        parts = tuple(
            Part(
                label=kind,
                value=_percent(kinds[kind], total),
                expected=0.0,
                interval=interval_of_percentage(kinds[kind], total),
                limits=(0.0, 0.0),
                passed=kinds[kind] == 0 if total else None,
                theory=not (expected and kind == UNSTABLE),
                why=SOME_REFUSED if kind == REFUSED else KINDS.get(kind, ""),
                draws=total,
            )
            for kind in (*FAILURES, *[REFUSED] * (kinds[REFUSED] > 0))
        )
        why = [f"{len(failed)} of {total} requests failed" if total else "no request was answered"]
        if refused:
            why.append(f"{refused} more were refused, which is no failure")
        if expected and kinds[UNSTABLE]:
            why.append(no_guarantee)
        reasons = Counter(f"{m.kind}: {m.why}" if m.why else m.kind for m in failed)
        curves = {
            "reasons": dict(reasons.most_common(REASONS)),
            "problems": dict(Counter(m.trial.problem for m in failed).most_common()),
            "refused": refused,
        }
        return replace(
            self.of_parts(parts, 0.0, "", curves),
            value=_percent(len(failed), total),
            interval=interval_of_percentage(len(failed), total),
            passed=not unexpected if total else None,
            why="; ".join(why),
        )


def _percent(count: int, total: int) -> float:
    return 100.0 * count / total if total else NAN


@dataclass(frozen=True)
class Speed(MetricDefinition):
    """Processor time of estimates that ended with a model, in units of a reference time.

    The reference is the processor time of a fixed least-squares problem on the same record in the same run, so that
    neither the machine nor the length of the records matters much. The verdict is on the median, which chance hardly
    turns.

    Attributes:
        others: The metrics whose trials are timed.
    """

    others: tuple[MetricDefinition, ...] = ()
    name = "speed"
    title = "Time of an estimate"
    unit = "rulers"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Those of all other metrics, each once."""
        return union_of_trials(self.others, effort)

    def evaluate(
        self, measurements: Measurements, estimator: Estimator, false_alarm: float, reference: Measurements
    ) -> Metric:
        """Median and 95th percentile of the multiples, memory beside them."""
        answered = [m for m in measurements if m.kind == MODEL]
        timed = [m for m in answered if m.seconds >= 0.0 and m.ruler_seconds > 0.0]
        multiples = np.array([m.seconds / m.ruler_seconds for m in timed])
        enough = len(timed) > 0 and 2 * len(timed) >= len(answered)
        memory = max((m.peak_bytes for m in answered), default=0)
        if enough:
            seconds = np.array([m.seconds for m in timed])
            why = (
                f"{1000.0 * float(np.median(seconds)):.3g} ms in the median here; called slow beyond {SLOW:g} rulers; "
                f"the most memory {memory / MIB:.0f} MiB"
            )
        else:
            why = f"the time of {len(timed)} of {len(answered)} answers is known: no verdict"
        by_problem: dict[str, list[float]] = {}
        for m, multiple in sorted(zip(timed, multiples, strict=True), key=lambda pair: pair[0].trial.problem):
            by_problem.setdefault(m.trial.problem, []).append(multiple)
        parts = [_time_part(name, np.array(values)) for name, values in by_problem.items()] if enough else []
        curves = {
            "percentile_95": float(np.percentile(multiples, 95.0)) if enough else NAN,
            "ruler_seconds": float(np.median([m.ruler_seconds for m in timed])) if enough else NAN,
            "peak_bytes": memory,
        }
        median = float(np.median(multiples)) if enough else NAN
        return Metric(
            self.name,
            self.title,
            self.unit,
            value=median,
            expected=NAN,
            interval=_interval_of_median(multiples) if enough else (NAN, NAN),
            passed=median <= SLOW if enough else None,
            false_alarm=0.0,
            why=why,
            parts=tuple(parts),
            curves=curves,
        )


def _time_part(name: str, multiples: FloatArray) -> Part:
    return Part(
        label=name,
        value=float(np.median(multiples)),
        expected=NAN,
        interval=_interval_of_median(multiples),
        limits=UNLIMITED,
        passed=None,
        why="not judged: the verdict is on the median of all",
        draws=len(multiples),
    )


def _interval_of_median(values: FloatArray) -> tuple[float, float]:
    """Order statistics about the median by the normal approximation of their ranks."""
    ordered = np.sort(values)
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
"""Metrics of models: ten with a verdict, and the recovered bandwidth, which has none."""

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
    known = {metric.name: metric for metric in ALL_METRICS}
    for name in names:
        if name not in known:
            raise ScenarioError(unknown("figure", name, known))
    if not names:
        return ALL_METRICS
    chosen = tuple(m for m in ALL_METRICS if m.name in names and not isinstance(m, Reliability | Speed))
    over_all = [kind(chosen or MODEL_METRICS) for kind in (Reliability, Speed) if kind.name in names]
    return (*chosen, *over_all)
