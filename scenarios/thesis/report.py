"""The report: one HTML file that needs nothing else."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import matplotlib
import numpy as np

from scenarios.files.atomic_write import check_place, write_whole
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.report.figures import SETTINGS, Gallery
from scenarios.report.page import Page
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.report_context import context
from scenarios.thesis.tally import Tally
from scenarios.thesis.wording import limits, parts, root
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
        write_whole(path, html(shown))
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


def html(shown: Mapping[str, object]) -> str:
    """The page as text.

    Args:
        shown: Variables of the templates, see `context`.
    """
    page = Page(
        {
            "si": lambda value, digits=4: "–" if not np.isfinite(value) else f"{value:.{digits}g}",
            "parts": parts,
            "limits": limits,
            "near": near_1_hz,
            "level": half_power_hz,
            "root": root,
            "words": lambda name: name.replace("_", " "),
        }
    )
    # On paper the answer comes first and then the contents, which are known once all sections are rendered.
    answer = page.render("answer.html.j2", shown)
    body = page.render("body.html.j2", shown)
    return page.render("report.html.j2", {**shown, "answer": answer, "body": body})
