"""Charts of the report: panels of curves in views to switch between, as data for the page and as drawings for files."""

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
SYMBOLS = {
    **{"o": "circle", "s": "square", "^": "triangle-up", "D": "diamond", "v": "triangle-down", "P": "cross"},
    **{"X": "x", "*": "star", ".": "circle", "h": "hexagon", "d": "diamond-tall", "x": "x-thin-open"},
}
"""Plotly's names of line patterns and markers."""

COLUMNS = 250
"""Columns of a long record: more than the eye resolves in a panel."""


@dataclass(frozen=True, eq=False)
class Series:
    """A curve or a set of marks; values on an axis (N,) are numbers or names.

    Attributes:
        label: Name in the legend, where each stands once; entries of one name are switched together.
        style: How it looks; without a line pattern, marks alone.
        low: Lower end of a band or of bars round each value (N,).
        kind: A line through the values, steps that hold each until the next, or a bar from zero to each.
        along: Whether low and high are ends in x, not in y.
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
        marks: Lines across: the axis that they stand on, x or y, the value there, a text.
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
        shared: dict[Any, int] = {}
        views = {
            "|".join(key): [
                # A mark at an unknown value has no place, and JSON has no word for it.
                {
                    **vars(panel),
                    "marks": [mark for mark in panel.marks if isfinite(mark[1])],
                    "series": [_series(entry, shared) for entry in panel.series],
                }
                for panel in panels
            ]
            for key, panels in self.views.items()
        }
        options = [list(dict.fromkeys(key[k] for key in self.views)) for k in range(len(self.choices))]
        return {
            "choices": list(zip(self.choices, options, strict=True)),
            "columns": self.columns,
            "height": self.height,
            "views": views,
            "x": [list(values) for values in shared],
        }


def by_view(draw: Callable[..., tuple[Panel, ...]], *options: Mapping[str, Any]) -> dict[tuple[str, ...], Any]:
    """Panels of every combination of options that has any, drawn with one value of each."""
    views = {
        tuple(name for name, _ in chosen): draw(*(value for _, value in chosen))
        for chosen in product(*(entry.items() for entry in options))
    }
    return {key: panels for key, panels in views.items() if panels}


def joints(study: Comparison) -> dict[str, JointResult]:
    """The joints by the names that people read."""
    return {short(name): entry for name, entry in study.joints.items()}


def chart_of(
    choices: Mapping[str, Mapping[str, Any] | Callable[[Comparison], Mapping[str, Any]]], **layout: int
) -> Callable[[Callable[..., tuple[Panel, ...]]], Callable[[Comparison], Chart]]:
    """Make a chart of a function that draws one view from the study and one option of each choice.

    The options of a choice are a table by name, or a function that takes it from the study.
    """

    def decorated(draw: Callable[..., tuple[Panel, ...]]) -> Callable[[Comparison], Chart]:
        @wraps(draw)
        def chart(study: Comparison) -> Chart:
            options = [of(study) if callable(of) else of for of in choices.values()]
            return Chart(by_view(partial(draw, study), *options), tuple(choices), **layout)

        return chart

    return decorated


def _numbers(values: Any) -> tuple[Any, ...] | None:
    if values is None:
        return None
    items = np.asarray(values).ravel().tolist()
    return tuple(
        value if isinstance(value, str) else (float(f"{value:.4g}") if isfinite(value) else None) for value in items
    )


def _series(entry: Series, shared: dict[Any, int]) -> dict[str, Any]:
    look = entry.style
    symbol = "" if look.line else SYMBOLS.get(look.marker, "circle")
    dash = DASHES.get(look.line, "longdashdot")
    return {
        **vars(entry),
        **{name: _numbers(getattr(entry, name)) for name in ("y", "low", "high")},
        "x": shared.setdefault(_numbers(entry.x), len(shared)),
        "style": {"colour": look.colour, "dash": dash, "width": look.width, "symbol": symbol},
    }


def draw(panels: Sequence[Panel], columns: int = 1, *, name_marks: bool = False) -> Figure:
    """Draw the panels of one view as a figure of a fixed size, for files; `name_marks` writes texts at lines across."""
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(WIDTH * max(1.0, 0.6 * columns), 0.6 + 2.3 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(panels) :]:
        axes.axis("off")
    handles: dict[str, Any] = {}
    for axes, panel in zip(grid, panels, strict=False):
        # Before anything is drawn: lines across the panel would else begin at 0.
        axes.set(**{f"{axis}scale": "log" for axis in panel.log})
        for entry in panel.series:
            handles.setdefault(entry.label, _draw_series(axes, entry))
        for axis, value, text in panel.marks:
            line = axes.axvline if axis == "x" else axes.axhline
            line(value, color=BOUND.colour, ls=":", lw=1.0, label=text)
            if name_marks:
                place = {"xy": (value, 1.0), "xycoords": axes.get_xaxis_transform(), "ha": "left", "va": "top"}
                if axis == "y":
                    place = {"xy": (1.0, value), "xycoords": axes.get_yaxis_transform(), "ha": "right", "va": "bottom"}
                axes.annotate(
                    text, xytext=(3 if axis == "x" else 0, 1), textcoords="offset points", fontsize=8, **place
                )
        axes.set(xlim=panel.x_limits, ylim=panel.y_limits)
        axes.set_xlabel(panel.x, fontsize=9)
        axes.set_ylabel(panel.y, fontsize=9)
        if "x" in panel.log and panel.x_limits:
            plain_marks(axes.xaxis, panel.x_limits)
        axes.set_aspect("equal") if panel.equal else None
        axes.set_title(panel.title, loc="left", fontsize=8.5)
    dress(grid[: len(panels)])
    figure.legend(
        handles.values(), handles.keys(), loc="outside upper left", ncols=max(columns, 2), frameon=False, fontsize=8
    )
    return figure


def _draw_series(axes: Axes, entry: Series) -> Any:
    look, x, y = entry.style, np.asarray(entry.x), np.asarray(entry.y)
    if entry.low is not None and look.line and not entry.along:
        axes.fill_between(x, np.asarray(entry.low), np.asarray(entry.high), color=look.colour, alpha=0.2, lw=0)
    elif entry.low is not None:
        lines = axes.hlines if entry.along else axes.vlines
        lines(y if entry.along else x, entry.low, entry.high, color=look.colour, lw=0.9)
    if entry.kind == "stem":
        axes.vlines(x, 0.0, y, color=look.colour, lw=look.width)
    steps: Any = "steps-post" if entry.kind == "step" else "default"
    marker = "" if look.line else look.marker
    (line,) = axes.plot(x, y, color=look.colour, ls=look.line, lw=look.width, marker=marker, ms=4, drawstyle=steps)
    return line


def record_series(
    label: str, values: np.ndarray, dt: float, style: Style, *, start: float = 0.0, held: bool = False
) -> Series:
    """A record (N,) over time, s: a long one as the band between minimum and maximum of each column.

    A short one is drawn as it is, as steps where it is `held`, as a command is.
    """
    if len(values) <= 2 * COLUMNS:
        return Series(label, start + dt * np.arange(len(values)), values, style, kind="step" if held else "line")
    edges = np.linspace(0, len(values) - 1, COLUMNS + 1).round().astype(int)
    # A column takes the first sample of the next with it, so that neighbours meet as the line through the samples does.
    parts = [values[a : b + 1] for a, b in pairwise(edges)]
    time = start + 0.5 * dt * (edges[:-1] + edges[1:])
    # fmin and fmax take the value that is known where others are missing.
    low, high = (np.array([find.reduce(part) for part in parts]) for find in (np.fmin, np.fmax))
    return Series(label, time, 0.5 * (low + high), Style(style.colour, "-", 0.6), low, high)
