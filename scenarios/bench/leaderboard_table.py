"""A table as the page and the Markdown both show it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_verdict import ORDER, Verdict

UNKNOWN = "–"


@dataclass(frozen=True)
class Cell:
    """A cell.

    Attributes:
        text: What it shows.
        key: By which its column is sorted, a number; None: by the text.
        verdict: The verdict that it shows, or None.
        link: Anchor on the page, or empty.
        told: What more there is to say, shown where there is room for it.
    """

    text: str
    key: float | None = None
    verdict: Verdict | None = None
    link: str = ""
    told: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        caption: What it shows.
        columns: Headings; those of numbers are marked by `numeric`.
        rows: Its rows.
        numeric: Whether each column holds numbers.
        sortable: Whether the order of its rows means nothing.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    numeric: tuple[bool, ...]
    sortable: bool = True


def table_of_entries(caption: str, columns: Iterable[str], rows: Iterable[tuple[Entry, Iterable[Cell]]]) -> Table:
    """A table with a row for each estimator, in the order of the page."""
    headings = ("Estimator", *columns)
    cells = tuple((Cell(entry.title, float(entry.number), link=entry.mark), *found) for entry, found in rows)
    return Table(caption, headings, cells, (False, *(True for _ in headings[1:])))


def number_cell(value: float, verdict: Verdict | None = None, told: str = "") -> Cell:
    """A number; one that is not known sorts last."""
    text = "" if math.isnan(value) and verdict is Verdict.NONE else number(value)
    return Cell(text, math.inf if math.isnan(value) else value, verdict, told=told)


def verdict_cell(found: Verdict, told: str = "") -> Cell:
    """A verdict."""
    return Cell("", float(ORDER.index(found)), found, told=told)


def number(value: float) -> str:
    """A number as the page shows it: three digits, powers of ten where there are many zeros."""
    if math.isnan(value):
        return UNKNOWN
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if 1e3 <= abs(value) < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:.3g}" if value == 0 or 1e-3 <= abs(value) < 1e3 else f"{value:.1e}"


def pair(ends: tuple[float, float]) -> str:
    """An interval, or limits of which one may be open."""
    low, high = ends
    if math.isnan(low) or math.isnan(high):
        return UNKNOWN
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(low):
        return f"at most {number(high)}"
    if math.isinf(high):
        return f"at least {number(low)}"
    return f"{number(low)} to {number(high)}"
