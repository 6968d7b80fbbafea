"""Accuracy against time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_response_error import answered, compared, told
from scenarios.bench.leaderboard_style import label, styles
from scenarios.report.figure_style import WIDTH, dress
from scenarios.report.probability import plain_marks
from sysid.records.arrays import FloatArray

MOST_NAMES = 12
"""Estimators that are called by their names; more by their numbers alone."""


def work_precision(entries: Sequence[Entry]) -> tuple[Figure, str] | None:
    """A large mark for each estimator at the medians over problems, a small one for each problem.

    Returns:
        The figure and its caption; None where no row has both numbers of all problems that were asked of all rows.
    """
    problems = compared(entries)
    clouds = [(entry, found) for entry in entries if len(found := _points(entry, problems))]
    if not clouds:
        return None
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.subplots()
    looks = styles(entries)
    for entry, points in clouds:
        look = looks[entry.number]
        middle = np.median(points, axis=0)
        axes.plot(points[:, 0], points[:, 1], look.marker, color=look.colour, ms=3, alpha=0.5, ls="")
        axes.plot(*middle, look.marker, color=look.colour, ms=9, mec="white", mew=0.8, zorder=3)
    axes.set(xscale="log", yscale="log", xlabel="time of an answer / rulers", ylabel="rms error of the response / %")
    dress([axes])
    axes.margins(0.14, 0.12)
    axes.autoscale_view()
    plain_marks(axes.xaxis, axes.get_xlim())
    plain_marks(axes.yaxis, axes.get_ylim())
    few = len(clouds) <= MOST_NAMES
    names = {entry.number: label(entry) if few else str(entry.number) for entry, _ in clouds}
    _labels(figure, {names[e.number]: (np.median(points, axis=0), looks[e.number].colour) for e, points in clouds})
    present = {entry.number for entry, _ in clouds}
    absent = [entry.name for entry in entries if entry.number not in present]
    caption = (
        "Accuracy against time, both better to the lower left. Large marks: median over the problems that were asked "
        f"of all rows ({told(problems)}); small ones: each of them. The error is relative to the true response; a "
        "ruler is the time of a fixed least-squares problem on the same record in the same run."
    ) + ("" if few else " Numbers are those of the tables.")
    return figure, caption + (
        f" Not drawn, since a number of theirs is missing: {', '.join(absent)}." if absent else ""
    )


def _points(entry: Entry, problems: Sequence[str]) -> FloatArray:
    """Multiple of the ruler and error of the response in percent, of each problem (k, 2); none where one lacks."""
    speed = entry.figure("speed")
    errors = answered(entry)
    times = {} if speed is None else {part.label: part.value for part in speed.parts}
    found = np.array([(times.get(name, np.nan), errors.get(name, np.nan)) for name in problems]).reshape(-1, 2)
    return found if np.isfinite(found).all() and (found > 0.0).all() else found[:0]


def _labels(figure: Figure, wanted: dict[str, tuple[FloatArray, str]]) -> None:
    """Names beside their marks, moved up or down as far as keeps them apart from one another and from all marks."""
    axes = figure.axes[0]
    figure.draw_without_rendering()
    unit = figure.dpi / 72.0
    places = {text: axes.transData.transform(at) for text, (at, _) in wanted.items()}
    half = 6.0 * unit
    taken = [(x - half, y - half, x + half, y + half) for x, y in places.values()]
    right = axes.bbox.x1
    for text in sorted(wanted, key=lambda text: -places[text][1]):
        at, colour = wanted[text]
        lines = text.split("\n")
        width, height = 4.6 * unit * max(map(len, lines)), 9.5 * unit * len(lines)
        x, y = places[text]
        fits = x + width + 8 * unit <= right
        for step in range(80):
            left = not fits or step % 2 == 1
            box_left = x - width - 8 * unit if left else x + 8 * unit
            shift = (step // 2 + 1) // 2 * (-1) ** (step // 2) * 4.0 * unit
            box = (box_left, y + shift - height / 2, box_left + width, y + shift + height / 2)
            if not any(b[0] < box[2] and box[0] < b[2] and b[1] < box[3] and box[1] < b[3] for b in taken):
                break
        taken.append(box)
        axes.annotate(
            text,
            tuple(at),
            xytext=((-8 if left else 8), shift / unit),
            textcoords="offset points",
            fontsize=7.5,
            color=colour,
            ha="right" if left else "left",
            va="center",
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            zorder=4,
            arrowprops={"arrowstyle": "-", "lw": 0.5, "color": colour, "relpos": (1.0 if left else 0.0, 0.5)}
            if abs(shift) > 6 * unit
            else None,
        )
