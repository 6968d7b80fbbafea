"""Figures as files: every view of a chart as SVG or PNG, and its values as CSV."""

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import matplotlib

from hmtb_twin.files.atomic_write import write_whole
from scenarios.report.chart import Chart
from scenarios.report.chart_drawing import draw
from scenarios.report.figures import SETTINGS, save_figure

FORMATS = ("svg", "png", "csv")
"""Formats of figures: drawings, and the values of their curves."""

LEAST_ROW = 2.3
"""Least height of a row of panels in a file, inch."""

PIXELS_PER_INCH = 100.0
"""Pixels of a page that are drawn as an inch: letters of both then have the same size beside the panels."""


@dataclass(frozen=True, eq=False)
class ReportFigure:
    """A figure of a page, named as in templates and as its files, with the thesis' figures that show the same."""

    name: str
    chart: Chart
    caption: str
    thesis: tuple[str, ...] = ()


def thesis_numbers(text: str) -> tuple[str, ...]:
    """Numbers of thesis figures, such as `11-13 A2`, one by one; A marks those of the appendix."""
    figure_numbers: list[str] = []
    # A letter before the first number of a range holds for all of it: A7-A10.
    for letter, first, last in re.findall(r"(A?)(\d+)(?:-A?(\d+))?", text):
        figures = range(int(first), int(last or first) + 1)
        figure_numbers += [f"{letter}{figure}" for figure in figures]
    return tuple(figure_numbers)


def write_figures(figures: Iterable[ReportFigure], folder: Path, formats: Sequence[str] = FORMATS) -> list[Path]:
    """Write every view of every figure as SVG and PNG, and the figure's values as CSV, into an existing folder.

    Args:
        figures: The figures.
        folder: The folder.
        formats: Which of `FORMATS` are written.

    Returns:
        The files.
    """
    drawn = [ending for ending in ("svg", "png") if ending in formats]
    files: list[Path] = []
    # The settings write text as paths and give elements of SVG fixed names: equal figures are equal files.
    with matplotlib.rc_context(SETTINGS):
        for figure in figures:
            for choice, panels in figure.chart.views.items():
                if not drawn:
                    break
                file_name = _file_name(figure.name, choice)
                drawing = draw(panels, figure.chart.columns, row_height=_row_height(figure.chart), name_marks=True)
                for ending in drawn:
                    files.append(folder / f"{file_name}.{ending}")
                    save_figure(drawing, files[-1], dpi=150)
            if "csv" in formats:
                files.append(folder / f"{figure.name}.csv")
                write_whole(files[-1], _values_csv(figure))
    return files


def _row_height(chart: Chart) -> float:
    """Height of a row of panels, inch: that of the page where it is high, as a map that is as high as wide."""
    return max(LEAST_ROW, chart.height / PIXELS_PER_INCH)


def _file_name(figure_name: str, choice: tuple[str, ...]) -> str:
    """Name of the file of one view: small letters, digits and hyphens, which every file system takes."""
    words = " ".join((figure_name, *choice)).lower()
    return re.sub(r"[^a-z0-9]+", "-", words).strip("-")


def _values_csv(figure: ReportFigure) -> str:
    """Values of all curves of a figure, one point a row."""
    text = io.StringIO()
    # The module's own default is the line end of Windows, on every system.
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow([*figure.chart.choices, "panel", "x axis", "y axis", "curve", "x", "y", "low", "high"])
    for choice, panels in figure.chart.views.items():
        for panel_number, panel in enumerate(panels, start=1):
            panel_name = panel.title or panel_number
            for series in panel.series:
                curve = [*choice, panel_name, panel.x, panel.y, series.label]
                low = () if series.low is None else series.low
                high = () if series.high is None else series.high
                # Cells stay empty where a curve has no band.
                for point in zip_longest(series.x, series.y, low, high):
                    rows.writerow([*curve, *point])
    return text.getvalue()
