"""A figure is as good as its worst part."""

import math

import pytest

from scenarios.bench.metric import Metric, MetricDefinition, Part, excess, unjudged

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


def figure(*parts: Part) -> Metric:
    return Some().of_parts(parts, 0.001, "the reason")


def test_the_value_is_that_of_the_part_furthest_from_what_is_expected() -> None:
    found = figure(part("a", 1.5), part("b", 1.9, (0.0, 10.0)), part("c", 0.2))
    assert (found.value, found.passed) == (0.2, True)
    assert found.why == "the reason"


def test_a_part_that_fails_against_theory_fails_the_figure() -> None:
    found = figure(part("a", 1.0), part("b", 2.5))
    assert (found.value, found.passed) == (2.5, False)
    found = figure(part("a", 1.0), part("b", 2.5), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (2.5, False)
    assert found.why == "the reason; because of c"


def test_a_part_that_theory_expects_to_fail_does_not() -> None:
    found = figure(part("a", 1.0), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (99.0, True)
    assert "because of c" in found.why


def test_no_verdict() -> None:
    assert figure(part("c", 99.0, theory=False)).passed is None
    assert figure(part("c", 99.0, theory=False)).value == 99.0
    nothing = figure(unjudged("a", "it was refused"), unjudged("b", "it was refused"))
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
