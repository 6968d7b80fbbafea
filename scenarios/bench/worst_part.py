"""A figure from its parts: the verdict of all, the number of the worst."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarios.bench.metric import Figure, Part

NAN = float("nan")


def unjudged(label: str, why: str, draws: int = 0) -> Part:
    """A part of which nothing is known, and why."""
    return Part(label, NAN, NAN, (NAN, NAN), (-np.inf, np.inf), None, why=why, draws=draws)


def figure_of_parts(
    name: str,
    title: str,
    unit: str,
    parts: Sequence[Part],
    false_alarm: float,
    why: str,
    curves: Mapping[str, Any] | None = None,
) -> Figure:
    """Put parts together.

    The figure fails where a part fails that theory expects to pass, and has no verdict where theory expects no judged
    part to pass. What theory says of parts that fail is told. The number is that of the part that `worst_of` finds.

    Args:
        name: Key in results.
        title: In words.
        unit: Of the value.
        parts: At least one.
        false_alarm: Probability that a perfect estimator fails it.
        why: What the verdict rests on.
        curves: For drawing.
    """
    fair = [part for part in parts if part.passed is not None and part.theory]
    worst = worst_of(parts)
    reasons = [part.why for part in parts if part.passed is False and not part.theory and part.why]
    if not fair:
        reasons += [part.why for part in parts if part.passed is None and part.why]
    return Figure(
        name=name,
        title=title,
        unit=unit,
        value=worst.value,
        expected=worst.expected,
        interval=worst.interval,
        passed=not any(part.surprises for part in parts) if fair else None,
        false_alarm=false_alarm,
        why="; ".join(dict.fromkeys((why, *reasons))),
        parts=tuple(parts),
        curves={} if curves is None else curves,
    )


def worst_of(parts: Sequence[Part]) -> Part:
    """The part that a figure's number is of: the one furthest beyond its limits of those that decide.

    Where parts fail that theory expects to pass, one of them, so that a figure that fails has the number that fails it;
    else one of those that theory expects to fail; where all pass, the one nearest to its limits.

    Args:
        parts: At least one; where none is judged it is the first that has a value.
    """
    judged = [part for part in parts if part.surprises] or [part for part in parts if part.passed is not None]
    if judged:
        return max(judged, key=lambda part: (part.passed is False, excess(part)))
    return next((part for part in parts if np.isfinite(part.value)), parts[0])


def excess(part: Part) -> float:
    """Where the value lies: 0 as expected, 1 at a limit, more beyond it; 0 of a value that is not judged.

    Where a limit is itself what is expected there is no way to it: what lies beyond is told in units of the limit.
    """
    if part.passed is not None and np.isnan(part.value):
        return float("inf")
    where = 0.0
    for limit, beyond in ((part.limits[0], -1.0), (part.limits[1], 1.0)):
        way = limit - part.expected
        if not np.isfinite(way):
            continue
        if way != 0.0:
            where = max(where, (part.value - part.expected) / way)
        elif (part.value - limit) * beyond > 0.0:
            where = max(where, 1.0 + abs(part.value - limit) / (abs(limit) or 1.0))
    return float(where)
