"""Figures of the report: charts by name with captions, and the thesis' figures that they answer."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

from scenarios.files.toml_file import package_table
from scenarios.report.chart import Chart
from scenarios.report.figure_files import ReportFigure, thesis_numbers
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


@cache
def _table() -> Mapping[str, list[dict[str, str]]]:
    """Table of the figures: those of the report under `figure`, the thesis' without counterpart under `without`."""
    return package_table("report_figures.toml")


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
