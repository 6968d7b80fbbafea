"""Figures of records on one page that holds everything itself."""

from pathlib import Path

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.record_figures.record_figures import RecordFigures
from scenarios.report.chart_script import chart_script, compressed_plotly
from scenarios.report.page import Page

LEAD = (
    "Figures of the kinds of Morris’ thesis (NASA TM-110279) for one’s own record. Values stand under the pointer; a "
    "click on a name in a legend hides or shows it."
)


def write_figure_page(drawn: RecordFigures, path: Path, title: str, command: str) -> Path:
    """Write the page: the models with their fits, what is not drawn and why, and every figure with its caption.

    Args:
        drawn: The figures.
        path: The page.
        title: Its title.
        command: Command that gives the same figures.

    Raises:
        ScenarioError: The file cannot be written.
    """
    charts = {name: figure.chart for name, figure in drawn.figures.items()}
    context = {
        "title": title,
        "lead": LEAD,
        "warnings": drawn.warnings,
        "left_out": drawn.left_out,
        "tables": drawn.tables(),
        "figures": drawn.figures,
        "headings": drawn.headings,
        "command": command,
        "charts": chart_script(charts),
        "plotly": compressed_plotly(),
    }
    page = Page().render("record_figures.html.j2", context)
    try:
        write_whole(path, page)
    except OSError as error:
        raise ScenarioError(f"cannot write the page {str(path)!r}: {error.strerror}") from error
    return path
