"""HTML report of the study: one page, and the tables that are too long for it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from hmtb_twin.files.atomic_write import check_place, write_whole
from scenarios.files.errors import ScenarioError
from scenarios.identification.recovered_bandwidth import near_1_hz
from scenarios.report.chart_script import chart_script, compressed_plotly
from scenarios.report.figure_files import write_figures
from scenarios.report.page import Page
from scenarios.thesis.answer import Answer
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.finding import Finding
from scenarios.thesis.long_tables import LongTables
from scenarios.thesis.monte_carlo import Spread, Tally
from scenarios.thesis.number_text import measure, number, parts, root, value_text
from scenarios.thesis.report_contents import ReportContents, report_contents
from sysid.models.bandwidth import half_power_hz


def write_report(
    study: Comparison,
    findings: Sequence[Finding],
    answer: Answer,
    path: Path,
    tally: Tally | None = None,
    *,
    figures: Path | None = None,
    motion: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write the report, and its long tables as CSV files in the folder `tables` beside it; return its path.

    Without a `tally`, the conclusions of many seeds, it does not speak of chance; without `motion`, the record of
    `hmtb motion`, it shows that of the package. `figures` is an existing folder for every figure as SVG, PNG and CSV;
    `progress` is called with the figures made and those in all.

    Raises:
        ScenarioError: The file cannot be written.
    """
    check_place(path)
    # Before the figures, which take a minute.
    if not path.parent.is_dir():
        raise ScenarioError(f"cannot write the report {str(path)!r}: there is no folder {str(path.parent)!r}")
    begin = perf_counter()
    contents = report_contents(study, findings, answer, tally, motion=motion, progress=progress)
    # Nearly all the time of a report goes into its figures, which are made by now: the page can show its own cost.
    cost = study.cost.later(perf_counter() - begin, report=True)
    page, tables = html(replace(contents, study=replace(study, cost=cost)))
    try:
        # The page comes last: it links the tables.
        tables.write(path.parent / "tables")
        if figures is not None:
            write_figures(contents.figures.values(), figures)
        write_whole(path, page)
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path


def limits(spread: Spread | None, finding: Finding) -> str:
    """Return the range of a finding's number over the seeds, in brackets; empty where it does not move."""
    if spread is None or spread.low == spread.high or np.isnan(spread.low):
        return ""
    # Counts beside probabilities: a count of 0 is no probability that was too small.
    if float(spread.low).is_integer() and spread.high >= 1.0:
        return f"({number(spread.low)} – {number(spread.high)})"
    return f"({measure(spread.low, finding)} – {measure(spread.high, finding)})"


def si(value: float, digits: int = 4) -> str:
    """A number of some unit to so many significant digits; a dash where there is none."""
    return f"{value:.{digits}g}" if np.isfinite(value) else "–"


def hz(value: float) -> str:
    """A frequency, Hz; `none` where the gain never falls so far."""
    return f"{value:.3f}" if np.isfinite(value) else "none"


def html(contents: ReportContents) -> tuple[str, LongTables]:
    """The page as text, and the tables that are too long for it."""
    tables = LongTables()
    filters: dict[str, Callable[..., object]] = {
        "si": si,
        "hz": hz,
        "parts": parts,
        "limits": limits,
        "near": near_1_hz,
        "level": half_power_hz,
        "root": root,
        "value": value_text,
        "words": lambda name: name.replace("_", " "),
        "csv": tables.take,
    }
    page = Page(filters)
    charts = chart_script({name: figure.chart for name, figure in contents.figures.items()})
    fields = vars(contents)
    # On paper the answer comes first and then the contents, which are known once all sections are rendered.
    answer = page.render("answer.html.j2", fields)
    body = page.render("body.html.j2", fields)
    scripts = {"charts": charts, "plotly": compressed_plotly()}
    return page.render("report.html.j2", {**fields, **scripts, "answer": answer, "body": body}), tables
