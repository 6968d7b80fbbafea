"""The tables of the leaderboard, as the page and the Markdown both show them."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, isinf, isnan

from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems, listed
from scenarios.bench.leaderboard_verdict import GUIDE, Verdict, count, judged_metrics, part_verdict, verdict
from scenarios.bench.metric import Metric, Part
from scenarios.estimators.estimator import METHODS
from scenarios.estimators.outcome import KINDS
from scenarios.files.printable import one_line

UNKNOWN = "–"

MOST_COLUMNS = 8
"""Problems in the columns of a table; more stand in its rows."""

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
        key: Number by which its column is sorted; None: by the text.
        verdict: The verdict that it shows, or None.
        link: Anchor on the page, or empty.
        title: Further text, shown where there is room for it.
    """

    text: str
    key: float | None = None
    verdict: Verdict | None = None
    link: str = ""
    title: str = ""


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes:
        caption: Its caption.
        columns: Headings.
        rows: Its rows.
        numeric: Whether each column holds numbers.
        sortable: Whether the order of its rows means nothing.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    numeric: tuple[bool, ...]
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
    if isinf(low):
        return f"at most {number(high)}"
    return f"at least {number(low)}" if isinf(high) else f"{number(low)} to {number(high)}"


def metric_names(rows: Sequence[LeaderboardRow]) -> list[str]:
    """All metrics that any row has, those of this version in their order, others behind."""
    present = {name for row in rows for name in row.result.figures}
    return [name for name in GUIDE if name in present] + sorted(present - set(GUIDE))


def title(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Title of a metric, from the first row that has it."""
    metrics = [metric for row in rows if (metric := row.metric(name))]
    return one_line(metrics[0].title) or one_line(name)


def unit(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Unit of a metric, from the first row that has it."""
    return next((one_line(metric.unit) for row in rows if (metric := row.metric(name))), "")


def standing(rows: Sequence[LeaderboardRow]) -> Table:
    """The first table: verdicts counted, and the numbers that most look for."""
    columns = [name for name in HEADLINE if any(row.metric(name) for row in rows)]
    headings = [f"{_short(name)}{_per(unit(rows, name))}" for name in columns]
    judged, problems = judged_metrics(row.result for row in rows), common_problems(rows)
    lines = []
    for row in rows:
        counts = count(map(row.metric, judged))
        cells = [
            Cell(f"{counts[Verdict.PASSES]} of {len(judged)}", float(counts[Verdict.PASSES])),
            *(
                Cell(str(counts[word]), float(counts[word]))
                for word in (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS, Verdict.NONE)
            ),
            _median_cell(row, problems),
        ]
        lines.append((row, [*cells, *(_metric_cell(row.metric(name)) for name in columns)]))
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
    return _by_row(caption, (*counted, *headings), lines)


def verdicts(rows: Sequence[LeaderboardRow]) -> Table:
    """A verdict of each metric that is ever judged."""
    judged = [name for name in metric_names(rows) if any(verdict(row.metric(name)) is not Verdict.NONE for row in rows)]
    lines = [
        (row, [_verdict_cell(verdict(m := row.metric(name)), one_line(m.why) if m else "") for name in judged])
        for row in rows
    ]
    return _by_row("The reasons stand in the sections of the estimators", map(_short, judged), lines)


def by_problem(rows: Sequence[LeaderboardRow], name: str) -> Table | None:
    """A metric problem by problem, a line for each estimator, or for each problem where these are many.

    Returns:
        The table; None where the metric has no parts.
    """
    parts = [{_line(p): p for p in metric.parts} if (metric := row.metric(name)) else {} for row in rows]
    labels = list(dict.fromkeys(label for of_row in parts for label in of_row))
    known = {label for of_row in parts for label, p in of_row.items() if p.passed is not None or not isnan(p.value)}
    labels = [label for label in labels if label in known] or labels
    if not labels:
        return None
    judged = any(p.passed is not None for of_row in parts for p in of_row.values())
    caption = f"{title(rows, name)}{_per(unit(rows, name))}"
    if len(labels) <= MOST_COLUMNS:
        lines = [
            (row, [_part_cell(of_row.get(label), judged) for label in labels])
            for row, of_row in zip(rows, parts, strict=True)
        ]
        return _by_row(caption, map(one_line, labels), lines)
    if len(labels) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} of {len(labels)} problems, the results have all"
    transposed = tuple(
        (Cell(one_line(label)), *(_part_cell(of_row.get(label), judged) for of_row in parts))
        for label in labels[:MOST_ROWS]
    )
    return Table(caption, ("Problem", *(row.title for row in rows)), transposed, (False, *(True for _ in rows)))


def failures(rows: Sequence[LeaderboardRow]) -> Table:
    """How requests ended, by kind."""
    present = {kind for row in rows for kind, times in row.result.outcomes.items() if times}
    kinds = [kind for kind in KINDS if kind in present] + sorted(present - set(KINDS))
    lines = [
        (row, [Cell(str(n), float(n)) for n in (row.result.outcomes.get(kind, 0) for kind in kinds)]) for row in rows
    ]
    return _by_row("How many requests ended how", [one_line(kind).replace("_", " ") for kind in kinds], lines)


@dataclass(frozen=True)
class Profile:
    """The section of one estimator.

    Attributes:
        row: Its row.
        facts: What it is and how it was run, as pairs of words.
        command: The command line that repeats its run.
        metrics: Its verdicts, one line each.
        failing: Parts that did not pass, and those that pass although theory says that they fail; None without any.
        outcomes: How its requests ended, in words.
        reasons: The commonest reasons of failures, with how often.
    """

    row: LeaderboardRow
    facts: tuple[tuple[str, str], ...]
    command: str
    metrics: Table
    failing: Table | None
    outcomes: tuple[tuple[str, str], ...]
    reasons: tuple[tuple[str, int], ...]


def profile(row: LeaderboardRow) -> Profile:
    """The section of an estimator."""
    result = row.result
    kinds = [*KINDS, *sorted(set(result.outcomes) - set(KINDS))]
    return Profile(
        row=row,
        facts=tuple((word, one_line(text)) for word, text in _facts(row) if text),
        command=one_line(result.command),
        metrics=_metrics(row),
        failing=_failing(row),
        outcomes=tuple(
            (f"{result.outcomes[kind]} × {one_line(kind).replace('_', ' ')}", KINDS.get(kind, ""))
            for kind in kinds
            if result.outcomes.get(kind)
        ),
        reasons=tuple((one_line(text), times) for text, times in sorted(result.reasons.items(), key=lambda r: -r[1])),
    )


def _facts(row: LeaderboardRow) -> Sequence[tuple[str, str]]:
    result, contestant = row.result, row.result.contestant
    kind = "program" if contestant.program else "function"
    stays = ", started once for all requests" if contestant.stays else ""
    return (
        ("Called", f"{kind} {contestant.target}{stays}"),
        ("Version", contestant.version or "not stated"),
        ("Settings", contestant.settings or "none stated"),
        ("Structure", contestant.structure or "the one that is asked"),
        ("Method", METHODS.get(contestant.method or "", contestant.method or "not stated: all is expected of it")),
        ("Run", f"{result.effort}, seed {result.seed}, protocol {result.protocol}"),
        ("Limits", f"{result.limits.seconds:g} s and {result.limits.memory_bytes / 2**20:.0f} MiB for each answer"),
        ("Processor time", f"{number(result.seconds)} s for all answers"),
        ("Machine", result.machine or "not stated"),
        ("Versions", ", ".join(f"{name} {version}" for name, version in result.versions.items())),
        ("SHA-256 of its source", result.source or "none: it has no file of its own"),
        ("File", row.path.name),
    )


def _metrics(row: LeaderboardRow) -> Table:
    lines = tuple(
        (
            Cell(one_line(metric.title) or one_line(name)),
            _verdict_cell(verdict(metric)),
            _number_cell(metric.value),
            _number_cell(metric.expected),
            Cell(limits(metric.interval)),
            Cell(one_line(metric.unit)),
            Cell(one_line(metric.why)),
        )
        for name in metric_names([row])
        for metric in (row.result.figures[name],)
    )
    caption = "Its figures: each by the part furthest beyond its limits, or nearest to them"
    columns = ("Figure", "Verdict", "Value", "Expected", "95 % interval", "Unit", "Why")
    return Table(caption, columns, lines, (False,) * 2 + (True,) * 3 + (False,) * 2, False)


def _failing(row: LeaderboardRow) -> Table | None:
    lines = []
    for name in metric_names([row]):
        for part in row.result.figures[name].parts:
            of_part = part_verdict(part)
            unexpected = of_part is Verdict.PASSES and not part.theory
            if of_part in (Verdict.PASSES, Verdict.NONE) and not unexpected:
                continue
            lines.append(
                (
                    Cell(GUIDE[name].short if name in GUIDE else one_line(name)),
                    Cell(one_line(part.label)),
                    _verdict_cell(of_part),
                    _number_cell(part.value),
                    Cell(limits(part.interval)),
                    Cell(limits(part.limits)),
                    Cell(str(part.draws)),
                    Cell(one_line(f"theory says that it fails: {part.why}" if unexpected else part.why)),
                )
            )
    caption = "Where it does not pass, and where it does though theory says that it fails"
    columns = ("Figure", "Problem", "Verdict", "Value", "95 % interval", "Passes", "Records", "Why")
    numeric = (False, False, False, True, True, True, True, False)
    return Table(caption, columns, tuple(lines), numeric, False) if lines else None


def _by_row(caption: str, columns: Iterable[str], lines: Iterable[tuple[LeaderboardRow, Iterable[Cell]]]) -> Table:
    """A table with a line for each estimator, in the order of the page."""
    headings = ("Estimator", *columns)
    cells = tuple((Cell(row.title, float(row.number), link=row.mark), *of_row) for row, of_row in lines)
    return Table(caption, headings, cells, (False, *(True for _ in headings[1:])))


def _number_cell(value: float, word: Verdict | None = None, text: str = "") -> Cell:
    """A number; an unknown one sorts last."""
    shown = "" if isnan(value) and word is Verdict.NONE else number(value)
    return Cell(shown, inf if isnan(value) else value, word, title=text)


def _verdict_cell(word: Verdict, text: str = "") -> Cell:
    return Cell("", float(list(Verdict).index(word)), word, title=text)


def _metric_cell(metric: Metric | None) -> Cell:
    if metric is None:
        return Cell("", inf)
    return _number_cell(metric.value, verdict(metric), one_line(metric.why))


def _median_cell(row: LeaderboardRow, problems: Sequence[str]) -> Cell:
    """Median response error; how many of the problems it answered, where it did not answer all."""
    absent = row.unanswered(problems)
    if 0 < len(absent) < len(problems):
        text = f"too few models on {', '.join(map(one_line, absent))}"
        return Cell(f"{UNKNOWN} ({len(problems) - len(absent)} of {len(problems)})", inf, title=text)
    return _number_cell(row.median_error(problems)) if row.metric("frequency_response") else Cell("", inf)


def _part_cell(part: Part | None, judged: bool) -> Cell:
    if part is None:
        return Cell("", inf)
    where = "" if _line(part) == part.label else f"{one_line(part.label)}: "
    text = f"{where}95 % interval {limits(part.interval)}; passes: {limits(part.limits)}; {one_line(part.why)}"
    return _number_cell(part.value, part_verdict(part) if judged else None, text.rstrip("; "))


def _line(part: Part) -> str:
    """The line of a part in a table by problem."""
    return AT_WORST.sub(" at its worst frequency", part.label)


def _short(name: str) -> str:
    return GUIDE[name].short if name in GUIDE else one_line(name).replace("_", " ")


def _per(unit: str) -> str:
    return f" / {unit}" if unit else ""
