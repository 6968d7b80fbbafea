"""A figure from its parts: the verdict of all, the number of the worst."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarios.bench_figures.figure import Figure, Part

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
    part to pass. What theory says of parts that fail is told.

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
    if fair:
        worst = max(fair, key=lambda part: (part.surprises, excess(part)))
    else:
        known = [part for part in parts if np.isfinite(part.value)]
        worst = max(known, key=excess) if known else parts[0]
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


def excess(part: Part) -> float:
    """Where the value lies: 0 as expected, 1 at a limit, more beyond it; 0 of a value that is not judged."""
    low, high = part.limits
    where = 0.0
    for limit in (low, high):
        way = limit - part.expected
        if np.isfinite(way) and way != 0.0:
            where = max(where, (part.value - part.expected) / way)
    outside = np.isfinite(part.value) and not low <= part.value <= high
    return max(where, 1.0 + 1e-9) if outside else where
