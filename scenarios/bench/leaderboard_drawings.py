"""Drawings of the leaderboard: metrics by problem, accuracy against time, errors over frequency and amplitude."""

import textwrap
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, cycle
from math import isfinite, isnan
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from scenarios.bench.leaderboard import Curve, Leaderboard, LeaderboardRow
from scenarios.bench.leaderboard_tables import title_of
from scenarios.bench.leaderboard_words import CAPTIONS
from scenarios.bench.metric import Part, Verdict
from scenarios.bench.result_tables import number
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import WIDTH, dress, plain_marks
from scenarios.report.figures import SETTINGS, Picture, picture
from sysid.plots.palette import BOUND, DISTORTION, INK, NOISE, PALETTE, Style

MOST_COLUMNS = 4
"""Problems or joints that are drawn side by side: the first ones."""

MOST_PANELS = 12
"""Parts of a metric that are drawn; the table has the others."""

SMALLEST_SHARE = 1e-5
"""Lowest value on an axis over the largest: errors without noise would take all room."""

TRUTH = PALETTE["truth"].colour

LINES: Mapping[str, Mapping[str, Any]] = {
    "truth": {"color": TRUTH, "lw": 0.7, "label": "gain of the truth"},
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

NOT_METHODS = ("truth", "measured", "bla", "published", "welch", "etfe", "cra", "spa")
METHOD_STYLES = {method: style for method, style in PALETTE.items() if method not in NOT_METHODS}

ONE_HZ = "#f3ead2"

Drawing = tuple[Figure, str] | None
"""A figure and its caption; None where no row has the numbers for it."""


def pictures(board: Leaderboard) -> dict[str, Picture]:
    """All drawings of the page by the metric that they show; those are left out that no row has the numbers for."""
    made = {}
    # Settings of all pages: text as paths, and equal figures as equal text.
    with matplotlib.rc_context(SETTINGS):
        for index, (name, draw) in enumerate(DRAWINGS.items()):
            drawing = draw(board)
            if drawing is not None:
                made[name] = _picture(*drawing, name, f"f{index}")
    return made


def _picture(figure: Figure, caption: str, name: str, mark: str) -> Picture:
    for words in figure.findobj(Text):
        # Names of estimators are no formulas, whatever signs they have.
        words.set_parse_math(False)
    with warnings.catch_warnings():
        # Names in scripts that the font lacks are boxes in the drawing; the tables have them whole.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        return picture(figure, caption, name, mark)


def _styles(rows: Sequence[LeaderboardRow]) -> dict[int, Style]:
    """Style of each estimator by its number: that of the method that its name ends in, else one that is free.

    With more estimators than styles, styles repeat; drawings name each estimator by its number too.
    """
    chosen: dict[int, Style] = {}
    free = dict(METHOD_STYLES)
    for row in rows:
        words = "_" + row.name.lower().replace("-", "_")
        method = next((method for method in free if words.endswith(f"_{method}")), None)
        if method is not None:
            chosen[row.number] = free.pop(method)
    spare = cycle((free or METHOD_STYLES).values())
    for row in rows:
        if row.number not in chosen:
            chosen[row.number] = next(spare)
    return chosen


def parts_drawn(board: Leaderboard, name: str, scale: str, containing: str = "") -> Drawing:
    """A panel for each part of a metric that has a value in any row, a line for each estimator in it.

    Args:
        board: The estimators.
        name: Of the metric.
        scale: Of its axis: linear, log, or symlog, which is linear up to 1.
        containing: Parts are drawn whose labels hold this; all where none does.
    """
    parts = chain.from_iterable(row.parts(name) for row in board.rows)
    measured = list(dict.fromkeys(metric_part.label for metric_part in parts if isfinite(metric_part.value)))
    labels = [label for label in measured if containing in label] or measured
    if not labels:
        return None
    figure, panels = _strips(board.rows, labels[:MOST_PANELS])
    axes = next(iter(panels.values()))
    scale_options = {"linthresh": 1.0} if scale == "symlog" else {}
    axes.set_xscale(scale, **scale_options)
    row_styles = _styles(board.rows)
    for line, row in enumerate(board.rows):
        for metric_part in row.parts(name):
            if metric_part.label in panels:
                _draw_part(panels[metric_part.label], line, metric_part, row_styles[row.number].colour)
    if scale == "log":
        # At least from half to twice the expected value, so that small differences do not look large.
        low, high = axes.get_xlim()
        axes.set_xlim(min(0.5, low), max(2.0, high))
        plain_marks(axes.xaxis, axes.get_xlim())
    elif scale == "symlog":
        axes.xaxis.set_major_formatter("{x:g}")
    figure.supxlabel(board.metrics[name].unit, fontsize=8)
    for verdict in Verdict:
        look: dict[str, Any] = {"color": INK, "ls": "", "ms": 5, "mfc": _filling(verdict, INK)}
        axes.plot([], [], marker=verdict.marker, label=verdict.word, **look)
    _add_legend(figure)
    rest = f" Drawn are {MOST_PANELS} of {len(labels)} parts." if len(labels) > MOST_PANELS else ""
    return figure, f"{title_of(board, name)}, {CAPTIONS['parts']}{rest}"


def _draw_part(axes: Axes, line: int, metric_part: Part, colour: str) -> None:
    """Value, interval and limits of a part; matplotlib leaves out what is unknown or infinite."""
    if isfinite(metric_part.expected):
        axes.axvline(metric_part.expected, color=TRUTH, lw=0.9, zorder=1)
    for limit, bracket in zip(metric_part.limits, ("$[$", "$]$"), strict=True):
        axes.plot(limit, line, marker=bracket, color=BOUND.colour, ms=7, mew=0.3)
    axes.plot(metric_part.interval, (line, line), color=colour, lw=1.6)
    verdict = metric_part.verdict
    size = 4.0 if verdict is Verdict.PASSES else 5.5
    axes.plot(metric_part.value, line, verdict.marker, color=colour, zorder=3, mfc=_filling(verdict, colour), ms=size)
    if not isfinite(metric_part.value) or (axes.get_xscale() == "log" and metric_part.value <= 0.0):
        value = "no value" if isnan(metric_part.value) else number(metric_part.value)
        at_left = axes.get_yaxis_transform()
        axes.text(0.02, line, value, transform=at_left, va="center", fontsize=6.5, color=BOUND.colour)


def _filling(verdict: Verdict, colour: str) -> str:
    return "white" if verdict is Verdict.NONE else colour


def bandwidths(board: Leaderboard) -> Drawing:
    """A panel for each joint and excitation of the arm, the range near the thesis' 1 Hz shaded."""
    drawing = parts_drawn(board, "bandwidth", "log")
    if drawing is None:
        return None
    figure, _ = drawing
    for axes in figure.axes:
        if axes.axison:
            axes.axvspan(*ABOUT_1_HZ, color=ONE_HZ, lw=0, zorder=0)
    return figure, CAPTIONS["bandwidth"]


def work_precision(board: Leaderboard) -> Drawing:
    """Accuracy against time: a large mark for each estimator at the medians over problems, a small one for each."""
    points_by_row = {row.number: _time_and_error(row, board.problems) for row in board.rows}
    clouds = {row_number: points for row_number, points in points_by_row.items() if len(points)}
    if not clouds:
        return None
    # The legend has a line or two for each estimator.
    figure = Figure(figsize=(WIDTH, max(4.2, 0.32 * len(clouds))), layout="constrained")
    axes = figure.subplots()
    row_styles = _styles(board.rows)
    for row in board.rows:
        if row.number in clouds:
            points, style = clouds[row.number], row_styles[row.number]
            axes.plot(*points.T, style.marker, color=style.colour, ms=3, alpha=0.5)
            median = np.median(points, axis=0)
            look: dict[str, Any] = {"color": style.colour, "ms": 9, "mec": "white", "mew": 0.8, "zorder": 3}
            axes.plot(*median, style.marker, label=_short_title(row), **look)
    axes.set(xscale="log", yscale="log", xlabel="time of an answer / times the reference")
    axes.set_ylabel("rms error of the response / %")
    dress([axes])
    # Large marks at the edges need room.
    axes.margins(0.14, 0.12)
    plain_marks(axes.xaxis, axes.get_xlim())
    plain_marks(axes.yaxis, axes.get_ylim())
    figure.legend(loc="outside right upper", frameon=False, fontsize=7.5, labelspacing=0.8)
    caption = CAPTIONS["accuracy_and_time"] % board.problems_in_words()
    absent = [row.name for row in board.rows if row.number not in clouds]
    if absent:
        caption += f" Not drawn, since a number of theirs is missing: {', '.join(absent)}."
    return figure, caption


def _time_and_error(row: LeaderboardRow, problems: Sequence[str]) -> np.ndarray:
    """Time over the reference and response error in percent, of each problem (k, 2); none where one lacks."""
    times = {metric_part.label: metric_part.value for metric_part in row.parts("speed")}
    errors = row.answered_errors()
    pairs = [(times.get(problem, np.nan), errors.get(problem, np.nan)) for problem in problems]
    points = np.array(pairs).reshape(-1, 2)
    return points if np.isfinite(points).all() and (points > 0.0).all() else points[:0]


def responses(board: Leaderboard) -> Drawing:
    """A panel for each estimator and problem: rms error, claimed band, bound and truth over frequency."""
    problems = _labels_of_curves(board, "frequency_response")
    if not problems:
        return None
    figure, panels, filled = _curve_panels(board, "frequency_response", problems[:MOST_COLUMNS], sharey="col")
    for axes, curve in filled:
        axes.set(xscale="log", yscale="log")
        for key, look in LINES.items():
            if key in curve:
                axes.plot(curve["frequencies_hz"], np.sqrt(np.mean(curve[key] ** 2, axis=(1, 2))), **look)
    for axes in panels[0]:
        # Panels of a column share their axis, so that the first row stands for all.
        low, high = axes.get_ylim()
        axes.set_ylim(bottom=max(low, SMALLEST_SHARE * high))
        plain_marks(axes.xaxis, axes.get_xlim())
        plain_marks(axes.yaxis, axes.get_ylim())
    figure.supxlabel("frequency / Hz", fontsize=8)
    _add_legend(figure)
    rest = ""
    if len(problems) > MOST_COLUMNS:
        rest = f" Drawn are the first {MOST_COLUMNS} of {len(problems)} problems."
    return figure, f"{CAPTIONS['frequency_response']}{rest}"


def splits(board: Leaderboard) -> Drawing:
    """A panel for each estimator and joint of the arm: systematic error, noise and distortion over amplitude."""
    joints = _labels_of_curves(board, "amplitude_split")[:MOST_COLUMNS]
    if not joints:
        return None
    figure, panels, filled = _curve_panels(board, "amplitude_split", joints, sharey=True)
    low, top = _range_of_shares(curve for _, curve in filled)
    for axes, curve in filled:
        axes.set_xscale("log")
        # An estimator without an error of some kind has the value 0, which a logarithmic axis cannot show.
        axes.set_yscale("symlog", linthresh=low, linscale=0.3)
        for index, (share, (words, style)) in enumerate(SHARES.items()):
            beside = curve["mrad"] * 1.06 ** (index - 1)  # so that bars do not hide one another
            look: dict[str, Any] = {"color": style.colour, "lw": 1.0, "clip_on": False, "label": words}
            axes.plot(beside, curve[share], marker=style.marker, ms=3.5, **look)
            axes.vlines(beside, *np.clip(curve[f"{share}_interval"].T, 0.0, top), color=style.colour, lw=1.0)
            if f"expected_{share}" in curve:
                axes.plot(beside, curve[f"expected_{share}"], color=style.colour, lw=0.9, ls=":")
        limit: dict[str, Any] = {"color": BOUND.colour, "ms": 8, "label": "limit of the systematic error"}
        axes.plot(curve["mrad"], curve["systematic_limit"], "_", **limit)
    for axes in panels[0]:
        left, right = axes.get_xlim()
        axes.set_xlim(left / 1.2, right * 1.2)
        plain_marks(axes.xaxis, axes.get_xlim())
    panels[0, 0].set_ylim(0.0, top)

    def mark(value: float, _: int) -> str:
        # Between 0 and `low` the axis is linear, with marks that would meet.
        return f"{value:g}" if value >= low or value == 0.0 else ""

    panels[0, 0].yaxis.set_major_formatter(mark)
    figure.supxlabel("amplitude of the command / mrad", fontsize=8)
    figure.supylabel("% of the linear part", fontsize=8)
    _add_legend(figure)
    return figure, CAPTIONS["amplitude_split"]


def _range_of_shares(curves: Iterable[Curve]) -> tuple[float, float]:
    """Range of the axis of all splits: twice the largest share, and the smallest that is not lost in it."""
    # Numbers over amplitude have one dimension; intervals, which may be far wider, have two.
    over_amplitude = []
    for curve in curves:
        over_amplitude += [values for values in curve.values() if values.ndim == 1]
    shares = np.concatenate(over_amplitude)
    positive = shares[np.isfinite(shares) & (shares > 0.0)]
    largest = float(positive.max())
    return max(float(positive.min()), 2.0 * SMALLEST_SHARE * largest), 2.0 * largest


def _strips(rows: Sequence[LeaderboardRow], titles: Sequence[str]) -> tuple[Figure, dict[str, Axes]]:
    """Panels by title, two side by side, each of them with a line for each estimator; they share their axes."""
    columns = min(2, len(titles))
    lines = -(-len(titles) // columns)
    figure = Figure(figsize=(WIDTH, 0.7 + lines * (0.55 + 0.25 * len(rows))), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=7, left=False, labelbottom=True)
    for axes in panels.flat[len(titles) :]:
        axes.set_axis_off()
    by_title = dict(zip(titles, panels.flat, strict=False))
    for words, axes in by_title.items():
        axes.set_title(words.replace("_", " "), fontsize=8, loc="left")
    # Downwards, as the rows of the tables.
    panels[0, 0].set_ylim(len(rows) - 0.45, -0.55)
    panels[0, 0].set_yticks(range(len(rows)), [_short_title(row) for row in rows])
    return figure, by_title


def _curve_panels(
    board: Leaderboard, metric: str, columns: Sequence[str], *, sharey: Literal["col"] | bool
) -> tuple[Figure, np.ndarray, list[tuple[Axes, Curve]]]:
    """A figure with a panel for each estimator (row) and problem or joint (column).

    Returns:
        The figure, its panels, and those that have a curve with the curve; the others say that they have none.
    """
    rows = board.rows
    figure = Figure(figsize=(WIDTH, 1.0 + 0.95 * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(columns), squeeze=False, sharex="col", sharey=sharey)
    dress(panels.flat)
    filled = []
    for row, line in zip(rows, panels, strict=True):
        line[0].set_ylabel(_short_title(row, 14), fontsize=7, rotation=0, ha="right", va="center")
        for column, axes in zip(columns, line, strict=True):
            axes.tick_params(labelsize=6.5, pad=1.5)
            if column in row.curves[metric]:
                filled.append((axes, row.curves[metric][column]))
            else:
                axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", fontsize=7, color=BOUND.colour)
    for column, axes in zip(columns, panels[0], strict=True):
        axes.set_title(column.replace("_", " "), fontsize=8)
    return figure, panels, filled


def _labels_of_curves(board: Leaderboard, metric: str) -> list[str]:
    return list(dict.fromkeys(chain.from_iterable(row.curves[metric] for row in board.rows)))


def _add_legend(figure: Figure) -> None:
    """One legend for all panels, each label once."""
    by_label: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            by_label.setdefault(label, handle)
    handles, labels = list(by_label.values()), list(by_label)
    figure.legend(handles, labels, loc="outside upper left", ncols=3, frameon=False, fontsize=7)


def _short_title(row: LeaderboardRow, width: int = 18) -> str:
    """Number and name on at most two lines of a drawing; the number tells names apart that are cut."""
    return "\n".join(textwrap.wrap(row.title, width, max_lines=2, placeholder="…"))


DRAWINGS: Mapping[str, Callable[[Leaderboard], Drawing]] = {
    "accuracy_and_time": work_precision,
    "efficiency": lambda board: parts_drawn(board, "efficiency", "log"),
    "coverage": lambda board: parts_drawn(board, "coverage", "linear", "response"),
    "frequency_response": responses,
    "amplitude_split": splits,
    "bias": lambda board: parts_drawn(board, "bias", "symlog"),  # values about 0 and far beyond 1
    "bandwidth": bandwidths,
}
"""Drawings by metric, and accuracy against time; the other metrics have their tables."""
