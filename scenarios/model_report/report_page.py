"""Report of one identified model as a page that holds everything itself."""

from pathlib import Path

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.identification.file_identification import FileIdentification
from scenarios.identification.result_tables import result_tables
from scenarios.model_report.charts import model_charts
from scenarios.model_report.plain_english import summary
from scenarios.report.chart_script import chart_script, compressed_plotly
from scenarios.report.page import Page


def write_model_report(found: FileIdentification, path: Path, command: str, python: str) -> Path:
    """Write the report: the verdict first, the model, charts with values under the pointer, and tables.

    Args:
        found: The model.
        path: The page.
        command: Command that gives the same model.
        python: Call that does.

    Raises:
        ScenarioError: The file cannot be written.
    """
    charts = model_charts(found.result)
    main, *tables = result_tables(found)
    scripts = {
        "charts": chart_script({name: labelled.chart for name, labelled in charts.items()}),
        "plotly": compressed_plotly(),
    }
    context = {
        "title": main.title,
        "summary": summary(found),
        # the verdict stands above
        "rows": [row for row in main.rows if row[0] != "verdict"],
        "tables": tables,
        "figures": charts,
        "warnings": found.warnings,
        "command": command,
        "python": python,
        **scripts,
    }
    page = Page().render("model_report.html.j2", context)
    try:
        write_whole(path, page)
    except OSError as error:
        raise ScenarioError(f"cannot write the report {str(path)!r}: {error.strerror}") from error
    return path
