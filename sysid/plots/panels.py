"""What every figure shares: panels, lines, legends, and which channels are drawn."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sysid.plots.palette import GRID, INK, Style
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

Panels = NDArray[np.object_]
"""Axes (rows, columns)."""

LONG = 800
"""Points of a line beyond which it is drawn without a pattern."""

SMALL = 8
"""Size of titles and of tick labels in a figure of many panels, points."""


def panels(
    rows: int,
    columns: int,
    size: tuple[float, float],
    *,
    sharex: bool | str = False,
    ratios: Sequence[float] | None = None,
) -> tuple[Figure, Panels]:
    """A figure that belongs to no window, with empty panels."""
    figure = Figure(figsize=size, layout="constrained")
    # matplotlib takes True, False and "col" here, which its stubs tell apart
    grid: Panels = figure.subplots(rows, columns, sharex=sharex, squeeze=False, height_ratios=ratios)  # type: ignore[arg-type]
    for axes in grid.ravel():
        axes.grid(True, which="major", color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=9 if columns < 3 else SMALL, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, grid


def size_of(
    given: tuple[float, float] | None, rows: int, columns: int, one: tuple[float, float], more: tuple[float, float]
) -> tuple[float, float]:
    """Size of a figure: as given, else enough for its panels."""
    if given is not None:
        return given
    return (min(one[0] + more[0] * (columns - 1), 24.0), min(one[1] + more[1] * (rows - 1), 36.0))


def line(axes: Axes, x: FloatArray, y: FloatArray, style: Style, label: str | None, *, width: float = 0.0) -> None:
    """Draw a line, or markers alone where the style has no line."""
    marker, width, pattern = "" if style.line else style.marker, width or style.width, style.line
    if len(x) > LONG and pattern and pattern != "-":
        # so many points close up the gaps of a pattern; colour has to do
        width, pattern = 0.7 * width, "-"
    # broad lines lie behind narrow ones, so that neither hides the other
    axes.plot(
        x, y, color=style.colour, ls=pattern, lw=width, marker=marker, ms=5, label=label, zorder=2.5 - 0.1 * width
    )


def shade(axes: Axes, x: FloatArray, low: FloatArray, high: FloatArray, style: Style) -> None:
    """Draw a band."""
    axes.fill_between(x, low, high, color=style.colour, alpha=0.18, lw=0)


def legend(figure: Figure, axes: Axes) -> None:
    """A legend above the figure, where it never covers data."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        # An entry takes its handle, about half an inch, and its text, at 9 points about 0.068 inch a letter.
        entry = 0.55 + 0.068 * max(len(label) for label in labels)
        columns = min(len(handles), max(1, int(figure.get_figwidth() / entry)))
        figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize=9)


def fit_to_lines(axes: Axes, *, floor: float = -np.inf) -> None:
    """Let the lines set the vertical range, not their bands."""
    values = np.concatenate([np.asarray(drawn.get_ydata(), dtype=float) for drawn in axes.get_lines()] or [np.zeros(1)])
    values = values[np.isfinite(values)]
    low, high = max(float(values.min(initial=0.0)), floor), float(values.max(initial=0.0))
    margin = 0.06 * max(high - low, 1.0)
    axes.set_ylim(low - margin, high + margin)


def plain_frequencies(axes: Axes) -> None:
    """Write 0.1, 1, 10 instead of powers of ten."""
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def decibel(magnitude: FloatArray) -> FloatArray:
    """20 log10 of a magnitude, finite where it is zero."""
    return 20.0 * np.log10(np.maximum(magnitude, np.finfo(float).tiny))


def chosen(kind: str, given: int | str | None, names: Sequence[str]) -> list[int]:
    """Channels to draw."""
    if given is None:
        return list(range(len(names)))
    if isinstance(given, str) and given in names:
        return [list(names).index(given)]
    whole = isinstance(given, int | np.integer) and not isinstance(given, bool)
    if not whole or not -len(names) <= int(given) < len(names):
        raise SysidError(f"unknown {kind} {given!r}; there are {', '.join(names)} (0 to {len(names) - 1})")
    return [int(given) % len(names)]


def named(names: Sequence[str], count: int, letter: str) -> tuple[str, ...]:
    """Names of channels, `u1, u2, ...` where there are none."""
    return tuple(names) if len(names) == count else tuple(f"{letter}{k + 1}" for k in range(count))


def label(text: str, unit: str) -> str:
    """A label of an axis with its unit, if it has one."""
    return f"{text} / {unit}" if unit else text


def show(figure: Figure) -> None:
    """Open a window with a figure, and wait until it is closed.

    The figures of this package belong to no window, so that drawing many of them leaves nothing behind; a notebook
    shows them by itself. This hands one to `matplotlib.pyplot`.

    Args:
        figure: Any figure.
    """
    from matplotlib import pyplot

    window = pyplot.figure(figsize=tuple(figure.get_size_inches()))
    canvas = window.canvas
    canvas.figure = figure
    figure.set_canvas(canvas)
    pyplot.show()
