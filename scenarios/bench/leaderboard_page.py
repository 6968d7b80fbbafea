"""The leaderboard as one HTML file that needs nothing else, and as Markdown."""

import re
from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from importlib import resources
from pathlib import Path

from markupsafe import Markup

from hmtb_twin.files.atomic_write import write_whole
from scenarios.bench.leaderboard import Leaderboard
from scenarios.bench.leaderboard_drawings import pictures
from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.leaderboard_tables import (
    Table,
    by_problem,
    failing_of,
    failures,
    metrics_of,
    standing,
    title_of,
    verdicts,
)
from scenarios.bench.leaderboard_words import ORDERS_GIVEN, RULE, MetricGuide, guide_to
from scenarios.bench.metric import Verdict
from scenarios.estimators.estimator import METHODS
from scenarios.estimators.outcome import KINDS
from scenarios.report.page import Page


@dataclass(frozen=True)
class MetricSection:
    """Section of the page on one metric.

    Attributes:
        name: Name of the metric.
        title: Its title.
        guide: How to read it.
        false_alarm: Probability that a perfect estimator fails it, the largest of all rows.
        table: Its values by problem, where it has any.
    """

    name: str
    title: str
    guide: MetricGuide
    false_alarm: float
    table: Table | None


def write_leaderboard(board: Leaderboard, folder: Path) -> tuple[Path, Path]:
    """Write both pages; files of these names are replaced.

    Args:
        board: The estimators.
        folder: Where; it exists.

    Returns:
        The HTML file and the Markdown file.

    Raises:
        OSError: One cannot be written.
    """
    variables = context(board)
    html_file, markdown_file = folder / "leaderboard.html", folder / "leaderboard.md"
    write_whole(html_file, html(variables))
    write_whole(markdown_file, markdown(variables))
    return html_file, markdown_file


def context(board: Leaderboard) -> dict[str, object]:
    """The variables of the templates: rows, tables, drawings and notes."""
    sections = []
    for name in board.metrics:
        false_alarms = [row.result.metrics[name].false_alarm for row in board.rows if row.metric(name) is not None]
        sections.append(
            MetricSection(name, title_of(board, name), guide_to(name), max(false_alarms), by_problem(board, name))
        )
    return {
        "rule": RULE,
        "orders_given": ORDERS_GIVEN,
        "verdicts": list(Verdict),
        "kinds": KINDS,
        "methods": METHODS,
        "rows": board.rows,
        "notes": notes(board),
        "standing": standing(board),
        "table_of_verdicts": verdicts(board),
        "failures": failures(board),
        "sections": sections,
        "pictures": pictures(board),
        "profiles": [(row, metrics_of(board, row), failing_of(board, row)) for row in board.rows],
    }


def html(variables: dict[str, object]) -> str:
    """The HTML page."""
    page = Page()
    body = page.render("leaderboard_body.html.j2", variables)
    script = resources.files("scenarios").joinpath("templates/leaderboard.js").read_text(encoding="utf-8")
    # No other script runs on the page, whatever a result file holds.
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    return page.render("leaderboard.html.j2", {**variables, "body": body, "script": Markup(script), "digest": digest})


def markdown(variables: dict[str, object]) -> str:
    """The Markdown page: tables and words, no drawings."""
    return Page({"plain": _plain, "fenced": _fenced}).render("leaderboard.md.j2", variables)


def _plain(words: object) -> str:
    """Text without the signs of Markdown, nor of HTML inside it."""
    return re.sub(r"([\\`*_{}\[\]()#+!|~$])", r"\\\1", escape(str(words), quote=False))


def _fenced(code: str) -> Markup:
    """Text as a block of code, behind a fence longer than any run of the fence's sign in it."""
    longest = max((len(run) for run in re.findall(r"`+", code)), default=0)
    fence = "`" * max(3, longest + 1)
    return Markup(f"{fence}sh\n{code}\n{fence}")
