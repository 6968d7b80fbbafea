"""The leaderboard as one HTML file that needs nothing else, and as Markdown."""

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib import resources
from math import inf
from pathlib import Path

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from scenarios.bench.leaderboard_drawings import drawing, overview
from scenarios.bench.leaderboard_notes import notes, runs
from scenarios.bench.leaderboard_rows import RULE, LeaderboardRow
from scenarios.bench.leaderboard_tables import (
    Table,
    by_problem,
    failures,
    metric_names,
    profile,
    standing,
    title,
    verdicts,
)
from scenarios.bench.leaderboard_verdict import GUIDE, MetricGuide, Verdict
from scenarios.files.atomic_write import write_whole
from scenarios.report.figures import SETTINGS, Gallery, Picture
from scenarios.report.page import Page

UNKNOWN_METRIC = MetricGuide("", "This version of the page does not know this figure.", "")


@dataclass(frozen=True)
class MetricSection:
    """A metric of the bench on the page.

    Attributes:
        mark: Anchor.
        title: Heading.
        guide: How to read it.
        false_alarm: The largest probability with which a perfect estimator fails it in one of these runs.
        table: Its numbers by problem, or None.
        picture: Its drawing, or None.
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
    shown = context(rows)
    page, text = folder / "leaderboard.html", folder / "leaderboard.md"
    write_whole(page, html(shown))
    write_whole(text, markdown(shown))
    return page, text


def context(rows: Sequence[LeaderboardRow]) -> dict[str, object]:
    """The variables of the templates: tables, drawings, notes and profiles."""
    gallery = Gallery()
    with matplotlib.rc_context(SETTINGS):
        return {
            "rule": RULE,
            "verdicts": list(Verdict),
            "infinity": inf,
            "rows": rows,
            "notes": notes(rows),
            "together": len(runs(rows)),
            "standing": standing(rows),
            "table_of_verdicts": verdicts(rows),
            "failures": failures(rows),
            "overview": overview(rows, gallery),
            "sections": [
                MetricSection(
                    mark=f"figure-of-bench-{number}",
                    title=title(rows, name),
                    guide=GUIDE.get(name, UNKNOWN_METRIC),
                    false_alarm=max((m.false_alarm for row in rows if (m := row.metric(name))), default=0.0),
                    table=by_problem(rows, name),
                    picture=drawing(rows, name, gallery),
                )
                for number, name in enumerate(metric_names(rows), 1)
            ],
            "profiles": [profile(row) for row in rows],
        }


def html(shown: dict[str, object]) -> str:
    """The HTML page."""
    page = Page()
    body = page.render("leaderboard_body.html.j2", shown)
    script = resources.files("scenarios").joinpath("templates/leaderboard.js").read_text(encoding="utf-8")
    # No other script runs on the page, whatever a result file holds.
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    return page.render("leaderboard.html.j2", {**shown, "body": body, "script": Markup(script), "digest": digest})


def markdown(shown: dict[str, object]) -> str:
    """The Markdown page: tables and words, no drawings."""
    environment = Environment(
        loader=PackageLoader("scenarios"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["plain"] = plain_markdown
    environment.filters["fenced"] = fenced
    return environment.get_template("leaderboard.md.j2").render(shown)


def plain_markdown(text: str) -> str:
    """Text without the signs of Markdown, nor of HTML inside it."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\`*_{}\[\]()#+!|~$])", r"\\\1", text)


def fenced(text: str) -> str:
    """Text as a block of code, behind a fence longer than any run of the fence's sign in it."""
    longest = max((len(run) for run in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}sh\n{text}\n{fence}"
