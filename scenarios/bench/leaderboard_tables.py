"""The tables of the leaderboard, as the page and the Markdown both show them."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from math import inf, isnan

from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems, listed
from scenarios.bench.leaderboard_verdict import GUIDE, WORDS, Verdict, count, judged_metrics, part_verdict, verdict
from scenarios.bench.metric import Metric, Part
from scenarios.bench.result_table import UNKNOWN, limits, number
from scenarios.estimators.outcome import KINDS

MOST_ROWS = 40
"""Problems in the rows of a table."""

AT_WORST = re.compile(r" at [\d.e+-]+ Hz$")
"""End of the label of a part at its worst frequency, which is another for each estimator."""

HEADLINE = ("efficiency", "noise_free_recovery", "coverage", "bias", "reliability", "speed")
"""Metrics whose numbers stand in the first table."""

SEVERITY = list(Verdict)
"""Verdicts from good to bad, by which a column of them is sorted."""


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

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


EMPTY = Cell("", inf)
"""A cell without a number, which sorts last."""


@dataclass(frozen=True)
class Table:
    """A table of the page and of the Markdown.

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


def metric_names(rows: Sequence[LeaderboardRow]) -> list[str]:
    """All metrics that any row has, those of this version in their order, others behind."""
    present: set[str] = set()
    for row in rows:
        present |= row.result.metrics.keys()
    return [name for name in GUIDE if name in present] + sorted(present - GUIDE.keys())


def title(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Title of a metric, from the first row that has it."""
    return _first_metric(rows, name).title or name


def unit(rows: Sequence[LeaderboardRow], name: str) -> str:
    """Unit of a metric behind a stroke, from the first row that has it; empty without a unit."""
    of_first = _first_metric(rows, name).unit
    return f" / {of_first}" if of_first else ""


def standing(rows: Sequence[LeaderboardRow]) -> Table:
    """The first table: number of verdicts of each kind, and the most important values."""
    present = metric_names(rows)
    headline = [name for name in HEADLINE if name in present]
    judged, problems = judged_metrics(row.result for row in rows), common_problems(rows)
    table_rows = []
    for row in rows:
        counts = count(map(row.metric, judged))
        passes = counts[Verdict.PASSES]
        cells = [Cell(f"{passes} of {len(judged)}", float(passes))]
        for judgement in (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS, Verdict.NONE):
            cells.append(_count_cell(counts[judgement]))
        cells.append(_response_error_cell(row, problems))
        cells += [_metric_cell(row.metric(name)) for name in headline]
        table_rows.append([_name_cell(row), *cells])
    error = WORDS["captions"]["response_error"] % listed(problems) if problems else WORDS["captions"]["no_error"]
    columns = ["Estimator", "Passed", "Fails", "Fails as theory says", "No verdict", "Response error / %"]
    columns += [f"{_heading(name)}{unit(rows, name)}" for name in headline]
    return Table(f"{WORDS['captions']['standing']} {error}", columns, table_rows)


def verdicts(rows: Sequence[LeaderboardRow]) -> Table:
    """The verdict of each estimator on each metric that any row was judged by."""
    judged = []
    for name in metric_names(rows):
        if any(verdict(row.metric(name)) is not Verdict.NONE for row in rows):
            judged.append(name)
    table_rows = []
    for row in rows:
        cells = [_name_cell(row)]
        for name in judged:
            metric = row.metric(name)
            reason = "" if metric is None else metric.why
            cells.append(_verdict_cell(verdict(metric), reason))
        table_rows.append(cells)
    columns = ("Estimator", *map(_heading, judged))
    return Table("The reasons stand in the sections of the estimators", columns, table_rows)


def by_problem(rows: Sequence[LeaderboardRow], name: str) -> Table | None:
    """A metric with a line for each problem and a column for each estimator; None where it has no parts."""
    cells: dict[str, dict[int, Cell]] = {}
    has_number: dict[str, bool] = {}
    parts = chain.from_iterable(row.parts(name) for row in rows)
    judged = any(p.passed is not None for p in parts)
    for row in rows:
        for metric_part in row.parts(name):
            problem = AT_WORST.sub(" at its worst frequency", metric_part.label)
            cells.setdefault(problem, {})[row.number] = _part_cell(metric_part, problem, judged)
            has_number[problem] = (
                has_number.get(problem, False) or metric_part.passed is not None or not isnan(metric_part.value)
            )
    if not cells:
        return None
    # Problems of which no row has a number are left out, unless there is no number at all.
    problems = [problem for problem in cells if has_number[problem]] or list(cells)
    caption = f"{title(rows, name)}{unit(rows, name)}"
    if len(problems) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} of {len(problems)} problems, the results have all"
    table_rows = []
    for problem in problems[:MOST_ROWS]:
        table_rows.append([Cell(problem), *(cells[problem].get(row.number, EMPTY) for row in rows)])
    return Table(caption, ("Problem", *(row.title for row in rows)), table_rows)


def failures(rows: Sequence[LeaderboardRow]) -> Table:
    """Number of requests by kind of outcome, for each estimator."""
    present: set[str] = set()
    for row in rows:
        present |= {outcome for outcome, times in row.result.outcomes.items() if times}
    # Kinds that this version does not know come last.
    outcomes = [outcome for outcome in KINDS if outcome in present] + sorted(present - KINDS.keys())
    table_rows = []
    for row in rows:
        table_rows.append([_name_cell(row), *(_count_cell(row.result.outcomes.get(name, 0)) for name in outcomes)])
    columns = ("Estimator", *(outcome.replace("_", " ") for outcome in outcomes))
    return Table("How many requests ended how", columns, table_rows)


def metrics_of(row: LeaderboardRow) -> Table:
    """All metrics of an estimator, with their reasons."""
    table_rows = []
    for name in metric_names([row]):
        metric = row.result.metrics[name]
        cells = [Cell(metric.title or name), _verdict_cell(verdict(metric))]
        cells += [_number_cell(metric.value), _number_cell(metric.expected), _limits_cell(metric.interval)]
        table_rows.append([*cells, Cell(metric.unit), Cell(metric.why)])
    caption = "Its figures: each by the part furthest beyond its limits, or nearest to them"
    columns = ("Figure", "Verdict", "Value", "Expected", "95 % interval", "Unit", "Why")
    return Table(caption, columns, table_rows, sortable=False)


def failing_of(row: LeaderboardRow) -> Table | None:
    """Parts of an estimator's metrics that do not pass, or pass although theory says that they fail; None without."""
    table_rows = []
    for name in metric_names([row]):
        for metric_part in row.parts(name):
            passes_unexpectedly = bool(metric_part.passed) and not metric_part.theory
            if metric_part.passed is not False and not passes_unexpectedly:
                continue
            why = f"theory says that it fails: {metric_part.why}" if passes_unexpectedly else metric_part.why
            cells = [Cell(_heading(name)), Cell(metric_part.label), _verdict_cell(part_verdict(metric_part))]
            cells += [
                _number_cell(metric_part.value),
                _limits_cell(metric_part.interval),
                _limits_cell(metric_part.limits),
            ]
            table_rows.append([*cells, _count_cell(metric_part.draws), Cell(why)])
    caption = "Where it does not pass, and where it does though theory says that it fails"
    columns = ("Figure", "Problem", "Verdict", "Value", "95 % interval", "Passes", "Records", "Why")
    return Table(caption, columns, table_rows, sortable=False) if table_rows else None


def _first_metric(rows: Iterable[LeaderboardRow], name: str) -> Metric:
    return next(row.result.metrics[name] for row in rows if name in row.result.metrics)


def _heading(name: str) -> str:
    return GUIDE[name].short if name in GUIDE else name.replace("_", " ")


def _name_cell(row: LeaderboardRow) -> Cell:
    return Cell(row.title, float(row.number), link=row.mark)


def _count_cell(times: int) -> Cell:
    return Cell(str(times), float(times))


def _number_cell(value: float, judgement: Verdict | None = None, reason: str = "") -> Cell:
    """A number; an unknown one sorts last, and is not shown beside the sign of no verdict, which looks the same."""
    shown = "" if isnan(value) and judgement is Verdict.NONE else number(value)
    key = inf if isnan(value) else value
    return Cell(shown, key, judgement, reason)


def _limits_cell(ends: tuple[float, float]) -> Cell:
    key = inf if isnan(ends[0]) else ends[0]
    return Cell(limits(ends), key)


def _verdict_cell(judgement: Verdict, reason: str = "") -> Cell:
    return Cell("", float(SEVERITY.index(judgement)), judgement, reason)


def _metric_cell(metric: Metric | None) -> Cell:
    return EMPTY if metric is None else _number_cell(metric.value, verdict(metric), metric.why)


def _part_cell(metric_part: Part, problem: str, judged: bool) -> Cell:
    reason = (
        f"95 % interval {limits(metric_part.interval)}; passes: {limits(metric_part.limits)}; {metric_part.why}".rstrip(
            "; "
        )
    )
    if metric_part.label != problem:
        reason = f"{metric_part.label}: {reason}"
    judgement = part_verdict(metric_part) if judged else None
    return _number_cell(metric_part.value, judgement, reason)


def _response_error_cell(row: LeaderboardRow, problems: Sequence[str]) -> Cell:
    """Median response error; how many of the problems it answered, where it did not answer all."""
    if row.metric("frequency_response") is None:
        return EMPTY
    absent = row.unanswered(problems)
    # A median over other problems than those of the other rows would not compare.
    if 0 < len(absent) < len(problems):
        answered = f"{UNKNOWN} ({len(problems) - len(absent)} of {len(problems)})"
        return Cell(answered, inf, title=f"too few models on {', '.join(absent)}")
    return _number_cell(row.median_error(problems))
