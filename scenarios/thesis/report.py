"""The report: one HTML file that needs nothing else."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from scenarios.crossing import half_power_hz
from scenarios.drawing import SETTINGS
from scenarios.errors import ScenarioError
from scenarios.thesis.about_1_hz import near_1_hz
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.gallery import Gallery
from scenarios.thesis.report_context import context
from scenarios.thesis.tally import Tally
from scenarios.thesis.wording import limits, minus, parts, root
from scenarios.whole_file import check_place, write_whole

Contents = tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
"""Parts of the page by heading, each with the marks and headings of its sections."""


def write_report(
    study: Comparison,
    findings: Sequence[Finding],
    path: Path,
    tally: Tally | None = None,
    *,
    figures: Path | None = None,
    drawn: Callable[[int], None] | None = None,
) -> Path:
    """Write the report.

    Args:
        study: The study.
        findings: The decided findings.
        path: The HTML file.
        tally: What many seeds concluded; without it the report says nothing of chance.
        figures: Folder for every figure as SVG and PNG too, which must exist; none are written if None.
        drawn: Called with the number of figures drawn after each.

    Returns:
        The path.

    Raises:
        ScenarioError: The file cannot be written.
    """
    check_place(path)
    if not path.parent.is_dir():
        raise ScenarioError(f"cannot write the report {str(path)!r}: there is no folder {str(path.parent)!r}")
    begin = perf_counter()
    with matplotlib.rc_context(SETTINGS):
        shown = context(study, findings, Gallery(figures, drawn), tally)
    shown["study"] = replace(study, cost=study.cost.later(perf_counter() - begin, report=True))
    try:
        write_whole(path, page(shown))
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


def page(shown: Mapping[str, object]) -> str:
    """The page as text.

    Args:
        shown: What the templates show, see `context`.
    """
    environment = _environment()
    body = signed(numbered(environment.get_template("body.html.j2").render(shown)))
    # On paper the answer comes first and then what else there is.
    opening, end, rest = body.partition("</section>")
    return environment.get_template("report.html.j2").render(
        shown, opening=Markup(opening + end), rest=Markup(rest), contents=contents(body)
    )


def numbered(body: str) -> str:
    """The page with its figures numbered as they stand on it, whatever the order in which they were drawn.

    Args:
        body: The page without its head, figures and links to them by the numbers of the gallery.
    """
    order = {old: str(new) for new, old in enumerate(re.findall(r'<figure id="figure-(\d+)"', body), 1)}
    pattern = r'(<figure id="figure-|href="#figure-|<figcaption>Figure |">figure )(\d+)(?=[".<])'
    return re.sub(pattern, lambda found: found[1] + order[found[2]], body)


def signed(body: str) -> str:
    """The page with true minus signs before its numbers, but for what is a drawing, code or inside a tag.

    Args:
        body: The page without its head.
    """
    pieces = re.split(r"(<svg\b.*?</svg>|<(?:pre|code)\b.*?</(?:pre|code)>|<[^>]*>)", body, flags=re.S)
    pieces[::2] = [re.sub(r"(?<![\w.)\]-])-(?=\d)", "−", text) for text in pieces[::2]]
    return "".join(pieces)


def contents(body: str) -> Contents:
    """The parts and sections of the page, read from the page itself so that no section can be left out.

    Args:
        body: The page without its head; a part begins with a paragraph of class `part`, a section with its heading.

    Returns:
        Parts in order; sections before the first part are in one without a name.
    """
    parts: list[tuple[str, list[tuple[str, str]]]] = [("", [])]
    pattern = r'<p class="part">(.*?)</p>|<section id="([^"]+)">\s*<h2>(.*?)</h2>'
    for part, mark, heading in re.findall(pattern, body, flags=re.S):
        if part:
            parts.append((Markup(part), []))
        else:
            parts[-1][1].append((mark, Markup(heading)))
    return tuple((name, tuple(sections)) for name, sections in parts if sections)


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("scenarios"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["si"] = lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}"
    environment.filters["parts"] = parts
    environment.filters["limits"] = limits
    environment.filters["minus"] = minus
    environment.filters["near"] = near_1_hz
    environment.filters["level"] = half_power_hz
    environment.filters["root"] = root
    environment.filters["words"] = lambda name: name.replace("_", " ")
    return environment
