"""Drawings of the leaderboard: metrics by problem, accuracy against time, errors over frequency and amplitude."""

import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, cycle
from math import isfinite, isnan
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from scenarios.bench.leaderboard import Curve, Leaderboard, LeaderboardRow
from scenarios.bench.leaderboard_tables import title_of
from scenarios.bench.leaderboard_words import CAPTIONS
from scenarios.bench.metric import Part, Verdict, unjudged
from scenarios.bench.result_tables import number
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.chart import LARGEST, Panel, Series, with_log_ranges
from scenarios.report.chart_drawing import draw
from scenarios.report.figures import SETTINGS, Picture, picture
from sysid.plots.palette import BOUND, DISTORTION, INK, NOISE, PALETTE, Style

MOST_COLUMNS = 4
"""Problems or joints that are drawn side by side: the first ones."""

MOST_PANELS = 12
"""Parts of a metric that are drawn; the table has the others."""

TRUTH = PALETTE["truth"].colour
LIMIT = Style(BOUND.colour, "", 1.0, "_")

RESPONSES: Mapping[str, tuple[str, Style]] = {
    "truth": ("gain of the truth", Style(TRUTH, "-", 0.7)),
    "bound": ("bound", Style(BOUND.colour, ":", 0.9)),
    "error": ("rms error", Style(PALETTE["armax"].colour, "-", 1.5)),
    "claimed": ("claimed", Style(INK, "--", 0.9)),
}
"""Curves over frequency, with their words and styles."""

SHARES: Mapping[str, tuple[str, Style]] = {
    "systematic": ("systematic error", replace(PALETTE["armax"], line="")),
    "noise": ("noise", NOISE),
    "distortion": ("nonlinear distortion", DISTORTION),
}
"""Shares of an error on the arm, with their words and styles."""

NOT_METHODS = ("truth", "measured", "bla", "published", "welch", "etfe", "cra", "spa")
METHOD_STYLES = {method: replace(style, line="") for method, style in PALETTE.items() if method not in NOT_METHODS}


Drawing = tuple[Figure, str] | None
"""A figure and its caption; None where no row has the numbers for it."""


def pictures(board: Leaderboard) -> dict[str, Picture]:
    """All drawings of the page by the metric that they show; those are left out that no row has the numbers for."""
    made = {}
    # Settings of all pages: text as paths, and equal figures as equal text.
    with matplotlib.rc_context(SETTINGS), warnings.catch_warnings():
        # Names in scripts that the font lacks are boxes in the drawing; the tables have them whole.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        for index, (name, draw_metric) in enumerate(DRAWINGS.items()):
            drawing = draw_metric(board)
            if drawing is not None:
                made[name] = picture(*drawing, name, f"f{index}")
    return made


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


def _short_title(row: LeaderboardRow, width: int = 18) -> str:
    """Number and name on at most two lines of a drawing; the number tells names apart that are cut."""
    return "\n".join(textwrap.wrap(row.title, width, max_lines=2, placeholder="…"))


def work_precision(board: Leaderboard) -> Drawing:
    """Accuracy against time: a large mark for each estimator at the medians over problems, a small one for each."""
    row_styles = _styles(board.rows)
    series, absent = [], []
    for row in board.rows:
        points = _time_and_error(row, board.problems)
        if not len(points):
            absent.append(row.name)
            continue
        title, style = _short_title(row, 30), row_styles[row.number]
        time, error = np.median(points, axis=0)
        series.append(Series(title, [time], [error], style, size=10.0))
        problem_times, problem_errors = points.T
        series.append(Series(title, problem_times, problem_errors, replace(style, marker="."), size=5.0))
    if not series:
        return None
    panel = Panel("time of an answer / times the reference", "rms error of the response / %", series, log="xy")
    caption = CAPTIONS["accuracy_and_time"] % board.problems_in_words()
    if absent:
        caption += f" Not drawn, since a number of theirs is missing: {', '.join(absent)}."
    # The legend above has two estimators side by side, each on a line or two.
    return draw(with_log_ranges([panel]), row_height=3.0 + 0.1 * len(series)), caption


def _time_and_error(row: LeaderboardRow, problems: Sequence[str]) -> np.ndarray:
    """Time over the reference and response error in percent, of each problem (k, 2); none where one lacks."""
    times = {metric_part.label: metric_part.value for metric_part in row.parts("speed")}
    errors = row.answered_errors()
    pairs = [(times.get(problem, np.nan), errors.get(problem, np.nan)) for problem in problems]
    points = np.array(pairs).reshape(-1, 2)
    return points if np.isfinite(points).all() and (points > 0.0).all() else points[:0]


def by_part(
    board: Leaderboard, name: str, log: Literal["", "x"] = "", containing: str = "", limits: Sequence[float] = ()
) -> Drawing:
    """A panel for each part of a metric that has a value in any row, a line for each estimator in it.

    Args:
        board: The estimators.
        name: Of the metric.
        log: Whether its axis is logarithmic.
        containing: Parts are drawn whose labels hold this; all where none does.
        limits: Values at which lines stand across all panels.
    """
    all_parts = chain.from_iterable(row.parts(name) for row in board.rows)
    measured = list(dict.fromkeys(metric_part.label for metric_part in all_parts if isfinite(metric_part.value)))
    labels = [label for label in measured if containing in label] or measured
    if not labels:
        return None
    # Downwards, as the rows of the tables.
    y_limits = (len(board.rows) - 0.45, -0.55)
    row_styles = _styles(board.rows)
    panels = []
    for label in labels[:MOST_PANELS]:
        parts_of_rows = [_part_of(row, name, label) for row in board.rows]
        series = _series_of_parts(board.rows, parts_of_rows, row_styles)
        marks = (*(("x", limit, "") for limit in limits), *_marks_of_parts(parts_of_rows))
        unit = board.metrics[name].unit
        panels.append(Panel(unit, "", series, _spaced(label), log, y_limits=y_limits, marks=marks))
    if log:
        # At least from half to twice the expected value, so that small differences do not look large.
        panels = with_log_ranges(panels, at_least=(0.5, 2.0))
    rest = f" Drawn are {MOST_PANELS} of {len(labels)} parts." if len(labels) > MOST_PANELS else ""
    figure = draw(panels, min(2, len(panels)), name_marks=True, shared=True, row_height=0.55 + 0.25 * len(board.rows))
    return figure, f"{title_of(board, name)}, {CAPTIONS['parts']}{rest}"


def _part_of(row: LeaderboardRow, name: str, label: str) -> Part:
    """The part of an estimator's metric with a label, or one without a value."""
    return next((metric_part for metric_part in row.parts(name) if metric_part.label == label), unjudged(label, ""))


def _series_of_parts(
    rows: Sequence[LeaderboardRow], parts_of_rows: Sequence[Part], row_styles: Mapping[int, Style]
) -> list[Series]:
    """Expected values, limits, and each estimator's value and interval."""
    names = [_short_title(row) for row in rows]
    expected = [metric_part.expected for metric_part in parts_of_rows]
    # The first series has all names, which makes them the axis. Its marks are as high as a row: they join to a line.
    series = [Series("expected", expected, names, Style(TRUTH, "", 1.0, "|"), size=20.0)]
    for side, bracket in enumerate(("$[$", "$]$")):
        ends = [metric_part.limits[side] for metric_part in parts_of_rows]
        series.append(Series("limits", ends, names, Style(BOUND.colour, "", 1.0, bracket), size=7.0))
    # Verdicts stand in the legend in the colour of no estimator.
    series += [Series(verdict.word, [], [], Style(INK, "", 1.0, verdict.marker)) for verdict in Verdict]
    for row, name, metric_part in zip(rows, names, parts_of_rows, strict=True):
        style = replace(row_styles[row.number], marker=metric_part.verdict.marker)
        low, high = metric_part.interval
        series.append(Series(metric_part.verdict.word, [metric_part.value], [name], style, [low], [high], along=True))
    return series


def _marks_of_parts(parts_of_rows: Sequence[Part]) -> list[tuple[str, float, str]]:
    """Lines of estimators without a value that can be drawn, with the reason."""
    marks = []
    for line, metric_part in enumerate(parts_of_rows):
        if not abs(metric_part.value) < LARGEST:
            reason = "no value" if isnan(metric_part.value) else number(metric_part.value)
            marks.append(("y", float(line), reason))
    return marks


def bandwidths(board: Leaderboard) -> Drawing:
    """A panel for each joint and excitation of the arm, the ends of the range near the thesis' 1 Hz marked."""
    drawing = by_part(board, "bandwidth", "x", limits=ABOUT_1_HZ)
    return None if drawing is None else (drawing[0], CAPTIONS["bandwidth"])


def responses(board: Leaderboard) -> Drawing:
    """A panel for each estimator and problem: rms error, claimed band, bound and truth over frequency."""
    problems = _labels_of_curves(board, "frequency_response")
    if not problems:
        return None
    figure = _by_curve(board, "frequency_response", problems[:MOST_COLUMNS], "frequency / Hz", _response_series)
    rest = ""
    if len(problems) > MOST_COLUMNS:
        rest = f" Drawn are the first {MOST_COLUMNS} of {len(problems)} problems."
    return figure, f"{CAPTIONS['frequency_response']}{rest}"


def _response_series(curve: Curve) -> list[Series]:
    series = []
    for key, (words, style) in RESPONSES.items():
        if key in curve:
            rms = np.sqrt(np.mean(curve[key] ** 2, axis=(1, 2)))
            series.append(Series(words, curve["frequencies_hz"], rms, style))
    return series


def splits(board: Leaderboard) -> Drawing:
    """A panel for each estimator and joint of the arm: systematic error, noise and distortion over amplitude."""
    joints = _labels_of_curves(board, "amplitude_split")[:MOST_COLUMNS]
    if not joints:
        return None
    figure = _by_curve(board, "amplitude_split", joints, "amplitude of the command / mrad", _split_series)
    return figure, CAPTIONS["amplitude_split"]


def _split_series(curve: Curve) -> list[Series]:
    series = []
    for index, (share, (words, style)) in enumerate(SHARES.items()):
        beside = curve["mrad"] * 1.06 ** (index - 1)  # so that bars do not hide one another
        low, high = curve[f"{share}_interval"].T
        series.append(Series(words, beside, curve[share], style, low, high))
        if f"expected_{share}" in curve:
            series.append(Series(words, beside, curve[f"expected_{share}"], Style(style.colour, ":", 0.9)))
    series.append(Series("limit of the systematic error", curve["mrad"], curve["systematic_limit"], LIMIT, size=8.0))
    return series


def _by_curve(
    board: Leaderboard, metric: str, columns: Sequence[str], x: str, series_of: Callable[[Curve], list[Series]]
) -> Figure:
    """Draw the curves of a metric: a row of panels for each estimator, a column for each problem or joint."""
    panels = []
    for row in board.rows:
        for column in columns:
            curve = row.curves[metric].get(column)
            # A panel without series says that the curve is missing.
            series = [] if curve is None else series_of(curve)
            title = _spaced(column) if row is board.rows[0] else ""
            panels.append(Panel(x, _short_title(row, 14), series, title, "xy"))
    return draw(with_log_ranges(panels), len(columns), shared=True, row_height=0.95)


def _labels_of_curves(board: Leaderboard, metric: str) -> list[str]:
    return list(dict.fromkeys(chain.from_iterable(row.curves[metric] for row in board.rows)))


def _spaced(label: str) -> str:
    return label.replace("_", " ")


DRAWINGS: Mapping[str, Callable[[Leaderboard], Drawing]] = {
    "accuracy_and_time": work_precision,
    "efficiency": lambda board: by_part(board, "efficiency", "x"),
    "coverage": lambda board: by_part(board, "coverage", containing="response"),
    "frequency_response": responses,
    "amplitude_split": splits,
    "bias": lambda board: by_part(board, "bias", "x"),
    "bandwidth": bandwidths,
}
"""Drawings by metric, and accuracy against time; the other metrics have their tables."""
