"""The report: one HTML file that needs nothing else."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from scenarios.files.atomic_write import check_place, write_whole
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.report.drawing import SETTINGS
from scenarios.report.figures import Gallery
from scenarios.report.page_text import contents, numbered, signed
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.report_context import context
from scenarios.thesis.tally import Tally
from scenarios.thesis.wording import limits, minus, parts, root
from sysid.models.bandwidth import half_power_hz


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
