"""Recovered bandwidths of the arm's joints beside what is true and 1 Hz."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter, NullLocator

from scenarios.bench.leaderboard_curves import number_of, numbers
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_style import label, literal
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress
from sysid.plots.palette import GRID, PALETTE
from sysid.records.arrays import FloatArray

NAME = "bandwidth"
MOST = 4
"""Joints that are drawn, side by side: the first ones."""

LOOKS = ("armax", "oe", "okid", "n4sid", "spa", "pem_ss", "bj")
"""Styles of the excitations, in their sequence from top to bottom of a row."""

ONE_HZ = "#f3ead2"
ABOUT = (0.9, 1.1)
"""Shaded where a result does not say what it calls near 1 Hz."""


@dataclass(frozen=True, eq=False)
class Class:
    """Bandwidths under one excitation of one joint, Hz.

    Attributes:
        excitation: Kind and amplitude, in words.
        order: By which excitations are sorted.
        values: Of each record whose model claims one (n,).
        models: Records with a model.
        small_signal: True of small signals.
        best_linear: Of the best linear truth.
    """

    excitation: str
    order: tuple[str, float]
    values: FloatArray
    models: int
    small_signal: float
    best_linear: float


def bandwidths(entries: Sequence[Entry]) -> tuple[Figure, str] | None:
    """A panel for each joint, a row for each estimator, a line of points for each excitation.

    Returns:
        The figure and its caption; None where no row has bandwidths.
    """
    found = {entry.number: _classes(entry) for entry in entries}
    joints = list(dict.fromkeys(joint for classes in found.values() for joint in classes))[:MOST]
    if not joints:
        return None
    kinds = sorted({(c.order, c.excitation) for classes in found.values() for some in classes.values() for c in some})
    places = {excitation: place for place, (_, excitation) in enumerate(kinds)}
    height = 0.22 + 0.09 * len(kinds)
    figure = Figure(figsize=(WIDTH, 1.3 + height * len(entries)), layout="constrained")
    panels = figure.subplots(1, len(joints), squeeze=False, sharey=True)[0]
    for axes, joint in zip(panels, joints, strict=True):
        axes.axvspan(*_about(entries), color=ONE_HZ, lw=0, zorder=0)
        axes.set_xscale("log")
        for line, entry in enumerate(entries):
            for one in found[entry.number].get(joint, ()):
                at = line + 0.8 * ((places[one.excitation] + 0.5) / len(places) - 0.5)
                _draw(axes, one, at, PALETTE[LOOKS[places[one.excitation] % len(LOOKS)]].colour)
        small = [c.small_signal for classes in found.values() for c in classes.get(joint, ())]
        if small and np.isfinite(small[0]):
            axes.axvline(small[0], color=PALETTE["truth"].colour, lw=0.9, zorder=1)
        axes.set_title(literal(one_line(joint).replace("_", " ")), fontsize=8)
        axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylim(len(entries) - 0.45, -0.55)
    panels[0].set_yticks(range(len(entries)), [label(entry) for entry in entries])
    dress(panels)
    for axes in panels:
        axes.tick_params(labelsize=7, left=False)
        axes.grid(False, axis="y")
        for line in range(1, len(entries)):
            axes.axhline(line - 0.5, color=GRID, lw=0.6)
    figure.supxlabel("bandwidth / Hz", fontsize=8)
    figure.legend(handles=_signs(places), loc="outside upper left", ncols=3, frameon=False, fontsize=7)
    return figure, (
        "Bandwidths that each estimator finds, a point for each record, by excitation from top to bottom. Ticks: the "
        "best linear truth of that excitation, which friction and limits lower; black line: truth of small signals; "
        "shaded: near 1 Hz. Records whose model claims no bandwidth have no point; × at the left where none has."
    )


def _about(entries: Sequence[Entry]) -> tuple[float, float]:
    for entry in entries:
        figure = entry.figure(NAME)
        ends = None if figure is None else numbers(figure.curves.get("about_1_hz"))
        if ends is not None and len(ends) == 2 and 0.0 < ends[0] < ends[1]:
            return float(ends[0]), float(ends[1])
    return ABOUT


def _classes(entry: Entry) -> dict[str, list[Class]]:
    """By joint; what is of another form is left out."""
    figure = entry.figure(NAME)
    rows = None if figure is None else figure.curves.get("classes")
    found: dict[str, list[Class]] = {}
    for row in rows if isinstance(rows, list | tuple) else ():
        if not isinstance(row, Mapping) or not isinstance(row.get("joint"), str):
            continue
        values = numbers(row.get("hz"))
        values = np.empty(0) if values is None else values[np.isfinite(values) & (values > 0.0)]
        kind, mrad = one_line(str(row.get("excitation"))), number_of(row, "mrad")
        models = row.get("models")
        one = Class(
            f"{kind} {mrad:g} mrad",
            (kind, mrad),
            values,
            models if isinstance(models, int) else len(values),
            number_of(row, "small_signal"),
            number_of(row, "best_linear"),
        )
        found.setdefault(row["joint"], []).append(one)
    return found


def _draw(axes: Axes, one: Class, at: float, colour: str) -> None:
    if np.isfinite(one.best_linear):
        axes.plot(one.best_linear, at, "|", color=PALETTE["truth"].colour, ms=6, mew=1.0, zorder=2)
    if len(one.values):
        axes.plot(one.values, np.full(len(one.values), at), "o", color=colour, ms=2.4, alpha=0.6, mew=0, zorder=3)
    elif one.models:
        axes.plot(0.02, at, "x", color=colour, ms=3.5, transform=axes.get_yaxis_transform(), zorder=3)


def _signs(places: Mapping[str, int]) -> list[Line2D | Patch]:
    dots: list[Line2D | Patch] = [
        Line2D([], [], color=PALETTE[LOOKS[place % len(LOOKS)]].colour, ls="", marker="o", ms=4, label=literal(text))
        for text, place in places.items()
    ]
    truth = PALETTE["truth"].colour
    return [
        *dots,
        Line2D([], [], color=truth, ls="", marker="|", ms=7, label="best linear truth"),
        Line2D([], [], color=truth, lw=0.9, label="truth of small signals"),
        Patch(color=ONE_HZ, label="near 1 Hz"),
    ]
