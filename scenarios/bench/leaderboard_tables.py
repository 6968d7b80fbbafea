"""The tables of the leaderboard."""

import re
from collections.abc import Sequence
from math import isnan

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_reading import FIGURES
from scenarios.bench.leaderboard_response_error import compared, median_cell, told
from scenarios.bench.leaderboard_table import Cell, Table, number_cell, pair, table_of_entries, verdict_cell
from scenarios.bench.leaderboard_verdict import Verdict, count, judged_figures, part_verdict, verdict
from scenarios.bench.metric import Metric, Part
from scenarios.estimators.outcome import KINDS
from scenarios.files.printable import one_line

MOST_COLUMNS = 8
"""Problems in the columns of a table; more stand in its rows."""

MOST_ROWS = 40
"""Problems in the rows of a table."""

AT_WORST = re.compile(r" at [\d.e+-]+ Hz$")
"""End of the label of a part at one frequency."""

HEADLINE = ("efficiency", "noise_free_recovery", "coverage", "bias", "reliability", "speed")
"""Figures whose numbers stand in the first table."""

FAILING = (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS)

COUNTED = ("Fails", "Fails as theory says", "No verdict")
"""Headings of the verdicts that are counted beside those that pass."""


def figure_names(entries: Sequence[Entry]) -> list[str]:
    """All figures that any row has, those of this version in their order, others behind."""
    there = {name for entry in entries for name in entry.result.figures}
    return [name for name in FIGURES if name in there] + sorted(there - set(FIGURES))


def title(entries: Sequence[Entry], name: str) -> str:
    """What a figure is called: by the first row that has it."""
    figures = [figure for entry in entries if (figure := entry.figure(name))]
    return one_line(figures[0].title) or one_line(name)


def unit(entries: Sequence[Entry], name: str) -> str:
    """Unit of a figure, by the first row that has it."""
    return next((one_line(figure.unit) for entry in entries if (figure := entry.figure(name))), "")


def short(name: str) -> str:
    """Heading of a figure's column."""
    return FIGURES[name].short if name in FIGURES else one_line(name).replace("_", " ")


def standing(entries: Sequence[Entry]) -> Table:
    """The first table: verdicts counted, and the numbers that most look for."""
    columns = [name for name in HEADLINE if any(entry.figure(name) for entry in entries)]
    headings = [f"{short(name)}{_in(unit(entries, name))}" for name in columns]
    judged, problems = judged_figures(entry.result for entry in entries), compared(entries)
    rows = []
    for entry in entries:
        found = count(map(entry.figure, judged))
        cells = [
            Cell(f"{found[Verdict.PASSES]} of {len(judged)}", float(found[Verdict.PASSES])),
            *(Cell(str(found[v]), float(found[v])) for v in (*FAILING, Verdict.NONE)),
            median_cell(entry, problems),
        ]
        rows.append((entry, [*cells, *(_value(entry.figure(name)) for name in columns)]))
    caption = (
        "Figures passed of all that give verdicts, and each figure’s number where it is furthest beyond its limits, or "
        "nearest to them. "
    ) + response_error_rule(problems)
    return table_of_entries(caption, ("Passed", *COUNTED, "Response error / %", *headings), rows)


def response_error_rule(problems: Sequence[str]) -> str:
    """How the response error of the first table is made."""
    if not problems:
        return "Response error: none, for no problem was asked of all rows"
    return (
        f"Response error: median over the problems that were asked of all rows ({told(problems)}); “–” where an "
        "estimator gave models of fewer than half of the records of one of them, or of one record, beside how many of "
        "the problems it answered"
    )


def verdicts(entries: Sequence[Entry]) -> Table:
    """A verdict of each figure that is ever judged."""
    judged = [
        name
        for name in figure_names(entries)
        if any(verdict(entry.figure(name)) is not Verdict.NONE for entry in entries)
    ]
    rows = [
        (
            entry,
            [verdict_cell(verdict(f := entry.figure(name)), "" if f is None else one_line(f.why)) for name in judged],
        )
        for entry in entries
    ]
    return table_of_entries(
        "The reasons stand in the sections of the estimators", [short(name) for name in judged], rows
    )


def by_part(entries: Sequence[Entry], name: str) -> Table | None:
    """A figure problem by problem, a row for each estimator, or for each problem where these are many.

    Returns:
        The table; None where the figure has no parts.
    """
    parts = [{_row(p): p for p in f.parts} if (f := entry.figure(name)) else {} for entry in entries]
    labels = list(dict.fromkeys(label for found in parts for label in found))
    known = {label for found in parts for label, p in found.items() if p.passed is not None or not isnan(p.value)}
    labels = [label for label in labels if label in known] or labels
    if not labels:
        return None
    judged = any(p.passed is not None for found in parts for p in found.values())
    caption = f"{title(entries, name)}{_in(unit(entries, name))}"
    if len(labels) <= MOST_COLUMNS:
        rows = [
            (entry, [_part_cell(found.get(label), judged) for label in labels])
            for entry, found in zip(entries, parts, strict=True)
        ]
        return table_of_entries(caption, [one_line(label) for label in labels], rows)
    if len(labels) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} of {len(labels)} problems, the results have all"
    lines = tuple(
        (Cell(one_line(label)), *(_part_cell(found.get(label), judged) for found in parts))
        for label in labels[:MOST_ROWS]
    )
    headings = ("Problem", *(entry.title for entry in entries))
    return Table(caption, headings, lines, (False, *(True for _ in entries)))


def _row(part: Part) -> str:
    """Of which row a part is: the frequency that is worst is another for each estimator."""
    return AT_WORST.sub(" at its worst frequency", part.label)


def _part_cell(part: Part | None, judged: bool) -> Cell:
    if part is None:
        return Cell("", float("inf"))
    where = "" if _row(part) == part.label else f"{one_line(part.label)}: "
    told = f"{where}95 % interval {pair(part.interval)}; passes: {pair(part.limits)}; {one_line(part.why)}".rstrip("; ")
    return number_cell(part.value, part_verdict(part) if judged else None, told)


def failures(entries: Sequence[Entry]) -> Table:
    """How requests ended, by kind."""
    there = {kind for entry in entries for kind, number in entry.result.outcomes.items() if number}
    kinds = [kind for kind in KINDS if kind in there] + sorted(there - set(KINDS))
    rows = [
        (entry, [Cell(str(n), float(n)) for n in (entry.result.outcomes.get(kind, 0) for kind in kinds)])
        for entry in entries
    ]
    return table_of_entries("How many requests ended how", [one_line(kind).replace("_", " ") for kind in kinds], rows)


def _value(figure: Metric | None) -> Cell:
    if figure is None:
        return Cell("", float("inf"))
    return number_cell(figure.value, verdict(figure), one_line(figure.why))


def _in(unit: str) -> str:
    return f" / {unit}" if unit else ""
