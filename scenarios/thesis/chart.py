"""Charts of the report: panels of curves in views to switch between.

A chart is data for the report's page, which Plotly draws in the browser, and a Matplotlib figure for each file.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, wraps
from itertools import pairwise, product
from math import isfinite
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.report.figure_style import WIDTH, dress, plain_marks, short
from scenarios.thesis.comparison import Comparison, JointResult
from sysid.plots import BOUND, Style

DASHES = {"-": "solid", "--": "dash", "-.": "dashdot", ":": "dot", "": ""}
"""Plotly's names of Matplotlib's line patterns."""

SYMBOLS = {
    "o": "circle",
    "s": "square",
    "^": "triangle-up",
    "D": "diamond",
    "v": "triangle-down",
    "P": "cross",
    "X": "x",
    "*": "star",
    ".": "circle",
    "h": "hexagon",
    "d": "diamond-tall",
    "x": "x-thin-open",
}
"""Plotly's names of Matplotlib's markers."""

COLUMNS = 250
"""Columns that a long record is reduced to: more than the eye resolves in a panel."""


@dataclass(frozen=True, eq=False)
class Series:
    """A curve or a set of marks; values on an axis (N,) are numbers or names.

    Attributes:
        label: Name in the legend, where each stands once; entries of one name are switched together.
        style: Colour, line pattern and marker; without a line pattern, marks alone.
        low: Lower end of a band or of bars round each value (N,).
        kind: A line through the values, steps that hold each until the next, or a bar from zero to each.
        along: Whether low and high are ends of bars along the x axis; otherwise along the y axis.
    """

    label: str
    x: Any
    y: Any
    style: Style
    low: Any = None
    high: Any = None
    kind: Literal["line", "step", "stem"] = "line"
    along: bool = False


@dataclass(frozen=True, eq=False)
class Panel:
    """Axes, labelled with their units, with what is drawn on them.

    Attributes:
        log: Which axes are logarithmic.
        marks: Lines across the panel: the axis that each stands on, x or y, its value there and its name.
        equal: Whether a unit has the same length on both axes.
    """

    x: str
    y: str
    series: Sequence[Series]
    title: str = ""
    log: Literal["", "x", "y", "xy"] = ""
    x_limits: tuple[float, float] | None = None
    y_limits: tuple[float, float] | None = None
    marks: tuple[tuple[str, float, str], ...] = ()
    equal: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """Panels, one set for each view.

    Attributes:
        views: Panels by what was chosen; the first is shown first.
        choices: What can be chosen, such as the joint: one name for each part of a view's key.
        columns: Panels side by side where the page is wide enough, `height` pixels each.
    """

    views: Mapping[tuple[str, ...], tuple[Panel, ...]]
    choices: tuple[str, ...] = ("Joint",)
    columns: int = 1
    height: int = 250

    def data(self) -> dict[str, Any]:
        """The chart as plain lists and mappings: numbers to four digits, equal lists of x once."""
        # Numbers of the lists of x, in the order in which they are first met. Equal ones are one list: curves of a
        # panel share their x as a rule, and a page of many views stays small enough to send.
        x_numbers: dict[Any, int] = {}
        views: dict[str, list[dict[str, Any]]] = {}
        for key, panels in self.views.items():
            views["|".join(key)] = [_panel_data(panel, x_numbers) for panel in panels]
        choices = []
        for position, choice in enumerate(self.choices):
            options = list(dict.fromkeys(key[position] for key in self.views))
            choices.append((choice, options))
        return {
            "choices": choices,
            "columns": self.columns,
            "height": self.height,
            "views": views,
            "x": [list(values) for values in x_numbers],
        }


def by_view(draw: Callable[..., tuple[Panel, ...]], *options: Mapping[str, Any]) -> dict[tuple[str, ...], Any]:
    """Panels of every combination of options that has any, drawn with one value of each."""
    views: dict[tuple[str, ...], tuple[Panel, ...]] = {}
    for combination in product(*(choice.items() for choice in options)):
        names = tuple(name for name, _ in combination)
        values = [value for _, value in combination]
        panels = draw(*values)
        # A combination without data, such as a method that a joint has no model of, is no view.
        if panels:
            views[names] = panels
    return views


def joints(study: Comparison) -> dict[str, JointResult]:
    """Results of the joints by their names in figures: the options of a chart's choice of joint."""
    return {short(name): result for name, result in study.joints.items()}


def chart_of(
    choices: Mapping[str, Mapping[str, Any] | Callable[[Comparison], Mapping[str, Any]]], **layout: int
) -> Callable[[Callable[..., tuple[Panel, ...]]], Callable[[Comparison], Chart]]:
    """Make a chart of a function that draws one view from the study and one option of each choice.

    The options of a choice are a table by name, or a function that takes it from the study.
    """

    def decorated(draw: Callable[..., tuple[Panel, ...]]) -> Callable[[Comparison], Chart]:
        @wraps(draw)
        def chart(study: Comparison) -> Chart:
            options = []
            for table in choices.values():
                options_of_choice = table(study) if callable(table) else table
                options.append(options_of_choice)
            return Chart(by_view(partial(draw, study), *options), tuple(choices), **layout)

        return chart

    return decorated


def _json_values(values: Any) -> tuple[Any, ...] | None:
    """Values of an axis for the page; None where there are none."""
    if values is None:
        return None
    return tuple(_json_value(value) for value in np.asarray(values).ravel().tolist())


def _json_value(value: Any) -> Any:
    """A name as it is, a number to four digits; None for a number that is not finite, which JSON has no word for."""
    if isinstance(value, str):
        return value
    # Four digits are finer than a pixel of the page.
    return float(f"{value:.4g}") if isfinite(value) else None


def _panel_data(panel: Panel, x_numbers: dict[Any, int]) -> dict[str, Any]:
    """A panel as a mapping for the page; its series refer to lists of x by `x_numbers`, which grows by new ones."""
    return {
        **vars(panel),
        # A mark at an unknown value has no place, and JSON has no word for it.
        "marks": [(axis, value, name) for axis, value, name in panel.marks if isfinite(value)],
        "series": [_series_data(series, x_numbers) for series in panel.series],
    }


def _series_data(series: Series, x_numbers: dict[Any, int]) -> dict[str, Any]:
    """A series as a mapping, its style in Plotly's names; see `_panel_data`."""
    style = series.style
    # Other patterns than those of the table are given by lengths, which have no name.
    dash = DASHES.get(style.line, "longdashdot")
    symbol = "" if style.line else SYMBOLS.get(style.marker, "circle")
    plotly_style = {"colour": style.colour, "dash": dash, "width": style.width, "symbol": symbol}
    return {
        **vars(series),
        "x": x_numbers.setdefault(_json_values(series.x), len(x_numbers)),
        "y": _json_values(series.y),
        "low": _json_values(series.low),
        "high": _json_values(series.high),
        "style": plotly_style,
    }


def draw(panels: Sequence[Panel], columns: int = 1, *, name_marks: bool = False) -> Figure:
    """Draw the panels of one view as a figure of a fixed size, for files; `name_marks` writes texts at lines across."""
    rows = -(-len(panels) // columns)  # rounded up
    figure = Figure(figsize=(WIDTH * max(1.0, 0.6 * columns), 0.6 + 2.3 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.axis("off")
    # One legend for all panels: each label stands there once, with the first line of that name.
    handles: dict[str, Any] = {}
    # The last row of the grid may have places without a panel.
    for axes, panel in zip(grid, panels, strict=False):
        for label, line in _draw_panel(axes, panel, name_marks=name_marks):
            handles.setdefault(label, line)
    dress(grid[: len(panels)])
    figure.legend(
        handles.values(), handles.keys(), loc="outside upper left", ncols=max(columns, 2), frameon=False, fontsize=8
    )
    return figure


def _draw_panel(axes: Axes, panel: Panel, *, name_marks: bool) -> list[tuple[str, Any]]:
    """Draw one panel; return the lines of its series with their labels."""
    # Before anything is drawn: lines across the panel would else begin at 0.
    axes.set(**{f"{axis}scale": "log" for axis in panel.log})
    lines = [(series.label, _draw_series(axes, series)) for series in panel.series]
    for mark in panel.marks:
        _draw_mark(axes, mark, named=name_marks)
    axes.set(xlim=panel.x_limits, ylim=panel.y_limits)
    axes.set_xlabel(panel.x, fontsize=9)
    axes.set_ylabel(panel.y, fontsize=9)
    if "x" in panel.log and panel.x_limits:
        plain_marks(axes.xaxis, panel.x_limits)
    if panel.equal:
        axes.set_aspect("equal")
    axes.set_title(panel.title, loc="left", fontsize=8.5)
    return lines


def _draw_mark(axes: Axes, mark: tuple[str, float, str], *, named: bool) -> None:
    """Draw a line across the panel; where it is named, its text stands at the panel's upper or right edge."""
    axis, value, name = mark
    draw_line = axes.axvline if axis == "x" else axes.axhline
    draw_line(value, color=BOUND.colour, ls=":", lw=1.0, label=name)
    if not named:
        return
    place: dict[str, Any]
    if axis == "x":
        offset = (3, 1)
        place = {"xy": (value, 1.0), "xycoords": axes.get_xaxis_transform(), "ha": "left", "va": "top"}
    else:
        offset = (0, 1)
        place = {"xy": (1.0, value), "xycoords": axes.get_yaxis_transform(), "ha": "right", "va": "bottom"}
    axes.annotate(name, xytext=offset, textcoords="offset points", fontsize=8, **place)


def _draw_series(axes: Axes, series: Series) -> Any:
    """Draw one series with its band, bars or stems; return its line, which the legend shows."""
    style, x, y = series.style, np.asarray(series.x), np.asarray(series.y)
    colour = style.colour
    if series.low is not None:
        if series.along:
            axes.hlines(y, series.low, series.high, color=colour, lw=0.9)
        elif style.line:
            axes.fill_between(x, np.asarray(series.low), np.asarray(series.high), color=colour, alpha=0.2, lw=0)
        else:
            axes.vlines(x, series.low, series.high, color=colour, lw=0.9)
    if series.kind == "stem":
        axes.vlines(x, 0.0, y, color=colour, lw=style.width)
    steps: Any = "steps-post" if series.kind == "step" else "default"
    # Styles of the palette have a marker too; curves are drawn without.
    marker = "" if style.line else style.marker
    (line,) = axes.plot(x, y, color=colour, ls=style.line, lw=style.width, marker=marker, ms=4, drawstyle=steps)
    return line


def record_series(
    label: str, values: np.ndarray, dt: float, style: Style, *, start: float = 0.0, held: bool = False
) -> Series:
    """Series of a record (N,) over time, s: a long one is the band between minimum and maximum of each column.

    A short one is drawn as it is, as steps where it is `held`, as a command is.
    """
    if len(values) <= 2 * COLUMNS:
        kind: Literal["line", "step"] = "step" if held else "line"
        return Series(label, start + dt * np.arange(len(values)), values, style, kind=kind)
    edges = np.linspace(0, len(values) - 1, COLUMNS + 1).round().astype(int)
    # A column takes the first sample of the next with it, so that neighbours meet as the line through the samples does.
    column_values = [values[first : last + 1] for first, last in pairwise(edges)]
    time = start + 0.5 * dt * (edges[:-1] + edges[1:])
    # fmin and fmax, unlike min and max, take the value that is known where others are missing.
    low = np.array([np.fmin.reduce(samples) for samples in column_values])
    high = np.array([np.fmax.reduce(samples) for samples in column_values])
    return Series(label, time, 0.5 * (low + high), Style(style.colour, "-", 0.6), low, high)
