"""The tables of the leaderboard, as the page and the Markdown both show them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isnan

from scenarios.bench.leaderboard import Leaderboard, LeaderboardRow
from scenarios.bench.leaderboard_words import CAPTIONS, guide_to
from scenarios.bench.metric import Metric, Part, Verdict
from scenarios.bench.result_tables import UNKNOWN, limits, number
from scenarios.estimators.outcome import KINDS
from scenarios.files.result_table import ResultTable

MOST_ROWS = 40
"""Problems in the rows of a table: a full bench times hundreds."""

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


@dataclass(frozen=True)
class Table:
    """A table of the page and of the Markdown.

    Attributes:
        caption: Its caption.
        columns: Headings.
        rows: Its rows, at least one; cells of a column are all numbers, or all texts.
    """

    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]

    def as_text(self) -> ResultTable:
        """Return the table with the signs of verdicts behind numbers."""
        rows = []
        for row in self.rows:
            rows.append([f"{cell.text} {cell.verdict.sign}" if cell.verdict else cell.text for cell in row])
        return ResultTable(self.caption, self.columns, rows)


def standing(board: Leaderboard) -> Table:
    """The first table: number of verdicts of each kind, and the most important values."""
    headline = [name for name in HEADLINE if name in board.metrics]
    table_rows = []
    for row in board.rows:
        counts = row.verdicts(board.judged)
        passes = counts[Verdict.PASSES]
        cells = [_name_cell(row), Cell(f"{passes} of {len(board.judged)}", float(passes))]
        for verdict in (Verdict.FAILS, Verdict.FAILS_AS_THEORY_SAYS, Verdict.NONE):
            cells.append(_count_cell(counts[verdict]))
        cells.append(_response_error_cell(row, board.problems))
        cells += [_metric_cell(row.metric(name)) for name in headline]
        table_rows.append(cells)
    error = CAPTIONS["response_error"] % board.problems_in_words() if board.problems else CAPTIONS["no_error"]
    columns = ["Estimator", "Passed", "Fails", "Fails as theory says", "No verdict", "Response error / %"]
    columns += [f"{guide_to(name).short}{unit_of(board, name)}" for name in headline]
    return Table(f"{CAPTIONS['standing']} {error}", columns, table_rows)


def verdicts(board: Leaderboard) -> Table:
    """The verdict of each estimator on each metric that any row was judged by."""
    judged = [name for name in board.metrics if board.is_judged(name)]
    table_rows = []
    for row in board.rows:
        cells = [_name_cell(row)]
        for name in judged:
            metric = row.metric(name)
            reason = "" if metric is None else metric.why
            cells.append(_verdict_cell(row.verdict(name), reason))
        table_rows.append(cells)
    columns = ("Estimator", *(guide_to(name).short for name in judged))
    return Table("The reasons stand in the sections of the estimators", columns, table_rows)


def by_problem(board: Leaderboard, name: str) -> Table | None:
    """A metric with a line for each problem and a column for each estimator; None where it has no parts."""
    by_label: dict[str, dict[int, Part]] = {}
    for row in board.rows:
        for metric_part in row.parts(name):
            label = AT_WORST.sub(" at its worst frequency", metric_part.label)
            by_label.setdefault(label, {})[row.number] = metric_part
    if not by_label:
        return None
    # Problems of which no row has a number are left out, unless there is no number at all.
    known = [label for label, parts_of_rows in by_label.items() if any(map(_is_known, parts_of_rows.values()))]
    problems = known or list(by_label)
    caption = f"{title_of(board, name)}{unit_of(board, name)}"
    if len(problems) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} of {len(problems)} problems, the results have all"
    judged = any(metric_part.passed is not None for row in board.rows for metric_part in row.parts(name))
    table_rows = []
    for label in problems[:MOST_ROWS]:
        cells = [_part_cell(by_label[label].get(row.number), label, judged=judged) for row in board.rows]
        table_rows.append([Cell(label), *cells])
    return Table(caption, ("Problem", *(row.title for row in board.rows)), table_rows)


def failures(board: Leaderboard) -> Table:
    """Number of requests by kind of outcome, for each estimator."""
    present: set[str] = set()
    for row in board.rows:
        present |= {outcome for outcome, times in row.result.outcomes.items() if times}
    # Kinds that this version does not know come last.
    outcomes = [outcome for outcome in KINDS if outcome in present] + sorted(present - KINDS.keys())
    table_rows = []
    for row in board.rows:
        cells = [_count_cell(row.result.outcomes.get(outcome, 0)) for outcome in outcomes]
        table_rows.append([_name_cell(row), *cells])
    columns = ("Estimator", *(outcome.replace("_", " ") for outcome in outcomes))
    return Table("How many requests ended how", columns, table_rows)


def metrics_of(board: Leaderboard, row: LeaderboardRow) -> Table:
    """All metrics of an estimator, with their reasons."""
    table_rows = []
    for name in board.metrics:
        metric = row.metric(name)
        if metric is not None:
            cells = [Cell(metric.title or name), _verdict_cell(metric.verdict)]
            cells += [_number_cell(metric.value), _number_cell(metric.expected), _limits_cell(metric.interval)]
            table_rows.append([*cells, Cell(metric.unit), Cell(metric.why)])
    caption = "Its figures: each by the part furthest beyond its limits, or nearest to them"
    return Table(caption, ("Figure", "Verdict", "Value", "Expected", "95 % interval", "Unit", "Why"), table_rows)


def failing_of(board: Leaderboard, row: LeaderboardRow) -> Table | None:
    """Parts of an estimator's metrics that do not pass, or pass although theory says that they fail; None without."""
    table_rows = []
    for name in board.metrics:
        for metric_part in row.parts(name):
            passes_unexpectedly = bool(metric_part.passed) and not metric_part.theory
            if metric_part.passed is not False and not passes_unexpectedly:
                continue
            why = f"theory says that it fails: {metric_part.why}" if passes_unexpectedly else metric_part.why
            cells = [Cell(guide_to(name).short), Cell(metric_part.label), _verdict_cell(metric_part.verdict)]
            cells += [_number_cell(metric_part.value), _limits_cell(metric_part.interval)]
            cells += [_limits_cell(metric_part.limits), _count_cell(metric_part.draws), Cell(why)]
            table_rows.append(cells)
    caption = "Where it does not pass, and where it does though theory says that it fails"
    columns = ("Figure", "Problem", "Verdict", "Value", "95 % interval", "Passes", "Records", "Why")
    return Table(caption, columns, table_rows) if table_rows else None


def title_of(board: Leaderboard, name: str) -> str:
    """Title of a metric."""
    return board.metrics[name].title or name


def unit_of(board: Leaderboard, name: str) -> str:
    """Unit of a metric behind a stroke; empty without a unit."""
    unit = board.metrics[name].unit
    return f" / {unit}" if unit else ""


def _is_known(metric_part: Part) -> bool:
    return metric_part.passed is not None or not isnan(metric_part.value)


def _name_cell(row: LeaderboardRow) -> Cell:
    return Cell(row.title, float(row.number), link=row.mark)


def _count_cell(times: int) -> Cell:
    return Cell(str(times), float(times))


def _number_cell(value: float, verdict: Verdict | None = None, reason: str = "") -> Cell:
    """A number; an unknown one sorts last, and is not shown beside the sign of no verdict, which looks the same."""
    shown = "" if isnan(value) and verdict is Verdict.NONE else number(value)
    key = inf if isnan(value) else value
    return Cell(shown, key, verdict, reason)


def _limits_cell(ends: tuple[float, float]) -> Cell:
    key = inf if isnan(ends[0]) else ends[0]
    return Cell(limits(ends), key)


def _verdict_cell(verdict: Verdict, reason: str = "") -> Cell:
    return Cell("", float(SEVERITY.index(verdict)), verdict, reason)


def _metric_cell(metric: Metric | None) -> Cell:
    return Cell("", inf) if metric is None else _number_cell(metric.value, metric.verdict, metric.why)


def _part_cell(metric_part: Part | None, label: str, *, judged: bool) -> Cell:
    """Cell with the value of a part of a metric; empty where the estimator lacks the part."""
    if metric_part is None:
        return Cell("", inf)
    interval = f"95 % interval {limits(metric_part.interval)}; passes: {limits(metric_part.limits)}"
    reason = f"{interval}; {metric_part.why}".rstrip("; ")
    if metric_part.label != label:
        reason = f"{metric_part.label}: {reason}"
    return _number_cell(metric_part.value, metric_part.verdict if judged else None, reason)


def _response_error_cell(row: LeaderboardRow, problems: Sequence[str]) -> Cell:
    """Median response error; how many of the problems it answered, where it did not answer all."""
    if row.metric("frequency_response") is None:
        return Cell("", inf)
    absent = row.unanswered(problems)
    # A median over other problems than those of the other rows would not compare.
    if 0 < len(absent) < len(problems):
        answered = f"{UNKNOWN} ({len(problems) - len(absent)} of {len(problems)})"
        return Cell(answered, inf, title=f"too few models on {', '.join(absent)}")
    return _number_cell(row.median_error(problems))
