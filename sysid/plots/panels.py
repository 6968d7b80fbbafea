"""Panels, lines, legends and channel choice of all figures."""

import textwrap
from collections.abc import Sequence

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from sysid.plots.palette import GRID, INK, Style
from sysid.records.arguments import number_pair, real_number
from sysid.records.arrays import FloatArray, real_array
from sysid.records.channels import default_names
from sysid.records.data import IOData
from sysid.records.errors import SysidError

Panels = NDArray[np.object_]
"""Axes (rows, columns)."""

LONG = 800  # number of points from which a line is drawn without a pattern
LETTER = 0.0076  # mean width of a letter, inch per point of its size
TITLE = 9  # font size of the titles of panels, points
WIDEST, HIGHEST = 24.0, 36.0  # largest figure, inch
SMALL = 8  # font size of titles and tick labels in a figure of many panels, points


def panels(
    rows: int,
    columns: int,
    size: tuple[float, float],
    *,
    sharex: bool | str = False,
    ratios: Sequence[float] | None = None,
) -> tuple[Figure, Panels]:
    """A figure without window, and its empty panels."""
    size = number_pair("size", size, "the width and height of the figure, inch")
    if min(size) <= 0.0:
        raise SysidError(f"size must be the width and height of the figure above 0 inch, got {size}")
    # Only a constrained layout makes room for a legend outside of the panels.
    figure = Figure(figsize=size, layout="constrained")
    # the stubs of matplotlib have an overload for each of True, False and "col"
    grid: Panels = figure.subplots(rows, columns, sharex=sharex, squeeze=False, height_ratios=ratios)  # type: ignore[arg-type]
    label_size = 9 if columns < 3 else SMALL
    for axes in grid.ravel():
        axes.grid(True, which="major", color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=label_size, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, grid


def size_of(
    size: tuple[float, float] | None, rows: int, columns: int, first: tuple[float, float], further: tuple[float, float]
) -> tuple[float, float]:
    """Size of a figure: the user's, else `first` plus `further` for every further row and column of panels, inch."""
    if size is not None:
        return size
    width = first[0] + further[0] * (columns - 1)
    height = first[1] + further[1] * (rows - 1)
    return min(width, WIDEST), min(height, HIGHEST)


def line(axes: Axes, x: FloatArray, y: FloatArray, style: Style, label: str | None, *, width: float = 0.0) -> None:
    """Draw a line, and a point for a value between unknown ones; markers alone where the style has no line."""
    marker = "" if style.line else style.marker
    width, pattern = width or style.width, style.line
    if len(x) > LONG and pattern and pattern != "-":
        # dense points fill the gaps of a pattern: only the colour remains
        width, pattern = 0.7 * width, "-"
    # wide lines lie behind narrow ones, so that both are visible
    axes.plot(
        x, y, color=style.colour, ls=pattern, lw=width, marker=marker, ms=5, label=label, zorder=2.5 - 0.1 * width
    )
    unknown = np.concatenate(([True], ~np.isfinite(y), [True]))
    alone = ~unknown[1:-1] & unknown[:-2] & unknown[2:]
    if style.line and alone.any():
        axes.plot(x[alone], y[alone], ls="", marker="o", ms=3, color=style.colour)


def shade(axes: Axes, x: FloatArray, low: FloatArray, high: FloatArray, style: Style) -> None:
    """Draw a band in the colour of a style."""
    axes.fill_between(x, low, high, color=style.colour, alpha=0.18, lw=0)


def finish(figure: Figure, grid: Panels, horizontal: str) -> Figure:
    """The figure with its horizontal label, and other labels on lines no longer than their panel.

    The legend of the first panel is above the figure, where it never covers data.
    """
    for axes in grid[-1]:
        axes.set_xlabel(horizontal)
    figure.align_ylabels(list(grid[:, 0]))
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if handles:
        # Each label has a handle of about half an inch.
        width = 0.55 + 9 * LETTER * max(len(label) for label in labels)
        columns = min(len(handles), max(1, int(figure.get_figwidth() / width)))
        figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize=9)
    for panel in figure.axes:
        position = panel.get_subplotspec()
        if position is not None:
            spec = position.get_gridspec()
            ratios = np.asarray(spec.get_height_ratios(), dtype=float)
            height = ratios[position.rowspan.start] / ratios.sum() * figure.get_figheight()
            panel.set_ylabel(_wrapped(panel.get_ylabel(), panel.yaxis.label.get_fontsize(), 0.8 * height))
            width = 0.9 / spec.ncols * figure.get_figwidth()
            panel.set_title(_wrapped(panel.get_title(loc="left"), TITLE, width), loc="left", fontsize=TITLE)
    return figure


def _wrapped(text: str, size: float | str, length: float) -> str:
    """A text of a font size in points, on lines of a length, inch."""
    letters = max(int(length / (LETTER * float(size))), 1)
    # a unit stays behind its stroke
    lines = text.replace(" / ", "\xa0/\xa0").split("\n")
    return "\n".join(textwrap.fill(line, letters) for line in lines).replace("\xa0", " ")


def apart(values: FloatArray, gap: float) -> FloatArray:
    """Values (n,) moved as little as possible, in mean square, until neighbours are a gap apart."""
    sequence, steps = np.argsort(values, kind="stable"), gap * np.arange(len(values))
    out = np.empty(len(values))
    # Less their rank times the gap, the values need only not fall: least squares under that is an isotonic regression.
    out[sequence] = scipy.optimize.isotonic_regression(values[sequence] - steps).x + steps
    return out


def fit_to_lines(axes: Axes, *, floor: float = -np.inf) -> None:
    """Set the vertical range by the lines above `floor`, not by their bands."""
    values = np.concatenate([np.asarray(drawn.get_ydata(), dtype=float) for drawn in axes.get_lines()] or [np.zeros(1)])
    values = values[np.isfinite(values)]
    # 0 dB and 0 degrees are always in view.
    low, high = max(float(values.min(initial=0.0)), floor), float(values.max(initial=0.0))
    # Rounding of a constant response must not fill the axis: its range is one dB or degree at least.
    margin = 0.06 * max(high - low, 1.0)
    axes.set_ylim(low - margin, high + margin)


def frequency_axes(grid: Panels, limits_hz: tuple[float, float] | None) -> None:
    """Logarithmic axes of frequency, with 0.1, 1, 10 instead of powers of ten."""
    if limits_hz is not None:
        limits_hz = number_pair("limits_hz", limits_hz, "the lowest and the highest frequency, Hz")
    for axes in grid.ravel():
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        if limits_hz is not None:
            axes.set_xlim(*limits_hz)


def grid_of_frequencies(frequencies: ArrayLike | None, dt: float) -> FloatArray:
    """Frequencies of a model in a figure, Hz: the user's, else three decades up to Nyquist."""
    if frequencies is None:
        return np.geomspace(5e-4 / dt, 0.5 / dt, 300)
    return real_array("frequencies", frequencies)


def check_same_channels(shapes: Sequence[tuple[str, tuple[int, ...]]]) -> None:
    """Refuse responses in one figure with different numbers of outputs and inputs."""
    if len({shape for _, shape in shapes}) > 1:
        sizes = [f"{label} {' x '.join(map(str, shape))}" for label, shape in shapes]
        raise SysidError(f"responses in one figure must have the same outputs and inputs; got {', '.join(sizes)}")


def piece_of(data: IOData, start: float, length: float | None) -> slice:
    """Samples of a record from `start` s on, for `length` s or to its end."""
    start = real_number("start", start, "be a time in s", lambda time: bool(np.isfinite(time)))
    if length is not None:
        length = real_number("length", length, "be a time in s", lambda time: bool(np.isfinite(time)))
    # Two samples at least: a single one makes no line.
    first = min(round(start / data.dt), max(len(data) - 2, 0))
    if length is None:
        return slice(first, len(data))
    return slice(first, first + max(round(length / data.dt), 2))


def shade_window(axes: Axes, data: IOData, first: int) -> None:
    """Shade the initialisation window of a record that is drawn from a sample on."""
    if data.window > first:
        end = data.time[min(data.window, len(data) - 1)]
        axes.axvspan(data.time[first], end, color="#f0f0f0", lw=0, zorder=0)


def decibel(magnitude: FloatArray) -> FloatArray:
    """20 log10 of a magnitude, finite where it is zero."""
    return 20.0 * np.log10(np.maximum(magnitude, np.finfo(float).tiny))


def channel_indices(kind: str, channel: int | str | None, names: Sequence[str]) -> list[int]:
    """Indices of the channels with this index or name; all for None."""
    if channel is None:
        return list(range(len(names)))
    if isinstance(channel, str) and channel in names:
        return [list(names).index(channel)]
    is_index = isinstance(channel, int | np.integer) and not isinstance(channel, bool)
    if not is_index or not -len(names) <= int(channel) < len(names):
        raise SysidError(f"unknown {kind} {channel!r}; there are {', '.join(names)} (0 to {len(names) - 1})")
    return [int(channel) % len(names)]


def channel_names(names: Sequence[str], count: int, letter: str) -> tuple[str, ...]:
    """Names of channels, by default `u1, u2, ...`."""
    return tuple(names) if len(names) == count else default_names(letter, count)


def label(text: str, unit: str) -> str:
    """Label of an axis with its unit, if any."""
    return f"{text} / {unit}" if unit else text


def show(figure: Figure) -> None:
    """Open a window with a figure, and wait until it is closed.

    The figures of this package have no window, so that they need not be closed; a notebook shows them by itself. This
    function passes one to `matplotlib.pyplot`.

    Args:
        figure: Any figure.
    """
    from matplotlib import pyplot

    # pyplot shows only figures that it has made: this one takes over the canvas of an empty one.
    window = pyplot.figure(figsize=tuple(figure.get_size_inches()))
    canvas = window.canvas
    canvas.figure = figure
    figure.set_canvas(canvas)
    pyplot.show()
