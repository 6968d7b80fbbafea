"""Metrics of parts, the verdict of all metrics, and the list of metrics; reliability and speed."""

import math
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import FALSE_ALARM, Evidence, Metric, Part, all_pass, excess, unjudged
from scenarios.bench.metrics import ALL_METRICS, FAILURES, MODEL_METRICS, SLOW, Reliability, Speed, false_alarm_of_each
from scenarios.bench.verify import BenchPlan
from scenarios.estimators.outcome import KINDS, MODEL
from scenarios.problems.trial import Trial
from tests.scenarios.bench.judging import ANYONE, evaluated, parts_of, without_model

INF, NAN = math.inf, math.nan


def part(label, value, limits=(0.0, 2.0), *, theory=True):
    passed = limits[0] <= value <= limits[1]
    return Part(label, value, 1.0, (value, value), limits, passed, theory, f"because of {label}")


GOOD, BAD, EXCUSED = part("a", 1.0), part("b", 2.5), part("c", 99.0, theory=False)


@pytest.mark.parametrize(
    ("parts", "value", "passed", "why"),
    [
        # the value is that of the part furthest from what is expected
        ((part("a", 1.5), part("b", 1.9, (0.0, 10.0)), part("c", 0.2)), 0.2, True, "the reason"),
        # a part that fails against theory fails the metric, one that theory expects to fail does not
        ((GOOD, BAD), 2.5, False, "the reason"),
        ((GOOD, BAD, EXCUSED), 2.5, False, "the reason; because of c"),
        ((GOOD, EXCUSED), 99.0, True, "the reason; because of c"),
        ((EXCUSED,), 99.0, None, "the reason; because of c"),
        ((unjudged("a", "it was refused"), unjudged("b", "it was refused")), NAN, None, "the reason; it was refused"),
    ],
)
def test_metrics_of_parts(parts, value, passed, why):
    metric = Speed().of_parts(parts, 0.001, "the reason")
    assert metric.value == pytest.approx(value, abs=0.0, nan_ok=True)
    assert (metric.passed, metric.why) == (passed, why)


@pytest.mark.parametrize(
    ("value", "limits", "distance"),
    [
        (2.0, (0.0, 2.0), 1.0),
        (0.5, (0.0, 9.0), 0.5),
        (5.0, (-INF, INF), 0.0),
        # beyond a limit that is the expected value
        (0.2, (1.0, INF), 1.8),
        (3.0, (1.0, INF), 0.0),
        (NAN, (0.0, 2.0), INF),
    ],
)
def test_excess(value, limits, distance):
    one = part("a", value, limits)
    assert excess(one) == pytest.approx(distance)
    assert excess(replace(one, passed=None)) == (distance if value == value else 0.0)


def judged(name, passed, value=1.0, part=None):
    parts = () if part is None else (Part("p3", 2.0, 1.0, (NAN, NAN), (0.0, 1.5), part, theory=False),)
    return Metric(name, name, "", value, 1.0, (NAN, NAN), passed, 0.0, "", parts)


@pytest.mark.parametrize(
    ("metrics", "passes"),
    [
        ((judged("bias", True), judged("coverage", None)), True),
        ((judged("bias", True), judged("coverage", False)), False),
        ((judged("bias", None), judged("coverage", None), judged("reliability", True), judged("speed", True)), False),
        ((judged("bias", None), judged("reliability", None)), False),
        ((judged("efficiency", None, part=False),), True),
        ((judged("speed", True),), True),
        ((judged("bandwidth", None),), True),
        ((judged("bandwidth", None, NAN), judged("reliability", None, NAN)), False),
        ((), False),
    ],
)
def test_whether_all_pass(metrics, passes):
    assert all_pass({one.name: one for one in metrics}) is passes


def test_names_differ_and_false_alarms_add_up():
    names = [definition.name for definition in ALL_METRICS]
    assert len(names) == len(set(names))
    assert names[-2:] == ["reliability", "speed"]
    assert false_alarm_of_each() * sum(definition.verdicts for definition in ALL_METRICS) == pytest.approx(FALSE_ALARM)


def test_each_trial_is_run_once():
    trials = BenchPlan((ANYONE,), effort="quick").trials(ANYONE)
    for listed in (trials, Reliability(MODEL_METRICS).trials("quick")):
        assert len(listed) == len(set(listed))
        assert set(listed) == {trial for definition in MODEL_METRICS for trial in definition.trials("quick")}
    assert (
        len(trials) > len({trial.problem for trial in trials}) == len(list(groupby(trial.problem for trial in trials)))
    )


@pytest.mark.parametrize("kind", [None, *(kind for kind in KINDS if kind != MODEL)])
def test_every_metric_copes_with_nothing_but_failures_and_with_nothing(kind):
    for definition in ALL_METRICS:
        data = [Measurement(trial, kind, "so it is") for trial in definition.trials("quick") if kind]
        metric = definition.evaluate(Evidence(data, ANYONE, false_alarm_of_each()))
        failed = definition.name == "reliability" and kind not in (None, "refused")
        assert metric.name == definition.name
        assert metric.passed is (False if failed else None), definition.name
        assert math.isnan(metric.value) is not failed


ANSWERED = [Measurement(Trial("p3", draw), "model") for draw in range(50)]


def reliability(data, estimator=ANYONE):
    return evaluated(Reliability(), data, estimator)


def test_no_failure_passes():
    metric = reliability(ANSWERED)
    assert (metric.passed, metric.value) == (True, 0.0)
    assert metric.interval == (0.0, pytest.approx(7.112, abs=1e-3))
    assert [part.label for part in metric.parts] == list(FAILURES)


@pytest.mark.parametrize("kind", FAILURES)
def test_a_single_failure_of_any_kind_fails(kind):
    metric = reliability(without_model(ANSWERED, lambda m: m.trial.draw == 0, kind))
    assert (metric.passed, metric.value) == (False, pytest.approx(2.0))
    assert {part.label: part.value for part in metric.parts if part.value > 0.0} == {kind: pytest.approx(2.0)}
    assert metric.curves["reasons"] == {f"{kind}: so it is": 1}
    assert metric.curves["problems"] == {"p3": 1}


def test_refusals_do_not_count():
    refused = [Measurement(Trial("p4", draw), "refused", "no such structure") for draw in range(10)]
    metric = reliability([*ANSWERED, *refused])
    assert metric.passed
    assert metric.parts[0].draws == 50
    assert "10 more were refused" in metric.why
    for data in (refused, []):
        nothing = reliability(data)
        assert nothing.passed is None
        assert "no request was answered" in nothing.why


def test_refusing_some_records_of_a_problem_is_a_failure():
    choices = [Measurement(Trial("p3", draw, "select"), "refused", "no choice of orders") for draw in range(10)]
    metric = reliability(without_model(ANSWERED, lambda m: m.trial.draw < 30, "refused") + choices)
    assert (metric.passed, metric.value) == (False, pytest.approx(60.0))
    assert "10 more were refused" in metric.why
    assert parts_of(metric)["refused"].passed is False


def test_theory_allows_some_unstable_models_of_methods_without_a_guarantee():
    subspace = replace(ANYONE, method="subspace")
    some, most = (without_model(ANSWERED, lambda m, n=n: m.trial.draw < n, "unstable") for n in (5, 26))
    metric = reliability(some, subspace)
    assert (metric.passed, metric.value) == (True, pytest.approx(10.0))
    assert "[Maciejowski1995]" in metric.why
    assert [(part.label, part.theory) for part in metric.parts if part.passed is False] == [("unstable", False)]
    crash = [replace(ANSWERED[0], kind="crash"), *some[1:]]
    for data, estimator in ((some, ANYONE), (most, subspace), (crash, subspace)):
        assert reliability(data, estimator).passed is False


def timed(multiple, reference=0.002):
    spread = np.random.default_rng(1).lognormal(0.0, 0.3, 50)
    times = multiple * reference * spread / np.median(spread)
    trials = [Trial("p3" if n < 25 else "p4", n % 25) for n in range(50)]
    return [
        Measurement(trial, "model", seconds=one, ruler_seconds=reference, peak_bytes=2**20 * n)
        for n, (trial, one) in enumerate(zip(trials, times, strict=True))
    ]


@pytest.mark.parametrize("reference", [0.0005, 0.01])
def test_times_are_multiples_of_the_reference(reference):
    metric = evaluated(Speed(), timed(20.0, reference))
    assert (metric.passed, metric.value) == (True, pytest.approx(20.0))
    assert metric.interval[0] < 20.0 < metric.interval[1]
    assert metric.curves["percentile_95"] == pytest.approx(20.0 * np.exp(0.3 * 1.645), rel=0.15)
    assert metric.curves["peak_bytes"] == 49 * 2**20
    assert [part.label for part in metric.parts] == ["all", "p3", "p4"]


def test_slow_fails_failures_and_unknown_times_are_not_timed():
    assert evaluated(Speed(), timed(1.01 * SLOW)).passed is False
    assert evaluated(Speed(), timed(0.99 * SLOW)).passed is True
    own = timed(20.0)
    hanging = [replace(m, kind="hang", seconds=1e6) if n % 3 == 0 else m for n, m in enumerate(own)]
    assert evaluated(Speed(), hanging).passed
    unknown = [replace(m, seconds=float("nan")) for m in own]
    metric = evaluated(Speed(), unknown)
    assert metric.passed is None and np.isnan(metric.value) and "0 of 50" in metric.why
    assert evaluated(Speed(), [*own, *unknown[:20]]).passed
