"""The leaderboard as one HTML file that needs nothing else, and as Markdown."""

import re
from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib import resources
from pathlib import Path

from markupsafe import Markup

from hmtb_twin.files.atomic_write import write_whole
from scenarios.bench import leaderboard_tables, leaderboard_words
from scenarios.bench.leaderboard import Leaderboard
from scenarios.bench.leaderboard_drawings import pictures
from scenarios.bench.leaderboard_notes import notes
from scenarios.bench.metric import Verdict
from scenarios.estimators.estimator import METHODS
from scenarios.estimators.outcome import KINDS
from scenarios.report.page import Page


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
    """The variables of the templates, which take tables and words from their modules."""
    return {
        "board": board,
        "notes": notes(board),
        "pictures": pictures(board),
        "tables": leaderboard_tables,
        "words": leaderboard_words,
        "verdicts": list(Verdict),
        "kinds": KINDS,
        "methods": METHODS,
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
    return Page({"plain": _escaped, "fenced": _fenced}).render("leaderboard.md.j2", variables)


def _escaped(words: object) -> str:
    """Escape the signs of Markdown and HTML, so that a page shows the text as it is."""
    return re.sub(r"([\\`*_{}\[\]()#+!|~$])", r"\\\1", escape(str(words), quote=False))


def _fenced(code: str) -> Markup:
    """Text as a block of code, behind a fence longer than any run of the fence's sign in it."""
    longest = max((len(run) for run in re.findall(r"`+", code)), default=0)
    fence = "`" * max(3, longest + 1)
    return Markup(f"{fence}sh\n{code}\n{fence}")
