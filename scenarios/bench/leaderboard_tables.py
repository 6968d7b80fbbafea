"""The tables of the leaderboard, as the page and the Markdown both show them."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, isinf, isnan

from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems, listed
from scenarios.bench.leaderboard_verdict import GUIDE, Verdict, count, judged_metrics, part_verdict, verdict
from scenarios.bench.metric import UNLIMITED, Metric, Part, worst_part
from scenarios.bench.result import Result
from scenarios.estimators.outcome import KINDS
from scenarios.files.printable import one_line

UNKNOWN = "–"

MOST_ROWS = 40
"""Problems in the rows of a table."""

AT_WORST = re.compile(r" at [\d.e+-]+ Hz$")
"""End of the label of a part at its worst frequency, which is another for each estimator."""

HEADLINE = ("efficiency", "noise_free_recovery", "coverage", "bias", "reliability", "speed")
"""Metrics whose numbers stand in the first table."""


@dataclass(frozen=True)
class Cell:
    """A cell.

    Attributes:
        text: What it shows.
        key: Number by which its column is sorted, of numbers and verdicts; None: by the text.
        verdict: The verdict that it shows, or None.
        title: Further text, shown where there is room for it.
        link: Anchor on the page, or empty.
    """

    text: str = ""
    key: float | None = None
    verdict: Verdict | None = None
    title: str = ""
    link: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        caption: Its caption.
        columns: Headings.
        rows: Its rows, at least one; cells of a column are all numbers, or all texts.
        sortable: Whether the order of its rows means nothing.
    """

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    sortable: bool = True


def number(value: float) -> str:
    """A number as the page shows it: three digits, powers of ten where there are many zeros."""
    if isnan(value):
        return UNKNOWN
    if isinf(value):
        return "∞" if value > 0 else "-∞"
    if 1e3 <= abs(value) < 1e6:
        return f"{float(f'{value:.3g}'):.0f}"
    return f"{value:.3g}" if value == 0 or 1e-3 <= abs(value) < 1e3 else f"{value:.1e}"


def limits(ends: tuple[float, float]) -> str:
    """An interval, or limits of which one may be open."""
    low, high = ends
    if isnan(low) or isnan(high):
        return UNKNOWN
    if isinf(low) and isinf(high):
        return "any"
    if low == high:
        return number(low)
    if isinf(low):
        return f"at most {number(high)}"
    return f"at least {number(low)}" if isinf(high) else f"{number(low)} to {number(high)}"


def metric_table(result: Result) -> tuple[str, Sequence[str], Sequence[Sequence[str]]]:
    """Title, headings and rows of the metrics of one result."""
    own = result.estimator
    kind = one_line(", ".join(part for part in (own.structure, own.method, own.version) if part))
    effort, *fewer = result.effort.split(", ", 1)
    rows = [
        (
            f"{metric.title}, {metric.unit}" if metric.unit else metric.title,
            number(metric.value),
            _passes_if(metric),
            UNKNOWN if metric.interval[0] == metric.interval[1] else limits(metric.interval),
            f"{verdict(metric).sign} {verdict(metric).word}",
        )
        for metric in result.metrics.values()
    ]
    bench = ", ".join((f"{effort} bench", *fewer, f"seed {result.seed}"))
    columns = ("", "value", "passes if", "95 % interval", "verdict")
    return f"{own.name}{f' ({kind})' if kind else ''}: {bench}", columns, rows


def _passes_if(metric: Metric) -> str:
    """Limits of the part whose value is shown."""
    judged = [part for part in metric.parts if part.passed is not None]
    ends = worst_part(judged).limits if judged else UNLIMITED
    return UNKNOWN if ends == UNLIMITED else limits(ends)


def metric_names(rows: Sequence[LeaderboardRow]) -> list[str]:
    """All metrics that any row has, those of this version in their order, others behind."""
    present = {name for row in rows for name in row.result.metrics}
    return [name for name in GUIDE if name in present] + sorted(present - set(GUIDE))


def title(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Title of a metric, from the first row that has it."""
    return next(metric.title for row in rows if (metric := row.metric(name))) or name


def unit(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Unit of a metric behind a stroke, from the first row that has it; empty without a unit."""
    text = next(metric.unit for row in rows if (metric := row.metric(name)))
    return f" / {text}" if text else ""


def standing(rows: Sequence[LeaderboardRow]) -> Table:
    """The first table: verdicts counted, and the numbers that most look for."""
    columns = [name for name in HEADLINE if any(row.metric(name) for row in rows)]
    judged, problems = judged_metrics(row.result for row in rows), common_problems(rows)
    others = (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS, Verdict.NONE)
    lines = []
    for row in rows:
        counts = count(map(row.metric, judged))
        cells = [Cell(f"{counts[Verdict.PASSES]} of {len(judged)}", float(counts[Verdict.PASSES]))]
        cells += [_count(counts[word]) for word in others]
        cells += [_median(row, problems), *(_metric(row.metric(name)) for name in columns)]
        lines.append((row, cells))
    caption = (
        "Figures passed of all that give verdicts, and each figure’s number where it is furthest beyond its limits, or "
        "nearest to them. Response error: "
    )
    if problems:
        caption += (
            f"median over the problems that were asked of all rows ({listed(problems)}); “–” where an estimator gave "
            "models of fewer than half of the records of one of them, or of one record, beside how many of the "
            "problems it answered"
        )
    else:
        caption += "none, for no problem was asked of all rows"
    counted = ("Passed", "Fails", "Fails as theory says", "No verdict", "Response error / %")
    return _by_row(caption, (*counted, *(f"{_short(name)}{unit(rows, name)}" for name in columns)), lines)


def verdicts(rows: Sequence[LeaderboardRow]) -> Table:
    """A verdict of each metric that is ever judged."""
    judged = [name for name in metric_names(rows) if any(verdict(row.metric(name)) is not Verdict.NONE for row in rows)]
    lines = [(row, [_verdict(verdict(m := row.metric(name)), m.why if m else "") for name in judged]) for row in rows]
    return _by_row("The reasons stand in the sections of the estimators", map(_short, judged), lines)


def by_problem(rows: Sequence[LeaderboardRow], name: str) -> Table | None:
    """A metric with a line for each problem and a column for each estimator; None where it has no parts."""
    parts = [{_line(p): p for p in metric.parts} if (metric := row.metric(name)) else {} for row in rows]
    labels = list(dict.fromkeys(label for of_row in parts for label in of_row))
    known = {label for of_row in parts for label, p in of_row.items() if p.passed is not None or not isnan(p.value)}
    labels = [label for label in labels if label in known] or labels
    if not labels:
        return None
    judged = any(p.passed is not None for of_row in parts for p in of_row.values())
    caption = f"{title(rows, name)}{unit(rows, name)}"
    if len(labels) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} of {len(labels)} problems, the results have all"
    lines = [
        (Cell(label), *(_part(of_row[label], judged) if label in of_row else Cell("", inf) for of_row in parts))
        for label in labels[:MOST_ROWS]
    ]
    return Table(caption, ("Problem", *(row.title for row in rows)), lines)


def failures(rows: Sequence[LeaderboardRow]) -> Table:
    """How requests ended, by kind."""
    present = {kind for row in rows for kind, times in row.result.outcomes.items() if times}
    kinds = [kind for kind in KINDS if kind in present] + sorted(present - set(KINDS))
    lines = [(row, [_count(row.result.outcomes.get(kind, 0)) for kind in kinds]) for row in rows]
    return _by_row("How many requests ended how", [kind.replace("_", " ") for kind in kinds], lines)


def metrics_of(row: LeaderboardRow) -> Table:
    """All metrics of an estimator, with their reasons."""
    lines = [
        (
            *(Cell(metric.title or name), _verdict(verdict(metric)), _number(metric.value), _number(metric.expected)),
            *(_limits(metric.interval), Cell(metric.unit), Cell(metric.why)),
        )
        for name in metric_names([row])
        for metric in (row.result.metrics[name],)
    ]
    caption = "Its figures: each by the part furthest beyond its limits, or nearest to them"
    columns = ("Figure", "Verdict", "Value", "Expected", "95 % interval", "Unit", "Why")
    return Table(caption, columns, lines, sortable=False)


def failing_of(row: LeaderboardRow) -> Table | None:
    """Parts of an estimator's metrics that do not pass, or pass although theory says that they fail; None without."""
    lines = []
    for name in metric_names([row]):
        for part in row.result.metrics[name].parts:
            judged = part_verdict(part)
            unexpected = judged is Verdict.PASSES and not part.theory
            if judged in (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS) or unexpected:
                why = f"theory says that it fails: {part.why}" if unexpected else part.why
                cells = (Cell(_short(name)), Cell(part.label), _verdict(judged), _number(part.value))
                lines.append((*cells, _limits(part.interval), _limits(part.limits), _count(part.draws), Cell(why)))
    caption = "Where it does not pass, and where it does though theory says that it fails"
    columns = ("Figure", "Problem", "Verdict", "Value", "95 % interval", "Passes", "Records", "Why")
    return Table(caption, columns, lines, sortable=False) if lines else None


def _by_row(caption: str, columns: Iterable[str], lines: Iterable[tuple[LeaderboardRow, Iterable[Cell]]]) -> Table:
    """A table with a line for each estimator, in the order of the page."""
    cells = [(Cell(row.title, float(row.number), link=row.mark), *of_row) for row, of_row in lines]
    return Table(caption, ("Estimator", *columns), cells)


def _count(value: int) -> Cell:
    return Cell(str(value), float(value))


def _number(value: float, judged: Verdict | None = None, text: str = "") -> Cell:
    """A number; an unknown one sorts last."""
    shown = "" if isnan(value) and judged is Verdict.NONE else number(value)
    return Cell(shown, inf if isnan(value) else value, judged, text)


def _limits(ends: tuple[float, float]) -> Cell:
    return Cell(limits(ends), inf if isnan(ends[0]) else ends[0])


def _verdict(judged: Verdict, text: str = "") -> Cell:
    return Cell("", float(list(Verdict).index(judged)), judged, text)


def _metric(metric: Metric | None) -> Cell:
    return Cell("", inf) if metric is None else _number(metric.value, verdict(metric), metric.why)


def _median(row: LeaderboardRow, problems: Sequence[str]) -> Cell:
    """Median response error; how many of the problems it answered, where it did not answer all."""
    absent = row.unanswered(problems)
    if 0 < len(absent) < len(problems):
        text = f"{UNKNOWN} ({len(problems) - len(absent)} of {len(problems)})"
        return Cell(text, inf, title=f"too few models on {', '.join(absent)}")
    return _number(row.median_error(problems)) if row.metric("frequency_response") else Cell("", inf)


def _part(part: Part, judged: bool) -> Cell:
    where = "" if _line(part) == part.label else f"{part.label}: "
    text = f"{where}95 % interval {limits(part.interval)}; passes: {limits(part.limits)}; {part.why}"
    return _number(part.value, part_verdict(part) if judged else None, text.rstrip("; "))


def _line(part: Part) -> str:
    """The line of a part in a table by problem."""
    return AT_WORST.sub(" at its worst frequency", part.label)


def _short(name: str) -> str:
    return GUIDE[name].short if name in GUIDE else name.replace("_", " ")
