"""The leaderboard as one HTML file that needs nothing else, and as Markdown."""

import math
import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib import resources
from pathlib import Path

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from scenarios.bench.leaderboard_comparable import notes, runs
from scenarios.bench.leaderboard_drawings import overview
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_figure_sections import FigureSection, figure_sections
from scenarios.bench.leaderboard_profile import Profile, profile
from scenarios.bench.leaderboard_ranking import RULE
from scenarios.bench.leaderboard_table import Table
from scenarios.bench.leaderboard_tables import failures, standing, verdicts
from scenarios.bench.leaderboard_verdict import ORDER
from scenarios.files.atomic_write import write_whole
from scenarios.report.drawing import SETTINGS
from scenarios.report.figures import Gallery, Picture
from scenarios.report.page_text import contents, numbered, signed

PAGE = "leaderboard.html"
TEXT = "leaderboard.md"


@dataclass(frozen=True)
class Shown:
    """What the page shows.

    Attributes:
        entries: Estimators in their order.
        notes: Where rows are not comparable.
        together: How many runs the rows are of.
        standing: The first table.
        verdicts: Verdicts by figure.
        failures: Failures by kind.
        overview: Accuracy against speed, or None.
        sections: The figures.
        profiles: The estimators.
    """

    entries: tuple[Entry, ...]
    notes: tuple[str, ...]
    together: int
    standing: Table
    verdicts: Table
    failures: Table
    overview: Picture | None
    sections: tuple[FigureSection, ...]
    profiles: tuple[Profile, ...]


def gather(entries: Sequence[Entry], gallery: Gallery) -> Shown:
    """Make tables and draw figures."""
    with matplotlib.rc_context(SETTINGS):
        return Shown(
            entries=tuple(entries),
            notes=tuple(notes(entries)),
            together=len(runs(entries)),
            standing=standing(entries),
            verdicts=verdicts(entries),
            failures=failures(entries),
            overview=overview(entries, gallery),
            sections=tuple(figure_sections(entries, gallery)),
            profiles=tuple(map(profile, entries)),
        )


def write_leaderboard(entries: Sequence[Entry], folder: Path) -> tuple[Path, Path]:
    """Write both pages; files of these names are replaced.

    Args:
        entries: Estimators in their order, at least one.
        folder: Where; it exists.

    Returns:
        The HTML file and the Markdown file.

    Raises:
        OSError: One cannot be written.
    """
    found = gather(entries, Gallery())
    page, text = folder / PAGE, folder / TEXT
    write_whole(page, html(found))
    write_whole(text, markdown(found))
    return page, text


def html(found: Shown) -> str:
    """The HTML page."""
    script = resources.files("scenarios").joinpath("templates/leaderboard.js").read_text(encoding="utf-8")
    environment = _environment(autoescape=True)
    shared = {"shown": found, "rule": RULE, "verdicts": ORDER}
    body = signed(numbered(environment.get_template("leaderboard_body.html.j2").render(shared)))
    # No other script runs on the page, whatever stands in a result.
    digest = b64encode(sha256(script.encode()).digest()).decode("ascii")
    return environment.get_template("leaderboard.html.j2").render(
        shared, body=Markup(body), contents=contents(body), script=Markup(script), digest=digest
    )


def markdown(found: Shown) -> str:
    """The Markdown page: tables and words, no drawings."""
    environment = _environment(autoescape=False)
    return environment.get_template("leaderboard.md.j2").render(shown=found, rule=RULE, verdicts=ORDER)


def plain_markdown(text: str) -> str:
    """Text in which Markdown, and HTML inside it, see no signs of theirs."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\`*_{}\[\]()#+!|~$])", r"\\\1", text)


def fenced(text: str) -> str:
    """Text as a block of code, behind a fence longer than any run of the fence's sign in it."""
    longest = max((len(run) for run in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}sh\n{text}\n{fence}"


def _environment(*, autoescape: bool) -> Environment:
    environment = Environment(
        loader=PackageLoader("scenarios"),
        autoescape=autoescape,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals["infinity"] = math.inf
    environment.filters["plain"] = plain_markdown
    environment.filters["fenced"] = fenced
    return environment
