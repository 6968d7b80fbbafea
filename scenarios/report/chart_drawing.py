"""Charts as Matplotlib figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.report.chart import LARGEST, Panel, Series
from scenarios.report.figure_style import WIDTH, dress, plain_marks
from sysid.plots import BOUND

LEGEND_KEY, LETTER = 0.45, 0.068
"""Width of a legend's line with its gaps, and of a letter of its labels, inch."""

RIGHT = 0.75
"""Part of a panel's width beyond which the name of a line stands at its left."""

STEM_END = 2.0
"""Diameter of the end of a stem, points."""


def draw(
    panels: Sequence[Panel],
    columns: int = 1,
    *,
    name_marks: bool = False,
    shared: bool = False,
    row_height: float = 2.3,
) -> Figure:
    """Draw the panels of one view as a figure of a fixed size, for files.

    Args:
        panels: The panels, row by row.
        columns: Panels side by side.
        name_marks: Write the names of lines across.
        shared: All panels have the same axes, with numbers and labels at the left and below alone.
        row_height: Height of a row of panels, inch.
    """
    rows = -(-len(panels) // columns)  # rounded up
    # Panels with axes of their own need room for labels between them.
    width = WIDTH if shared else WIDTH * max(1.0, 0.6 * columns)
    figure = Figure(figsize=(width, 0.6 + row_height * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=shared, sharey=shared).ravel()
    for axes in grid[len(panels) :]:
        axes.axis("off")
    # One legend for all panels: each label stands there once, with the first line of that name.
    handles: dict[str, Any] = {}
    # The last row of the grid may have places without a panel.
    for axes, panel in zip(grid, panels, strict=False):
        for label, line in _draw_panel(axes, panel, name_marks=name_marks):
            handles.setdefault(_without_formulas(label), line)
    # Axes that panels share have their range when all are drawn.
    for axes, panel in zip(grid, panels, strict=False):
        _mark_logarithmic(axes, panel)
    dress(grid[: len(panels)])
    if shared:
        _label_once(figure, list(grid[: len(panels)]), columns)
    # More columns than three are wider than a figure, and long labels would leave it at the right.
    widest = LEGEND_KEY + LETTER * max(map(len, handles), default=0)
    legend_columns = max(min(max(columns, 2), 3, int(width / widest)), 1)
    figure.legend(
        handles.values(), handles.keys(), loc="outside upper left", ncols=legend_columns, frameon=False, fontsize=8
    )
    return figure


def _label_once(figure: Figure, grid: Sequence[Axes], columns: int) -> None:
    """Label shared axes once: x below, with numbers at the lowest panel of each column, y at the left."""
    figure.supxlabel(grid[0].get_xlabel(), fontsize=9)
    for index, axes in enumerate(grid):
        axes.set_xlabel("")
        is_lowest = index + columns >= len(grid)
        axes.tick_params(labelbottom=is_lowest)
        label = axes.get_ylabel() if index % columns == 0 else ""
        # Panels with shared axes are small: an upright label would be longer than they are high.
        axes.set_ylabel(label, fontsize=8, rotation=0, ha="right", va="center")
        axes.set_title(axes.get_title("left"), loc="left", fontsize=8)


def _without_formulas(label: str) -> str:
    """Escape dollar signs, so that no part of a label is set as a formula: names come from anyone's files."""
    return label.replace("$", r"\$")


def _draw_panel(axes: Axes, panel: Panel, *, name_marks: bool) -> list[tuple[str, Any]]:
    """Draw one panel; return the lines of its series with their labels."""
    # Before anything is drawn: lines across the panel would else begin at 0.
    axes.set(**{f"{axis}scale": "log" for axis in panel.log})
    lines = [(series.label, _draw_series(axes, series)) for series in panel.series]
    # Limits that are not given stay open, for panels that share their axes.
    if panel.x_limits:
        axes.set_xlim(panel.x_limits)
    if panel.y_limits:
        axes.set_ylim(panel.y_limits)
    for mark in panel.marks:
        _draw_mark(axes, mark, named=name_marks)
    axes.set_xlabel(_without_formulas(panel.x), fontsize=9)
    axes.set_ylabel(_without_formulas(panel.y), fontsize=9)
    if panel.equal:
        axes.set_aspect("equal")
    axes.set_title(_without_formulas(panel.title), loc="left", fontsize=8.5)
    if not panel.series:
        axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", va="center", fontsize=8, color=BOUND.colour)
    return lines


def _mark_logarithmic(axes: Axes, panel: Panel) -> None:
    """Mark logarithmic axes with plain numbers: Matplotlib would write 2 × 10⁰ between the powers, side by side."""
    if "x" in panel.log:
        plain_marks(axes.xaxis, axes.get_xlim())
    lowest, highest = axes.get_ylim()
    # further apart the powers of ten suffice
    if "y" in panel.log and highest < 100.0 * lowest:
        plain_marks(axes.yaxis, (lowest, highest))


def _draw_mark(axes: Axes, mark: tuple[str, float, str], *, named: bool) -> None:
    """Draw a line across the panel; where it is named, its text stands at the panel's upper or right edge."""
    axis, value, name = mark
    draw_line = axes.axvline if axis == "x" else axes.axhline
    draw_line(value, color=BOUND.colour, ls=":", lw=1.0, label=name)
    if not named:
        return
    place: dict[str, Any]
    if axis == "x":
        in_axes = axes.transAxes.inverted().transform(axes.get_xaxis_transform().transform((value, 1.0)))
        # beside the right edge the name would leave the panel
        side, offset = ("right", (-3, 1)) if in_axes[0] > RIGHT else ("left", (3, 1))
        place = {"xy": (value, 1.0), "xycoords": axes.get_xaxis_transform(), "ha": side, "va": "top"}
    else:
        offset = (0, 1)
        place = {"xy": (1.0, value), "xycoords": axes.get_yaxis_transform(), "ha": "right", "va": "bottom"}
    axes.annotate(_without_formulas(name), xytext=offset, textcoords="offset points", fontsize=8, **place)


def _draw_series(axes: Axes, series: Series) -> Any:
    """Draw one series with its band, bars or stems; return its line, which the legend shows."""
    style, x, y = series.style, _drawable(series.x), _drawable(series.y)
    colour = style.colour
    if series.low is not None:
        low, high = _drawable(series.low), _drawable(series.high)
        if series.along:
            axes.hlines(y, low, high, color=colour, lw=0.9)
        elif style.line:
            axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
        else:
            axes.vlines(x, low, high, color=colour, lw=0.9)
    if series.kind == "stem":
        axes.vlines(x, 0.0, y, color=colour, lw=style.width)
    steps: Any = "steps-post" if series.kind == "step" else "default"
    # Styles of the palette have a marker too; curves are drawn without.
    marker = "" if style.line else style.marker
    look: dict[str, Any] = {"color": colour, "ls": style.line, "lw": style.width, "marker": marker, "ms": series.size}
    if series.kind == "stem":
        # The ends of stems have nothing between them.
        look |= {"ls": "", "marker": "o", "ms": STEM_END}
    (line,) = axes.plot(x, y, drawstyle=steps, **look)
    return line


def _drawable(values: Any) -> np.ndarray:
    """Values of an axis as Matplotlib takes them: names without formulas; numbers that no axis can hold are NaN."""
    array = np.asarray(values)
    if array.dtype.kind == "U":
        return np.char.replace(array, "$", r"\$")
    if array.dtype.kind == "f":
        return np.where(np.abs(array) < LARGEST, array, np.nan)
    return array
