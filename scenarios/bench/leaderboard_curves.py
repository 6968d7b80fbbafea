"""Drawings of curves: a panel for each estimator and problem, with errors over frequency or over amplitude."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scenarios.bench.leaderboard_rows import Curve, LeaderboardRow
from scenarios.report.figure_style import WIDTH, dress, plain_marks
from sysid.plots.palette import BOUND, DISTORTION, INK, NOISE, PALETTE, Style

MOST = 4
"""Problems or joints that are drawn, side by side: the first ones."""

DECADES = 1e-5
"""Lowest value on an axis over the largest: errors without noise would take all room."""

LINES: Mapping[str, Mapping[str, Any]] = {
    "truth": {"color": PALETTE["truth"].colour, "lw": 0.7, "label": "gain of the truth"},
    "bound": {"color": BOUND.colour, "lw": 0.9, "ls": ":", "label": "bound"},
    "error": {"color": PALETTE["armax"].colour, "lw": 1.5, "label": "rms error"},
    "claimed": {"color": INK, "lw": 0.9, "ls": "--", "label": "claimed"},
}
"""Looks of the curves over frequency."""

SHARES: Mapping[str, tuple[str, Style]] = {
    "systematic": ("systematic error", PALETTE["armax"]),
    "noise": ("noise", NOISE),
    "distortion": ("nonlinear distortion", DISTORTION),
}
"""Shares of an error on the arm, with their words and styles."""

Drawing = tuple[Figure, str] | None
"""A figure and its caption; None where no row has the numbers for it."""


def label(row: LeaderboardRow, width: int = 18) -> str:
    """Number and name on at most two lines of a drawing; the number tells names apart that are cut."""
    return literal("\n".join(textwrap.wrap(row.title, width, max_lines=2, placeholder="…")))


def literal(text: str) -> str:
    """Text that matplotlib does not read as a formula."""
    return text.replace("\\", "\N{REVERSE SOLIDUS OPERATOR}").replace("$", r"\$")


def responses(rows: Sequence[LeaderboardRow]) -> Drawing:
    """A panel for each estimator and problem: rms error, claimed band, bound and truth over frequency."""
    problems = _columns(rows, "frequency_response")
    if not problems:
        return None
    figure, panels = _grid(rows, problems[:MOST], sharey="col")
    for axes, curve in _filled(rows, "frequency_response", problems, panels):
        axes.set(xscale="log", yscale="log")
        for key, look in LINES.items():
            if key in curve:
                axes.plot(curve["frequencies_hz"], np.sqrt(np.mean(curve[key] ** 2, axis=(1, 2))), **look)
    for axes in panels[0]:
        low, high = axes.get_ylim()
        axes.set_ylim(bottom=max(low, DECADES * high))
        plain_marks(axes.xaxis, axes.get_xlim())
        plain_marks(axes.yaxis, axes.get_ylim())
    figure.supxlabel("frequency / Hz", fontsize=8)
    signs = [Line2D([], [], **look) for look in LINES.values()]
    figure.legend(handles=signs, loc="outside upper left", ncols=4, frameon=False, fontsize=7)
    rest = f" Drawn are the first {MOST} of {len(problems)} problems." if len(problems) > MOST else ""
    return figure, (
        "Error of the frequency response over frequency, root mean square over records, and over channels where there "
        "are several. Where the error lies above what is claimed (dashed), intervals are too narrow; dotted is the "
        f"bound of the estimator’s own structure. Without a dashed line nothing is claimed.{rest}"
    )


def splits(rows: Sequence[LeaderboardRow]) -> Drawing:
    """A panel for each estimator and joint of the arm: systematic error, noise and distortion over amplitude."""
    joints = _columns(rows, "amplitude_split")[:MOST]
    if not joints:
        return None
    figure, panels = _grid(rows, joints, sharey=True)
    filled = list(_filled(rows, "amplitude_split", joints, panels))
    marks = np.concatenate([values for _, curve in filled for key, values in curve.items() if values.ndim == 1])
    marks = marks[np.isfinite(marks) & (marks > 0.0)]
    top, low = 2.0 * marks.max(), max(marks.min(), 2.0 * DECADES * marks.max())
    for axes, curve in filled:
        axes.set_xscale("log")
        # An estimator without an error of some kind has the value 0, which a logarithmic axis cannot show.
        axes.set_yscale("symlog", linthresh=low, linscale=0.3)
        for place, (key, (_, style)) in enumerate(SHARES.items()):
            at = curve["mrad"] * 1.06 ** (place - 1)  # beside each other, so that bars do not hide one another
            axes.plot(at, curve[key], color=style.colour, marker=style.marker, ms=3.5, lw=1.0, clip_on=False)
            axes.vlines(at, *np.clip(curve[f"{key}_interval"].T, 0.0, top), color=style.colour, lw=1.0)
            if f"expected_{key}" in curve:
                axes.plot(at, curve[f"expected_{key}"], color=style.colour, lw=0.9, ls=":")
        axes.plot(curve["mrad"], curve["systematic_limit"], "_", color=BOUND.colour, ms=8)
    for axes in panels[0]:
        axes.set_xlim(axes.get_xlim()[0] / 1.2, axes.get_xlim()[1] * 1.2)
        plain_marks(axes.xaxis, axes.get_xlim())
    panels[0, 0].set_ylim(0.0, top)
    panels[0, 0].yaxis.set_major_formatter(lambda value, _: f"{value:g}" if value >= low or value == 0.0 else "")
    figure.supxlabel("amplitude of the command / mrad", fontsize=8)
    figure.supylabel("% of the linear part", fontsize=8)
    signs = [Line2D([], [], color=s.colour, marker=s.marker, ms=4, lw=1.2, label=text) for text, s in SHARES.values()]
    signs.append(Line2D([], [], color=BOUND.colour, ls="", marker="_", ms=8, label="limit of the systematic error"))
    figure.legend(handles=signs, loc="outside upper left", ncols=2, frameon=False, fontsize=7)
    return figure, (
        "Errors of the response on the arm over the amplitude of the command, in percent of the linear part: what "
        "stays in the mean over waveforms, what differs between repeats, what differs between waveforms. Bars: 95 % "
        "intervals; dotted: noise and distortion of the records themselves, without a model. The limit is wide where "
        "an estimator scatters."
    )


def _columns(rows: Sequence[LeaderboardRow], metric: str) -> list[str]:
    return list(dict.fromkeys(name for row in rows for name in row.curves[metric]))


def _grid(
    rows: Sequence[LeaderboardRow], columns: Sequence[str], *, sharey: Literal["col"] | bool
) -> tuple[Figure, np.ndarray]:
    """Panels (estimator, column), dressed."""
    figure = Figure(figsize=(WIDTH, 1.0 + 0.95 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(columns), squeeze=False, sharex="col", sharey=sharey)
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=6.5, pad=1.5)
    for axes, name in zip(panels[0], columns, strict=True):
        axes.set_title(literal(name).replace("_", " "), fontsize=8)
    for axes, row in zip(panels[:, 0], rows, strict=True):
        axes.set_ylabel(label(row, 14), fontsize=7, rotation=0, ha="right", va="center")
    return figure, panels


def _filled(
    rows: Sequence[LeaderboardRow], metric: str, columns: Sequence[str], panels: np.ndarray
) -> Iterator[tuple[Axes, Curve]]:
    """Panels that have a curve, and the curve; the others say that they have none."""
    for line, row in zip(panels, rows, strict=True):
        for axes, name in zip(line, columns, strict=False):
            if name in row.curves[metric]:
                yield axes, row.curves[metric][name]
            else:
                axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", fontsize=7, color=BOUND.colour)
