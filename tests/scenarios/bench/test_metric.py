"""Metrics of parts, the verdict of all metrics, and the list of metrics."""

import itertools
import math

import pytest

from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import FALSE_ALARM, Metric, MetricDefinition, Part, all_pass, excess, unjudged
from scenarios.bench.metrics import ALL_METRICS, MODEL_METRICS, false_alarm_of_each
from scenarios.bench.verify import BenchPlan
from scenarios.estimators.estimator import Estimator
from scenarios.estimators.outcome import KINDS, MODEL

INF = float("inf")


def part(
    label: str, value: float, limits: tuple[float, float] = (0.0, 2.0), *, judged: bool = True, theory: bool = True
) -> Part:
    passed = limits[0] <= value <= limits[1] if judged else None
    return Part(label, value, 1.0, (value, value), limits, passed, theory, f"because of {label}")


class Some(MetricDefinition):
    name, title = "name", "Title"

    def trials(self, effort):
        return ()

    def evaluate(self, measurements, estimator, false_alarm, reference):
        raise NotImplementedError


def metric(*parts: Part) -> Metric:
    return Some().of_parts(parts, 0.001, "the reason")


def test_the_value_is_that_of_the_part_furthest_from_what_is_expected() -> None:
    found = metric(part("a", 1.5), part("b", 1.9, (0.0, 10.0)), part("c", 0.2))
    assert (found.value, found.passed) == (0.2, True)
    assert found.why == "the reason"


def test_a_part_that_fails_against_theory_fails_the_figure() -> None:
    found = metric(part("a", 1.0), part("b", 2.5))
    assert (found.value, found.passed) == (2.5, False)
    found = metric(part("a", 1.0), part("b", 2.5), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (2.5, False)
    assert found.why == "the reason; because of c"


def test_a_part_that_theory_expects_to_fail_does_not() -> None:
    found = metric(part("a", 1.0), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (99.0, True)
    assert "because of c" in found.why


def test_no_verdict() -> None:
    assert metric(part("c", 99.0, theory=False)).passed is None
    assert metric(part("c", 99.0, theory=False)).value == 99.0
    nothing = metric(unjudged("a", "it was refused"), unjudged("b", "it was refused"))
    assert nothing.passed is None
    assert math.isnan(nothing.value)
    assert nothing.why == "the reason; it was refused"


@pytest.mark.parametrize(
    ("value", "limits", "where"),
    [(1.0, (0.0, 2.0), 0.0), (2.0, (0.0, 2.0), 1.0), (0.5, (0.0, 9.0), 0.5), (5.0, (-INF, INF), 0.0)],
)
def test_excess(value: float, limits: tuple[float, float], where: float) -> None:
    assert excess(part("a", value, limits)) == pytest.approx(where)


def test_excess_beyond_a_limit_that_is_what_is_expected() -> None:
    assert excess(part("a", 0.5, (1.0, INF))) == pytest.approx(1.5)
    assert excess(part("a", 0.2, (1.0, INF))) > excess(part("a", 0.5, (1.0, INF)))
    assert excess(part("a", 3.0, (1.0, INF))) == 0.0
    assert excess(part("a", float("nan"), judged=False)) == 0.0
    assert excess(part("a", float("nan"))) == INF


NAN = float("nan")


def judged(name: str, passed: bool | None, value: float = 1.0, part: bool | None = None) -> Metric:
    parts = () if part is None else (Part("p3", 2.0, 1.0, (NAN, NAN), (0.0, 1.5), part, theory=False),)
    return Metric(name, name, "", value, 1.0, (NAN, NAN), passed, 0.0, "", parts)


@pytest.mark.parametrize(
    ("figures", "passes"),
    [
        ((judged("bias", True), judged("coverage", None)), True),
        ((judged("bias", True), judged("coverage", False)), False),
        (
            (
                judged("bias", None),
                judged("coverage", None),
                judged("reliability", True),
                judged("speed", True),
            ),
            False,
        ),
        ((judged("bias", None), judged("reliability", None)), False),
        ((judged("efficiency", None, part=False),), True),
        ((judged("speed", True),), True),
        ((judged("bandwidth", None),), True),
        ((judged("bandwidth", None, NAN), judged("reliability", None, NAN)), False),
        ((), False),
    ],
)
def test_whether_all_pass(figures: tuple[Metric, ...], passes: bool) -> None:
    assert all_pass({one.name: one for one in figures}) is passes


ANYONE = Estimator("anyone", "bench:perfect")


def test_names_are_different() -> None:
    names = [definition.name for definition in ALL_METRICS]
    assert len(names) == len(set(names))
    assert names[-2:] == ["reliability", "speed"]


def test_false_alarms_add_up() -> None:
    assert false_alarm_of_each() * sum(definition.verdicts for definition in ALL_METRICS) == pytest.approx(FALSE_ALARM)


def test_trials_are_told_once() -> None:
    trials = BenchPlan((ANYONE,), effort="quick").trials(ANYONE)
    assert len(trials) == len(set(trials))
    assert set(trials) == {trial for definition in MODEL_METRICS for trial in definition.trials("quick")}
    names = [trial.problem for trial in trials]
    assert len(set(names)) == 1 + sum(one != other for one, other in itertools.pairwise(names))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != MODEL])
def test_every_figure_copes_with_nothing_but_failures(kind: str) -> None:
    for definition in ALL_METRICS:
        measured = [Measurement(trial, kind, "so it is") for trial in definition.trials("quick")]
        found = definition.evaluate(measured, ANYONE, false_alarm_of_each(), ())
        judged = definition.name == "reliability" and kind != "refused"
        assert found.name == definition.name
        assert found.passed is (False if judged else None), definition.name


def test_every_figure_copes_with_nothing() -> None:
    for definition in ALL_METRICS:
        assert definition.evaluate([], ANYONE, false_alarm_of_each(), ()).passed is None
