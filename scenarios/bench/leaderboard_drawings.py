"""Drawings of the leaderboard: metrics problem by problem, recovered bandwidths, accuracy against time."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, MaxNLocator, SymmetricalLogLocator

from scenarios.bench.leaderboard_curves import MOST, label, literal, plain_ticks, responses, splits, styles
from scenarios.bench.leaderboard_rows import LeaderboardRow, common_problems, drawable, listed, numbers, scalar
from scenarios.bench.leaderboard_tables import title, unit
from scenarios.bench.leaderboard_verdict import Verdict, part_verdict
from scenarios.bench.metric import Part
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress, plain_marks
from scenarios.report.figures import Gallery, Picture
from sysid.plots.palette import BOUND, GRID, INK, PALETTE, Style

MARKERS = {
    Verdict.PASSES: "o",
    Verdict.FAILS: "X",
    Verdict.FAILS_AS_THEORY_SAYS: "^",
    Verdict.NONE: "o",
}
"""Shapes of verdicts; without a verdict the circle is open."""

MOST_PANELS = 8
"""Parts of a metric that are drawn; the table has the others."""

FAR = 10.0
"""Value from which on an axis about 0 becomes logarithmic beyond 1."""

EXCITATION_STYLES = ("armax", "oe", "okid", "n4sid", "spa", "pem_ss", "bj")
"""Styles of the excitations, from top to bottom of a row."""

ONE_HZ = "#f3ead2"
ABOUT_ONE_HZ = (0.9, 1.1)
"""Shaded band where a result does not define one, Hz."""

MOST_NAMES = 12
"""Estimators that are called by their names; more by their numbers alone."""

HALO = [withStroke(linewidth=2.5, foreground="white")]


def drawing(rows: Sequence[LeaderboardRow], name: str, gallery: Gallery) -> Picture | None:
    """The drawing of a metric; None where it has none or no row has the numbers for it."""
    draw = DRAWINGS.get(name)
    drawn = None if draw is None else draw(rows)
    return None if drawn is None else add(gallery, drawn, name.replace("_", "-"))


def overview(rows: Sequence[LeaderboardRow], gallery: Gallery) -> Picture | None:
    """Accuracy against time; None where no row has both."""
    drawn = work_precision(rows)
    return None if drawn is None else add(gallery, drawn, "accuracy-and-time")


def add(gallery: Gallery, drawn: tuple[Figure, str], name: str) -> Picture:
    """Add a figure with its caption to the page."""
    with warnings.catch_warnings():
        # Names in scripts that the font lacks are boxes in the drawing; the tables have them whole.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font", category=UserWarning)
        return gallery.add(*drawn, name=name)


def parts_drawn(
    rows: Sequence[LeaderboardRow], name: str, *, logarithmic: bool = False, far: bool = False, chosen: str = ""
) -> tuple[Figure, str] | None:
    """A panel for each part of a metric, a line for each estimator in it.

    Args:
        rows: The rows.
        name: Of the metric.
        logarithmic: Whether its axis is.
        far: Whether values about 0 and far beyond 1 are both of interest: the axis is linear up to 1, then logarithmic.
        chosen: Parts are drawn whose labels hold this; all where none does.

    Returns:
        The figure and its caption; None where nothing was measured.
    """
    table = {row.number: {part.label: part for part in m.parts} for row in rows if (m := row.metric(name))}
    labels = list(dict.fromkeys(text for parts in table.values() for text in parts))
    known = [text for text in labels if any(drawable(p[text].value) for p in table.values() if text in p)]
    if not known:
        return None
    known = [text for text in known if chosen in text] or known
    rest = f" Drawn are {MOST_PANELS} of {len(known)} parts." if len(known) > MOST_PANELS else ""
    known = known[:MOST_PANELS]
    columns = min(2, len(known))
    lines = -(-len(known) // columns)
    figure = Figure(figsize=(WIDTH, 0.7 + lines * (0.55 + 0.25 * len(rows))), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False, sharey=True)
    looks = styles(rows)
    for axes, text in zip(panels.flat, known, strict=False):
        for line, row in enumerate(rows):
            part = table.get(row.number, {}).get(text)
            if part is not None:
                _part(axes, line, part, looks[row.number], logarithmic)
        expected = [p[text].expected for p in table.values() if text in p and drawable(p[text].expected)]
        if expected:
            axes.axvline(expected[0], color=PALETTE["truth"].colour, lw=0.9, zorder=1)
        axes.set_title(literal(one_line(text)), fontsize=8, loc="left")
        if logarithmic:
            axes.set_xscale("log")
        elif far and -1.0 < axes.dataLim.x0 < 1.0 and axes.dataLim.x1 > FAR:
            low, high = axes.dataLim.intervalx
            axes.set_xscale("symlog", linthresh=1.0)
            axes.set_xlim(low - 0.2, 2.0 * high)
            axes.xaxis.set_major_locator(SymmetricalLogLocator(base=10.0, linthresh=1.0))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    drawn = list(panels.flat)[: len(known)]
    for axes in list(panels.flat)[len(known) :]:
        axes.set_axis_off()
    _name_lines(panels[0, 0], rows, 0.4)
    if logarithmic:
        ends = [axes.get_xlim() for axes in drawn]
        # One range for all panels, at least from half to twice, so that they compare at a glance.
        low, high = min(0.5, *(end for end, _ in ends)), max(2.0, *(end for _, end in ends))
        for axes in drawn:
            axes.set_xlim(low, high)
            plain_marks(axes.xaxis, (low, high))
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=7, left=False)
    figure.supxlabel(literal(unit(rows, name)), fontsize=8)
    signs = [_dot(INK, word.word, MARKERS[word], filled=word is not Verdict.NONE) for word in Verdict]
    figure.legend(handles=signs, loc="outside upper left", ncols=3, frameon=False, fontsize=7)
    return figure, (
        f"{title(rows, name)}, problem by problem. Bars: 95 % Monte-Carlo interval; brackets: limits within which a "
        "value passes, for each estimator by its own number of records; black line: what is expected." + rest
    )


def _part(axes: Axes, line: int, part: Part, style: Style, logarithmic: bool) -> None:
    for limit, sign in zip(part.limits, "[]", strict=True):
        if drawable(limit) and not (logarithmic and limit <= 0.0):
            axes.text(limit, line, sign, color=BOUND.colour, fontsize=9, ha="center", va="center", clip_on=True)
            axes.update_datalim([(limit, line)])
    if not drawable(part.value) or (logarithmic and part.value <= 0.0):
        word = "no value" if math.isnan(part.value) or not part.value else f"{part.value:.0e}".replace("inf", "∞")
        place = axes.annotate(word, (0.02, line), xycoords=axes.get_yaxis_transform(), va="center", zorder=3)
        place.set(fontsize=6.5, color=BOUND.colour, path_effects=HALO)
        return
    ends = np.array(part.interval)
    if drawable(ends).all():
        axes.hlines(line, *(np.maximum(ends, 1e-3 * part.value) if logarithmic else ends), color=style.colour, lw=1.6)
    judged = part_verdict(part)
    (mark,) = axes.plot(part.value, line, MARKERS[judged], color=style.colour, zorder=3)
    mark.set(mfc="white" if judged is Verdict.NONE else style.colour, ms=4 if judged is Verdict.PASSES else 5.5)
    axes.autoscale_view()


def bandwidths(rows: Sequence[LeaderboardRow]) -> tuple[Figure, str] | None:
    """A panel for each joint of the arm, a row for each estimator, a line of points for each excitation.

    Returns:
        The figure and its caption; None where no row has bandwidths.
    """
    classes = [(line, entry) for line, row in enumerate(rows) for entry in _classes(row)]
    joints = list(dict.fromkeys(entry["joint"] for _, entry in classes))[:MOST]
    if not joints:
        return None
    kinds = sorted({(str(e["excitation"]), e["mrad"], e["text"]) for _, e in classes})
    places = {text: place for place, (_, _, text) in enumerate(kinds)}
    colours = {
        text: PALETTE[EXCITATION_STYLES[place % len(EXCITATION_STYLES)]].colour for text, place in places.items()
    }
    truth = PALETTE["truth"].colour
    height = 1.3 + (0.22 + 0.09 * len(kinds)) * len(rows)
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    panels = figure.subplots(1, len(joints), squeeze=False, sharey=True)[0]
    for axes, joint in zip(panels, joints, strict=True):
        axes.axvspan(*_about_one_hz(rows), color=ONE_HZ, lw=0, zorder=0)
        axes.set_xscale("log")
        entries = [(line, entry) for line, entry in classes if entry["joint"] == joint]
        for line, entry in entries:
            at = line + 0.8 * ((places[entry["text"]] + 0.5) / len(places) - 0.5)
            hz, colour = entry["hz"], colours[entry["text"]]
            if np.isfinite(entry["best_linear"]):
                axes.plot(entry["best_linear"], at, "|", color=truth, ms=6, mew=1.0, zorder=2)
            if len(hz):
                axes.plot(hz, np.full(len(hz), at), "o", color=colour, ms=2.4, alpha=0.6, mew=0, zorder=3)
            elif entry["models"]:
                axes.plot(0.02, at, "x", color=colour, ms=3.5, transform=axes.get_yaxis_transform(), zorder=3)
        if entries and np.isfinite(small := entries[0][1]["small_signal"]):
            axes.axvline(small, color=truth, lw=0.9, zorder=1)
        axes.set_title(literal(one_line(joint).replace("_", " ")), fontsize=8)
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        plain_ticks(axes)
    _name_lines(panels[0], rows, 0.45)
    dress(panels)
    for axes in panels:
        axes.tick_params(labelsize=7, left=False)
        axes.grid(False, axis="y")
        for line in range(1, len(rows)):
            axes.axhline(line - 0.5, color=GRID, lw=0.6)
    figure.supxlabel("bandwidth / Hz", fontsize=8)
    signs: list[Line2D | Patch] = [_dot(colours[text], literal(text), "o", size=4) for text in places]
    signs += [
        _dot(truth, "best linear truth", "|", size=7),
        Line2D([], [], color=truth, lw=0.9, label="truth of small signals"),
        Patch(color=ONE_HZ, label="near 1 Hz"),
    ]
    figure.legend(handles=signs, loc="outside upper left", ncols=3, frameon=False, fontsize=7)
    return figure, (
        "Bandwidths that each estimator finds, a point for each record, by excitation from top to bottom. Ticks: the "
        "best linear truth of that excitation, which friction and limits lower; black line: truth of small signals; "
        "shaded: near 1 Hz. Records whose model claims no bandwidth have no point; × at the left where none has."
    )


def _classes(row: LeaderboardRow) -> list[dict[str, Any]]:
    """Bandwidths by joint and excitation; malformed entries are left out."""
    entries = row.curves("bandwidth").get("classes")
    classes = []
    for entry in entries if isinstance(entries, list | tuple) else ():
        if not isinstance(entry, Mapping) or not isinstance(entry.get("joint"), str):
            continue
        hz = numbers(entry.get("hz"))
        hz = np.empty(0) if hz is None else hz[np.isfinite(hz) & (hz > 0.0)]
        kind, mrad, models = one_line(str(entry.get("excitation"))), scalar(entry, "mrad"), entry.get("models")
        classes.append(
            {
                "joint": entry["joint"],
                "excitation": kind,
                "mrad": mrad,
                "text": f"{kind} {mrad:g} mrad",
                "hz": hz,
                "models": models if isinstance(models, int) else len(hz),
                "small_signal": scalar(entry, "small_signal"),
                "best_linear": scalar(entry, "best_linear"),
            }
        )
    return classes


def _about_one_hz(rows: Sequence[LeaderboardRow]) -> tuple[float, float]:
    for row in rows:
        ends = numbers(row.curves("bandwidth").get("about_1_hz"))
        if ends is not None and len(ends) == 2 and 0.0 < ends[0] < ends[1]:
            return float(ends[0]), float(ends[1])
    return ABOUT_ONE_HZ


def work_precision(rows: Sequence[LeaderboardRow]) -> tuple[Figure, str] | None:
    """A large mark for each estimator at the medians over problems, a small one for each problem.

    Returns:
        The figure and its caption; None where no row has both numbers of all problems that were asked of all rows.
    """
    problems = common_problems(rows)
    clouds = [(row, points) for row in rows if len(points := _points(row, problems))]
    if not clouds:
        return None
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    looks = styles(rows)
    few = len(clouds) <= MOST_NAMES
    for row, points in clouds:
        look = looks[row.number]
        axes.plot(points[:, 0], points[:, 1], look.marker, color=look.colour, ms=3, alpha=0.5, ls="")
        axes.plot(
            *np.median(points, axis=0),
            look.marker,
            color=look.colour,
            ms=9,
            mec="white",
            mew=0.8,
            zorder=3,
            label=label(row) if few else str(row.number),
        )
    axes.set(xscale="log", yscale="log", xlabel="time of an answer / rulers", ylabel="rms error of the response / %")
    dress([axes])
    axes.margins(0.14, 0.12)
    axes.autoscale_view()
    plain_marks(axes.xaxis, axes.get_xlim())
    plain_marks(axes.yaxis, axes.get_ylim())
    figure.legend(loc="outside right upper", frameon=False, fontsize=7.5, labelspacing=0.8)
    present = {row.number for row, _ in clouds}
    absent = [row.name for row in rows if row.number not in present]
    caption = (
        "Accuracy against time, both better to the lower left. Large marks: median over the problems that were asked "
        f"of all rows ({listed(problems)}); small ones: each of them. The error is relative to the true response; a "
        "ruler is the time of a fixed least-squares problem on the same record in the same run."
    ) + ("" if few else " Numbers are those of the tables.")
    return figure, caption + (
        f" Not drawn, since a number of theirs is missing: {', '.join(absent)}." if absent else ""
    )


def _points(row: LeaderboardRow, problems: Sequence[str]) -> np.ndarray:
    """Time in rulers and error of the response in percent, of each problem (k, 2); none where one lacks."""
    speed, errors = row.metric("speed"), row.answered_errors()
    times = {} if speed is None else {part.label: part.value for part in speed.parts}
    points = np.array([(times.get(name, np.nan), errors.get(name, np.nan)) for name in problems]).reshape(-1, 2)
    return points if np.isfinite(points).all() and (points > 0.0).all() else points[:0]


def _name_lines(axes: Axes, rows: Sequence[LeaderboardRow], margin: float) -> None:
    axes.set_ylim(len(rows) - margin, margin - 1.0)
    axes.set_yticks(range(len(rows)), [label(row) for row in rows])


def _dot(colour: str, text: str, marker: str, *, size: float = 5, filled: bool = True) -> Line2D:
    return Line2D([], [], color=colour, ls="", marker=marker, ms=size, label=text, mfc=colour if filled else "white")


DRAWINGS: Mapping[str, Callable[[Sequence[LeaderboardRow]], tuple[Figure, str] | None]] = {
    "efficiency": lambda rows: parts_drawn(rows, "efficiency", logarithmic=True),
    "coverage": lambda rows: parts_drawn(rows, "coverage", chosen="response"),
    "frequency_response": responses,
    "amplitude_split": splits,
    "bias": lambda rows: parts_drawn(rows, "bias", far=True),
    "bandwidth": bandwidths,
}
"""Drawings by metric; the others have their tables."""
