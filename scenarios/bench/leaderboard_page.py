"""The leaderboard as one HTML file that needs nothing else, and as Markdown."""

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from importlib import resources
from pathlib import Path

import matplotlib
from markupsafe import Markup

from hmtb_twin.files.atomic_write import write_whole
from scenarios.bench.leaderboard_drawings import DRAWINGS, add, work_precision
from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.leaderboard_rows import ORDERS_GIVEN, RULE, LeaderboardRow
from scenarios.bench.leaderboard_tables import (
    Table,
    by_problem,
    failing_of,
    failures,
    metric_names,
    metrics_of,
    standing,
    title,
    verdicts,
)
from scenarios.bench.leaderboard_verdict import GUIDE, MetricGuide, Verdict
from scenarios.estimators.estimator import METHODS
from scenarios.estimators.outcome import KINDS
from scenarios.report.figures import SETTINGS, Gallery, Picture
from scenarios.report.page import Page

UNKNOWN_METRIC = MetricGuide("", "This version of the page does not know this figure.", "")


@dataclass(frozen=True)
class MetricSection:
    """Section of the page on one metric.

    Attributes:
        mark: Its anchor.
        title: Title of the metric.
        guide: How to read it.
        false_alarm: Probability that a perfect estimator fails it, the largest of all rows.
        table: Its values by problem, where it has any.
        picture: Its drawing, where it has one.
    """

    mark: str
    title: str
    guide: MetricGuide
    false_alarm: float
    table: Table | None
    picture: Picture | None


def write_leaderboard(rows: Sequence[LeaderboardRow], folder: Path) -> tuple[Path, Path]:
    """Write both pages; files of these names are replaced.

    Args:
        rows: Estimators in their order, at least one.
        folder: Where; it exists.

    Returns:
        The HTML file and the Markdown file.

    Raises:
        OSError: One cannot be written.
    """
    variables = context(rows)
    html_file, markdown_file = folder / "leaderboard.html", folder / "leaderboard.md"
    write_whole(html_file, html(variables))
    write_whole(markdown_file, markdown(variables))
    return html_file, markdown_file


def context(rows: Sequence[LeaderboardRow]) -> dict[str, object]:
    """The variables of the templates: rows, tables, drawings and notes."""
    gallery = Gallery()
    with matplotlib.rc_context(SETTINGS):
        # Settings of the study's figures: text as paths, and equal figures as equal text.
        overview = add(gallery, work_precision(rows), "accuracy-and-time")
        sections = [_section(rows, name, gallery) for name in metric_names(rows)]
    return {
        "rule": RULE,
        "orders_given": ORDERS_GIVEN,
        "verdicts": list(Verdict),
        "kinds": KINDS,
        "methods": METHODS,
        "rows": rows,
        "notes": notes(rows),
        "standing": standing(rows),
        "table_of_verdicts": verdicts(rows),
        "failures": failures(rows),
        "overview": overview,
        "sections": sections,
        "profiles": [(row, metrics_of(row), failing_of(row)) for row in rows],
    }


def _section(rows: Sequence[LeaderboardRow], name: str, gallery: Gallery) -> MetricSection:
    """The section of one metric; its drawing goes to the gallery."""
    # A name that this version does not know is one of a result of another version.
    guide = GUIDE.get(name, UNKNOWN_METRIC)
    picture = add(gallery, DRAWINGS[name](rows), name) if name in DRAWINGS else None
    metrics = [row.result.metrics[name] for row in rows if name in row.result.metrics]
    return MetricSection(
        mark=f"figure-of-bench-{metric_names(rows).index(name) + 1}",
        title=title(rows, name),
        guide=guide,
        false_alarm=max(metric.false_alarm for metric in metrics),
        table=by_problem(rows, name),
        picture=picture,
    )


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
