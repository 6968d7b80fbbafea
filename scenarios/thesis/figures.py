"""Figures of the report: charts by name with captions, the thesis' figures that they answer, and their files."""

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import zip_longest
from pathlib import Path
from typing import Any

import matplotlib

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.toml_file import package_table
from scenarios.report.chart import Chart
from scenarios.report.chart_drawing import draw
from scenarios.report.figures import SETTINGS, save_figure
from scenarios.thesis import model_charts, record_charts, response_charts
from scenarios.thesis.answer import Answer, answer_chart
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.control_section import control_chart
from scenarios.thesis.every_joint_section import every_joint
from scenarios.thesis.motion_section import motion_chart

_DRAWING_FUNCTIONS: tuple[Callable[[Comparison], Chart], ...] = (
    record_charts.waveforms,
    record_charts.records,
    record_charts.outputs,
    record_charts.residuals,
    record_charts.correlations,
    record_charts.observers,
    record_charts.several,
    response_charts.responses,
    response_charts.transfer_function,
    response_charts.four_spectra,
    response_charts.roots,
    response_charts.coupling,
    model_charts.data_sets,
    model_charts.orders,
    model_charts.disturbed,
    every_joint,
)

CHARTS: Mapping[str, Callable[[Comparison], Chart]] = {draw.__name__: draw for draw in _DRAWING_FUNCTIONS}
"""Functions that draw the figures of `report_figures.toml`, but for those of the answer, the motion and the control."""


@dataclass(frozen=True, eq=False)
class ReportFigure:
    """A figure of the report, named as in templates and as its files, with the thesis' figures that show the same."""

    name: str
    chart: Chart
    caption: str
    thesis: tuple[str, ...] = ()


@cache
def _table() -> Mapping[str, list[dict[str, str]]]:
    """Table of the figures: those of the report under `figure`, the thesis' without counterpart under `without`."""
    return package_table("report_figures.toml")


def thesis_numbers(text: str) -> tuple[str, ...]:
    """Numbers of thesis figures, such as `11-13 A2`, one by one; A marks those of the appendix."""
    figure_numbers: list[str] = []
    # A letter before the first number of a range holds for all of it: A7-A10.
    for letter, first, last in re.findall(r"(A?)(\d+)(?:-A?(\d+))?", text):
        figures = range(int(first), int(last or first) + 1)
        figure_numbers += [f"{letter}{figure}" for figure in figures]
    return tuple(figure_numbers)


def without_counterpart() -> tuple[tuple[tuple[str, ...], str], ...]:
    """Figures of the thesis that have no counterpart in the report, with the reason."""
    return tuple((thesis_numbers(row["thesis"]), row["reason"]) for row in _table()["without"])


def report_figures(
    study: Comparison,
    answer: Answer,
    progress: Callable[[int, int], None] | None = None,
    *,
    motion: Sequence[Mapping[str, Any]] = (),
) -> dict[str, ReportFigure]:
    """Every figure of the table for which the study has data, by name.

    `motion` has the cells of the map of `hmtb motion`; `progress` is called with the figures made and those in all.
    """
    # Those that need more than the study, or less, take what they need from here.
    charts = {**CHARTS, "answer": lambda _: answer_chart(answer), "motion": lambda _: motion_chart(motion)}
    charts["control"] = lambda _: control_chart()
    figures: dict[str, ReportFigure] = {}
    rows = _table()["figure"]
    for figures_done, row in enumerate(rows, start=1):
        name = row["chart"]
        chart = charts[name](study)
        # Without views: a study that is not thorough lacks what some figures show.
        if chart.views:
            figures[name] = ReportFigure(name, chart, row["caption"], thesis_numbers(row["thesis"]))
        if progress is not None:
            progress(figures_done, len(rows))
    return figures


def write_figures(figures: Iterable[ReportFigure], folder: Path) -> None:
    """Write every view of every figure as SVG and PNG, and the figure's values as CSV, into an existing folder."""
    # The settings write text as paths and give elements of SVG fixed names: equal figures are equal files.
    with matplotlib.rc_context(SETTINGS):
        for figure in figures:
            for choice, panels in figure.chart.views.items():
                file_name = _file_name(figure.name, choice)
                drawing = draw(panels, figure.chart.columns)
                save_figure(drawing, folder / f"{file_name}.svg", dpi=150)
                save_figure(drawing, folder / f"{file_name}.png", dpi=150)
            write_whole(folder / f"{figure.name}.csv", _values_csv(figure))


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
