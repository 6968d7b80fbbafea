"""Errors of the frequency response beside what is claimed of them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from scenarios.bench.leaderboard_curves import number_of, numbers
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_style import label, literal, styles
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress
from sysid.plots.palette import BOUND, INK, PALETTE, Style
from sysid.records.arrays import FloatArray

NAME = "frequency_response"
MOST = 4
"""Problems that are drawn, side by side: the first ones."""

DECADES = 5.0
"""That a panel shows below the largest gain: errors without noise would take all room."""


def responses(entries: Sequence[Entry]) -> tuple[Figure, str] | None:
    """A panel for each estimator and problem: rms error, claimed band, bound and truth over frequency.

    Returns:
        The figure and its caption; None where no row has curves.
    """
    found = {entry.number: _curves(entry) for entry in entries}
    problems = list(dict.fromkeys(name for curves in found.values() for name in curves))
    if not problems:
        return None
    drawn = problems[:MOST]
    figure = Figure(figsize=(WIDTH, 1.0 + 0.95 * len(entries)), layout="constrained")
    panels = figure.subplots(len(entries), len(drawn), squeeze=False, sharex="col", sharey="col")
    looks = styles(entries)
    for row, entry in zip(panels, entries, strict=True):
        for axes, name in zip(row, drawn, strict=True):
            curve = found[entry.number].get(name)
            if curve is None:
                axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", fontsize=7, color=BOUND.colour)
            else:
                _draw(axes, curve, looks[entry.number])
        row[0].set_ylabel(label(entry, 14), fontsize=7, rotation=0, ha="right", va="center")
    for column, name in enumerate(drawn):
        panels[0, column].set_title(literal(one_line(name)), fontsize=8)
        _axes(panels[0, column], [c[name] for c in found.values() if name in c])
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=6.5, pad=1.5)
    figure.supxlabel("frequency / Hz", fontsize=8)
    marks = [
        Line2D([], [], color=PALETTE["armax"].colour, lw=1.5, label="rms error"),
        Line2D([], [], color=INK, lw=0.9, ls="--", label="claimed"),
        Line2D([], [], color=BOUND.colour, lw=0.9, ls=":", label="bound"),
        Line2D([], [], color=PALETTE["truth"].colour, lw=0.7, label="gain of the truth"),
    ]
    figure.legend(handles=marks, loc="outside upper left", ncols=4, frameon=False, fontsize=7)
    rest = f" Drawn are the first {MOST} of {len(problems)} problems." if len(problems) > MOST else ""
    return figure, (
        "Error of the frequency response over frequency, root mean square over records, and over channels where there "
        "are several. Where the error lies above what is claimed (dashed), intervals are too narrow; dotted is the "
        f"bound of the estimator’s own structure. Without a dashed line nothing is claimed.{rest}"
    )


def relative_errors(entry: Entry) -> dict[str, float]:
    """Root mean square error of the response by problem, percent of the truth's own."""
    figure = entry.figure(NAME)
    tables = {} if figure is None else figure.curves
    found = {str(name): number_of(table, "relative_error_percent") for name, table in tables.items()}
    return {name: value for name, value in found.items() if np.isfinite(value) and value > 0.0}


def _curves(entry: Entry) -> dict[str, dict[str, FloatArray]]:
    """Curves over frequency by problem; what is not there, or of another length, is left out."""
    figure = entry.figure(NAME)
    found = {}
    for name, table in ({} if figure is None else figure.curves).items():
        if not isinstance(table, dict):
            continue
        frequencies = numbers(table.get("frequencies_hz"))
        if frequencies is None or not (frequencies > 0.0).all():
            continue
        curve = {"frequencies": frequencies}
        for key in ("truth", "error", "claimed", "bound"):
            values = numbers(table.get(key), 3)
            if values is not None and len(values) == len(frequencies):
                curve[key] = np.sqrt(np.mean(values**2, axis=(1, 2)))
        if "error" in curve:
            found[str(name)] = curve
    return found


def _draw(axes: Axes, curve: dict[str, FloatArray], style: Style) -> None:
    own, dark = style.colour, PALETTE["truth"].colour
    looks = {
        "truth": (dark, 0.7, "-"),
        "bound": (BOUND.colour, 0.9, ":"),
        "error": (own, 1.5, "-"),
        "claimed": (INK, 0.9, "--"),
    }
    for key, (colour, width, line) in looks.items():
        if key in curve:
            values = np.where(curve[key] > 0.0, curve[key], np.nan)
            axes.plot(curve["frequencies"], values, color=colour, lw=width, ls=line)


def _axes(axes: Axes, curves: Sequence[dict[str, FloatArray]]) -> None:
    axes.set(xscale="log", yscale="log")
    values = np.concatenate([v for curve in curves for key, v in curve.items() if key != "frequencies"])
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values):
        high = float(values.max())
        axes.set_ylim(max(float(values.min()), high * 10.0**-DECADES) / 1.5, high * 1.5)
    low, high = (f(c["frequencies"][end] for c in curves) for f, end in ((min, 0), (max, -1)))
    decades = [10.0**k for k in range(-4, 5) if low <= 10.0**k <= high]
    axes.xaxis.set_major_locator(FixedLocator(decades or [low]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_locator(LogLocator(numticks=4))
    axes.yaxis.set_minor_locator(NullLocator())
