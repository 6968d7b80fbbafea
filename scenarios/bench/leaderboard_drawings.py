"""Drawings of the leaderboard: metrics by problem, accuracy against time, errors over frequency and amplitude."""

import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullLocator

from scenarios.bench.leaderboard_rows import Curve, LeaderboardRow, common_problems, listed
from scenarios.bench.leaderboard_tables import UNKNOWN, number, title, unit
from scenarios.bench.leaderboard_verdict import WORDS, Verdict, part_verdict
from scenarios.bench.metric import Part
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import WIDTH, dress, plain_marks
from scenarios.report.figures import Gallery, Picture
from sysid.plots.palette import BOUND, DISTORTION, GRID, INK, NOISE, PALETTE, Style

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

NOT_METHODS = ("truth", "measured", "bla", "published", "welch", "etfe", "cra", "spa")
"""Styles of the palette that are of no method."""

MOST_PANELS = 8
"""Parts of a metric that are drawn; the table has the others."""

EXCITATION_STYLES = ("armax", "oe", "okid", "n4sid", "spa", "pem_ss", "bj")
"""Styles of the excitations, from top to bottom of a row."""

ONE_HZ = "#f3ead2"

MOST_NAMES = 12
"""Estimators that are called by their names; more by their numbers alone."""


def add(gallery: Gallery, drawing: Drawing, name: str) -> Picture | None:
    """Add a figure with its caption to the page; None where there is none."""
    with warnings.catch_warnings():
        # Names in scripts that the font lacks are boxes in the drawing; the tables have them whole.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        return drawing and gallery.add(*drawing, name=name.replace("_", "-"))


def styles(rows: Sequence[LeaderboardRow]) -> dict[int, Style]:
    """Style of each estimator by its number: that of the method that its name ends in, else one that is free.

    With more estimators than styles, styles repeat; drawings name each estimator by its number too.
    """
    methods = {name: style for name, style in PALETTE.items() if name not in NOT_METHODS}
    chosen: dict[int, Style] = {}
    free = dict(methods)
    for row in rows:
        words = "_" + row.name.lower().replace("-", "_")
        if named := [name for name in free if words.endswith(f"_{name}")]:
            chosen[row.number] = free.pop(max(named, key=len))
    spare = list(free.values()) or list(methods.values())
    others = [row for row in rows if row.number not in chosen]
    return chosen | {row.number: spare[k % len(spare)] for k, row in enumerate(others)}


def parts_drawn(rows: Sequence[LeaderboardRow], name: str, *, scale: str = "linear", chosen: str = "") -> Drawing:
    """A panel for each part of a metric, a line for each estimator in it.

    Args:
        rows: The rows.
        name: Of the metric.
        scale: Of its axis: linear, log, or symlog, which is linear up to 1.
        chosen: Parts are drawn whose labels hold this; all where none does.
    """
    parts = {row.number: {part.label: part for part in m.parts} for row in rows if (m := row.metric(name))}
    known = list(dict.fromkeys(p.label for of_row in parts.values() for p in of_row.values() if isfinite(p.value)))
    if not known:
        return None
    known = [text for text in known if chosen in text] or known
    figure, panels = _strips(rows, known[:MOST_PANELS], 0.55 + 0.25 * len(rows))
    looks = styles(rows)
    for text, axes in panels.items():
        axes.set_xscale(scale, **({"linthresh": 1.0} if scale == "symlog" else {}))
        for line, row in enumerate(rows):
            part = parts.get(row.number, {}).get(text)
            if part is not None:
                _part(axes, line, part, looks[row.number].colour)
                if isfinite(part.expected):
                    axes.axvline(part.expected, color=PALETTE["truth"].colour, lw=0.9, zorder=1)
        if scale == "symlog":
            axes.xaxis.set_major_formatter("{x:g}")
    if scale == "log":
        # One range for all panels, at least from half to twice, so that they compare at a glance.
        ends = [axes.get_xlim() for axes in panels.values()]
        low, high = min(0.5, *(end for end, _ in ends)), max(2.0, *(end for _, end in ends))
        for axes in panels.values():
            axes.set_xlim(low, high)
            plain_marks(axes.xaxis, (low, high))
    figure.supxlabel(literal(unit(rows, name).removeprefix(" / ")), fontsize=8)
    _legend(figure, (_dot(INK, word.word, word.marker, filled=word is not Verdict.NONE) for word in Verdict))
    rest = f" Drawn are {MOST_PANELS} of {len(known)} parts." if len(known) > MOST_PANELS else ""
    return figure, f"{title(rows, name)}, {WORDS['captions']['parts']}{rest}"


def _part(axes: Axes, line: int, part: Part, colour: str) -> None:
    """Value, interval and limits of a part; matplotlib leaves out what is unknown or infinite."""
    for limit, sign in zip(part.limits, ("$[$", "$]$"), strict=True):
        axes.plot(limit, line, marker=sign, color=BOUND.colour, ms=7, mew=0.3)
    axes.plot(part.interval, (line, line), color=colour, lw=1.6)
    judged = part_verdict(part)
    (mark,) = axes.plot(part.value, line, judged.marker, color=colour, zorder=3)
    mark.set(mfc="white" if judged is Verdict.NONE else colour, ms=4 if judged is Verdict.PASSES else 5.5)
    if not isfinite(part.value) or (axes.get_xscale() == "log" and part.value <= 0.0):
        word, place = number(part.value).replace(UNKNOWN, "no value"), axes.get_yaxis_transform()
        axes.text(0.02, line, word, transform=place, va="center", fontsize=6.5, color=BOUND.colour)


def bandwidths(rows: Sequence[LeaderboardRow]) -> Drawing:
    """A panel for each joint of the arm, a row for each estimator, a line of points for each excitation."""
    labels = [name.split(" ", 1) for row in rows for name in row.curves["bandwidth"]]
    joints = list(dict.fromkeys(joint for joint, _ in labels))[:MOST]
    if not joints:
        return None
    kinds = sorted({kind for _, kind in labels}, key=lambda kind: (kind.split()[0], float(kind.split()[1])))
    colours = [PALETTE[EXCITATION_STYLES[place % len(EXCITATION_STYLES)]].colour for place in range(len(kinds))]
    truth = PALETTE["truth"].colour
    figure, panels = _strips(rows, joints, 0.6 + (0.22 + 0.09 * len(kinds)) * len(rows), columns=len(joints))
    for joint, axes in panels.items():
        axes.axvspan(*ABOUT_1_HZ, color=ONE_HZ, lw=0, zorder=0)
        axes.set_xscale("log")
        for line, row in enumerate(rows):
            for place, kind in enumerate(kinds):
                curve = row.curves["bandwidth"].get(f"{joint} {kind}")
                if curve is None:
                    continue
                at, colour = line + 0.8 * ((place + 0.5) / len(kinds) - 0.5), colours[place]
                axes.plot(curve["best_linear"], at, "|", color=truth, ms=6, mew=1.0, zorder=2)
                axes.plot(curve["hz"], np.full(len(curve["hz"]), at), "o", color=colour, ms=2.4, alpha=0.6, mew=0)
                if curve["models"] and not len(curve["hz"]):
                    axes.plot(0.02, at, "x", color=colour, ms=3.5, transform=axes.get_yaxis_transform())
                axes.axvline(float(curve["small_signal"]), color=truth, lw=0.9, zorder=1)
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))  # the range is less than a decade
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(False, axis="y")
        for line in range(1, len(rows)):
            axes.axhline(line - 0.5, color=GRID, lw=0.6)
    figure.supxlabel("bandwidth / Hz", fontsize=8)
    signs: list[Line2D | Patch] = [
        *(_dot(colour, literal(kind), "o", size=4) for kind, colour in zip(kinds, colours, strict=True)),
        _dot(truth, "best linear truth", "|", size=7),
        Line2D([], [], color=truth, lw=0.9, label="truth of small signals"),
        Patch(color=ONE_HZ, label="near 1 Hz"),
    ]
    _legend(figure, signs)
    return figure, WORDS["captions"]["bandwidth"]


def work_precision(rows: Sequence[LeaderboardRow]) -> Drawing:
    """Accuracy against time: a large mark for each estimator at the medians over problems, a small one for each."""
    problems = common_problems(rows)
    clouds = {row.number: points for row in rows if len(points := _points(row, problems))}
    if not clouds:
        return None
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    looks, few = styles(rows), len(clouds) <= MOST_NAMES
    for row in rows:
        if row.number in clouds:
            points, look = clouds[row.number], looks[row.number]
            axes.plot(*points.T, look.marker, color=look.colour, ms=3, alpha=0.5)
            name = label(row) if few else str(row.number)
            (mark,) = axes.plot(*np.median(points, axis=0), look.marker, color=look.colour, ms=9, label=name)
            mark.set(mec="white", mew=0.8, zorder=3)
    axes.set(xscale="log", yscale="log", xlabel="time of an answer / times the reference")
    axes.set_ylabel("rms error of the response / %")
    dress([axes])
    axes.margins(0.14, 0.12)
    plain_marks(axes.xaxis, axes.get_xlim())
    plain_marks(axes.yaxis, axes.get_ylim())
    figure.legend(loc="outside right upper", frameon=False, fontsize=7.5, labelspacing=0.8)
    absent = [row.name for row in rows if row.number not in clouds]
    caption = WORDS["captions"]["accuracy_and_time"] % listed(problems)
    caption += "" if few else " Numbers are those of the tables."
    return figure, caption + (f" Not drawn, since a number of theirs is missing: {', '.join(absent)}." * bool(absent))


def _points(row: LeaderboardRow, problems: Sequence[str]) -> np.ndarray:
    """Time over the reference and response error in percent, of each problem (k, 2); none where one lacks."""
    speed, errors = row.metric("speed"), row.answered_errors()
    times = {} if speed is None else {part.label: part.value for part in speed.parts}
    points = np.array([(times.get(name, np.nan), errors.get(name, np.nan)) for name in problems]).reshape(-1, 2)
    return points if np.isfinite(points).all() and (points > 0.0).all() else points[:0]


def _strips(
    rows: Sequence[LeaderboardRow], titles: Sequence[str], height: float, columns: int = 2
) -> tuple[Figure, dict[str, Axes]]:
    """Panels by title, each of them with a line for each estimator."""
    columns = min(columns, len(titles))
    lines = -(-len(titles) // columns)
    figure = Figure(figsize=(WIDTH, 0.7 + lines * height), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharey=True)
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=7, left=False)
    for axes in panels.flat[len(titles) :]:
        axes.set_axis_off()
    for axes, text in zip(panels.flat, titles, strict=False):
        axes.set_title(literal(text).replace("_", " "), fontsize=8, loc="left")
    panels[0, 0].set_ylim(len(rows) - 0.45, -0.55)
    panels[0, 0].set_yticks(range(len(rows)), [label(row) for row in rows])
    return figure, dict(zip(titles, panels.flat, strict=False))


def _legend(figure: Figure, signs: Iterable[Line2D | Patch]) -> None:
    figure.legend(handles=list(signs), loc="outside upper left", ncols=3, frameon=False, fontsize=7)


def _dot(colour: str, text: str, marker: str, *, size: float = 5, filled: bool = True) -> Line2D:
    return Line2D([], [], color=colour, ls="", marker=marker, ms=size, label=text, mfc=colour if filled else "white")


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
    return figure, f"{WORDS['captions']['frequency_response']}{rest}"


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
    return figure, WORDS["captions"]["amplitude_split"]


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


DRAWINGS: Mapping[str, Callable[[Sequence[LeaderboardRow]], Drawing]] = {
    "efficiency": lambda rows: parts_drawn(rows, "efficiency", scale="log"),
    "coverage": lambda rows: parts_drawn(rows, "coverage", chosen="response"),
    "frequency_response": responses,
    "amplitude_split": splits,
    "bias": lambda rows: parts_drawn(rows, "bias", scale="symlog"),  # values about 0 and far beyond 1
    "bandwidth": bandwidths,
}
"""Drawings by metric; the others have their tables."""
