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
from scenarios.report.figures import SETTINGS, save_figure
from scenarios.thesis import model_charts, record_charts, response_charts
from scenarios.thesis.answer import Answer, answer_chart
from scenarios.thesis.chart import Chart, draw
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.control_section import control_chart
from scenarios.thesis.every_joint_section import every_joint
from scenarios.thesis.motion_section import motion_chart

CHARTS: Mapping[str, Callable[[Comparison], Chart]] = {
    function.__name__: function
    for function in (
        *(record_charts.waveforms, record_charts.records, record_charts.outputs, record_charts.residuals),
        *(record_charts.correlations, record_charts.observers, record_charts.several),
        *(response_charts.responses, response_charts.transfer_function, response_charts.four_spectra),
        *(response_charts.roots, response_charts.coupling),
        *(model_charts.data_sets, model_charts.orders, model_charts.disturbed, every_joint),
    )
}
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
    return package_table("report_figures.toml")


def thesis_numbers(text: str) -> tuple[str, ...]:
    """Numbers of thesis figures, such as `11-13 A2`, one by one."""
    numbers = []
    for letter, first, last in re.findall(r"(A?)(\d+)(?:-A?(\d+))?", text):
        numbers += [f"{letter}{number}" for number in range(int(first), int(last or first) + 1)]
    return tuple(numbers)


def without_counterpart() -> tuple[tuple[tuple[str, ...], str], ...]:
    """Figures of the thesis that have no counterpart in the report, with the reason."""
    return tuple((thesis_numbers(entry["thesis"]), entry["reason"]) for entry in _table()["without"])


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
    charts = {**CHARTS, "answer": lambda _: answer_chart(answer), "motion": lambda _: motion_chart(motion)}
    charts["control"] = lambda _: control_chart()
    figures: dict[str, ReportFigure] = {}
    entries = _table()["figure"]
    for number, entry in enumerate(entries, start=1):
        name = entry["chart"]
        chart = charts[name](study)
        if chart.views:
            figures[name] = ReportFigure(name, chart, entry["caption"], thesis_numbers(entry["thesis"]))
        if progress is not None:
            progress(number, len(entries))
    return figures


def write_figures(figures: Iterable[ReportFigure], folder: Path) -> None:
    """Write every view of every figure as SVG and PNG, and the figure's values as CSV, into an existing folder."""
    with matplotlib.rc_context(SETTINGS):
        for figure in figures:
            text = io.StringIO()
            rows = csv.writer(text, lineterminator="\n")
            rows.writerow([*figure.chart.choices, "panel", "x axis", "y axis", "curve", "x", "y", "low", "high"])
            for key, panels in figure.chart.views.items():
                name = re.sub(r"[^a-z0-9]+", "-", " ".join((figure.name, *key)).lower()).strip("-")
                drawing = draw(panels, figure.chart.columns)
                for kind in ("svg", "png"):
                    save_figure(drawing, folder / f"{name}.{kind}", dpi=150)
                for number, panel in enumerate(panels, start=1):
                    for one in panel.series:
                        ends = (() if end is None else end for end in (one.low, one.high))
                        for values in zip_longest(one.x, one.y, *ends):
                            rows.writerow([*key, panel.title or number, panel.x, panel.y, one.label, *values])
            write_whole(folder / f"{figure.name}.csv", text.getvalue())
