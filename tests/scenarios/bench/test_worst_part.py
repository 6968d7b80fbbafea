"""A figure is as good as its worst part."""

import math

import pytest

from scenarios.bench.metric import Figure, Part
from scenarios.bench.worst_part import excess, figure_of_parts, unjudged

INF = float("inf")


def part(
    label: str, value: float, limits: tuple[float, float] = (0.0, 2.0), *, judged: bool = True, theory: bool = True
) -> Part:
    """One with 1 expected."""
    passed = limits[0] <= value <= limits[1] if judged else None
    return Part(label, value, 1.0, (value, value), limits, passed, theory, f"because of {label}")


def figure(*parts: Part) -> Figure:
    """Of parts."""
    return figure_of_parts("name", "Title", "unit", parts, 0.001, "the reason")


def test_the_value_is_that_of_the_part_furthest_from_what_is_expected() -> None:
    """In units of the way to its limit."""
    found = figure(part("a", 1.5), part("b", 1.9, (0.0, 10.0)), part("c", 0.2))
    assert (found.value, found.passed) == (0.2, True)
    assert found.why == "the reason"


def test_a_part_that_fails_against_theory_fails_the_figure() -> None:
    """And its number is told, not that of what was to fail, however far that is beyond its limits."""
    found = figure(part("a", 1.0), part("b", 2.5))
    assert (found.value, found.passed) == (2.5, False)
    found = figure(part("a", 1.0), part("b", 2.5), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (2.5, False)
    assert found.why == "the reason; because of c"


def test_a_part_that_theory_expects_to_fail_does_not() -> None:
    """Its reason is told."""
    found = figure(part("a", 1.0), part("c", 99.0, theory=False))
    assert (found.value, found.passed) == (99.0, True)
    assert "because of c" in found.why


def test_no_verdict() -> None:
    """Where nothing was judged, or nothing that should pass; the reasons are told."""
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
    """0 as expected, 1 at a limit."""
    assert excess(part("a", value, limits)) == pytest.approx(where)


def test_excess_beyond_a_limit_that_is_what_is_expected() -> None:
    """More than 1, though there is no way to that limit; of no number nothing."""
    assert excess(part("a", 0.5, (1.0, INF))) == pytest.approx(1.5)
    assert excess(part("a", 0.2, (1.0, INF))) > excess(part("a", 0.5, (1.0, INF)))
    assert excess(part("a", 3.0, (1.0, INF))) == 0.0
    assert excess(part("a", float("nan"), judged=False)) == 0.0
    assert excess(part("a", float("nan"))) == INF
