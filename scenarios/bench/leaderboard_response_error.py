"""One number for the error of the response that compares: of every row over the same problems."""

from collections.abc import Collection, Iterable, Sequence
from math import inf, nan

import numpy as np

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_response_drawing import NAME, relative_errors
from scenarios.bench.leaderboard_table import UNKNOWN, Cell, number_cell
from scenarios.files.printable import one_line

MOST_NAMED = 6
"""Problems that are named in a sentence; more are counted."""


def compared(entries: Sequence[Entry]) -> tuple[str, ...]:
    """Problems by whose errors rows are compared: those that all rows with this figure were asked.

    What was asked counts, not what was answered: one that answers only what is easy neither gets the better number for
    it, nor takes what is hard away from the others.
    """
    known = {name for entry in entries for name in relative_errors(entry)}
    asked = [found for entry in entries if (found := _asked(entry, known))]
    return tuple(name for name in asked[0] if all(name in found for found in asked)) if asked else ()


def answered(entry: Entry) -> dict[str, float]:
    """Errors by problem, percent, where the estimator gave models of at least half of the records, and of two."""
    efficiency = entry.figure("efficiency")
    # Without a verdict though there are values: of too few records.
    few = {part.label for part in efficiency.parts if part.passed is None and part.draws} if efficiency else set()
    return {name: error for name, error in relative_errors(entry).items() if name not in few}


def missing(entry: Entry, problems: Iterable[str]) -> tuple[str, ...]:
    """Those of the problems that it did not answer; none of a row without this figure."""
    there = answered(entry)
    return tuple(name for name in problems if name not in there) if entry.figure(NAME) else ()


def median_error(entry: Entry, problems: Sequence[str]) -> float:
    """The median over the problems, percent; NaN where it did not answer all of them."""
    errors = answered(entry)
    return float(np.median([errors.get(name, nan) for name in problems])) if problems else nan


def median_cell(entry: Entry, problems: Sequence[str]) -> Cell:
    """The median over the problems; how many of them it answered, where it did not answer all."""
    absent = missing(entry, problems)
    if 0 < len(absent) < len(problems):
        why = f"too few models on {', '.join(map(one_line, absent))}"
        return Cell(f"{UNKNOWN} ({len(problems) - len(absent)} of {len(problems)})", inf, told=why)
    return number_cell(median_error(entry, problems)) if entry.figure(NAME) else Cell("", inf)


def told(problems: Sequence[str]) -> str:
    """Problems in a sentence."""
    return ", ".join(map(one_line, problems)) if len(problems) <= MOST_NAMED else f"{len(problems)} of them"


def _asked(entry: Entry, known: Collection[str]) -> tuple[str, ...]:
    """Which of the problems it was asked, in their order: what was not answered is a part without a value."""
    figure = entry.figure(NAME)
    labels = [part.label for part in figure.parts] if figure else []
    return tuple(dict.fromkeys(name for name in (*labels, *relative_errors(entry)) if name in known))
