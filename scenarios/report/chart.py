"""Charts: panels of curves in views to switch between.

A chart is data: for a page, where Plotly draws it in the browser, and for figures, which `chart_drawing` makes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise, product
from math import ceil, isfinite, log10
from typing import Any, Literal

import numpy as np

from sysid.plots import Style

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


DIGITS = 4
"""Digits of the numbers of a page: finer than a pixel."""

MOST_DIGITS = 16
"""Digits of a number in double precision."""

LARGEST = 1e100
"""Numbers from here on are left out of figures: the width of an axis to them would overflow."""

SMALLEST_SHARE = 1e-5
"""Lowest value on a logarithmic axis over the largest: errors without noise would take all room."""

RANGE_MARGIN = 1.3
"""Factor by which a logarithmic axis extends beyond its values, so that marks at its ends are whole."""


@dataclass(frozen=True, eq=False)
class Series:
    """A curve or a set of marks; values on an axis (N,) are numbers or names.

    Attributes:
        label: Name in the legend, where each stands once; entries of one name are switched together.
        style: Colour, line pattern and marker; without a line pattern, marks alone.
        low: Lower end of a band or of bars round each value (N,).
        kind: A line through the values, steps that hold each until the next, or a bar from zero to each.
        along: Whether low and high are ends of bars along the x axis; otherwise along the y axis.
        size: Diameter of marks in figures, points; those of the page are all of one size.
    """

    label: str
    x: Any
    y: Any
    style: Style
    low: Any = None
    high: Any = None
    kind: Literal["line", "step", "stem"] = "line"
    along: bool = False
    size: float = 4.0


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
        """The chart as plain lists and mappings: numbers to four digits of their range, equal lists of x once."""
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


def _log_range(values: Sequence[float]) -> tuple[float, float] | None:
    """Range of a logarithmic axis: the positive values (N,), with a margin, that are not lost below the largest.

    None where no value is positive.
    """
    numbers = np.asarray(values, dtype=float)
    positive = numbers[(numbers > 0.0) & (numbers < LARGEST)]
    if not positive.size:
        return None
    largest = float(positive.max())
    smallest = max(float(positive.min()), SMALLEST_SHARE * largest)
    return smallest / RANGE_MARGIN, largest * RANGE_MARGIN


def with_log_ranges(panels: Sequence[Panel], at_least: Sequence[float] = ()) -> list[Panel]:
    """Give logarithmic axes of all panels one range; values below it, such as 0, stand at its lower end.

    Args:
        panels: Panels that share their axes.
        at_least: Values that the range contains too.
    """
    series = list(chain.from_iterable(panel.series for panel in panels))
    ranged = list(panels)
    for axis in panels[0].log:
        values = list(at_least)
        for curve in series:
            values += [*getattr(curve, axis)]
            # Other bars may be far longer than the values differ, and end at the edge of the panel.
            if curve.along and axis == "x":
                values += [*curve.low, *curve.high]
        limits = _log_range(values)
        if limits is not None:
            ranged = [_on_range(panel, axis, limits) for panel in ranged]
    return ranged


def _on_range(panel: Panel, axis: str, limits: tuple[float, float]) -> Panel:
    raised = []
    for curve in panel.series:
        values = np.asarray(getattr(curve, axis), dtype=float)
        # An infinite value is no number to be drawn.
        on_range = np.where(np.isfinite(values), np.maximum(values, limits[0]), np.nan)
        moved: dict[str, Any] = {axis: on_range}
        raised.append(replace(curve, **moved))
    ranges: dict[str, Any] = {f"{axis}_limits": limits}
    return replace(panel, series=raised, **ranges)


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


def _json_values(values: Any) -> tuple[Any, ...] | None:
    """Values of an axis for the page, to four digits of their range; None where there are none."""
    if values is None:
        return None
    listed = np.asarray(values).ravel().tolist()
    digits = _digits([value for value in listed if not isinstance(value, str) and isfinite(value)])
    return tuple(_json_value(value, digits) for value in listed)


def _digits(numbers: Sequence[float]) -> int:
    """Digits of the largest number that show four of the difference between the largest and the smallest."""
    spread = max(numbers, default=0.0) - min(numbers, default=0.0)
    if spread == 0.0 or not isfinite(spread):
        return DIGITS
    largest = max(map(abs, numbers))
    return min(DIGITS + max(ceil(log10(largest / spread)), 0), MOST_DIGITS)


def _json_value(value: Any, digits: int = DIGITS) -> Any:
    """A name as it is, a number rounded; None for a number that is not finite, which JSON has no word for."""
    if isinstance(value, str):
        return value
    return float(f"{value:.{digits}g}") if isfinite(value) else None


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
    fields = dict(vars(series))
    del fields["size"]  # no concern of the page's
    plotly_style = {"colour": style.colour, "dash": dash, "width": style.width, "symbol": symbol}
    return {
        **fields,
        "x": x_numbers.setdefault(_json_values(series.x), len(x_numbers)),
        "y": _json_values(series.y),
        "low": _json_values(series.low),
        "high": _json_values(series.high),
        "style": plotly_style,
    }
