"""Errors on the arm over amplitude: systematic error, noise and distortion apart."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from scenarios.bench.leaderboard_curves import curves, numbers
from scenarios.bench.leaderboard_entry import Entry
from scenarios.bench.leaderboard_style import label, literal
from scenarios.files.printable import one_line
from scenarios.report.figure_style import WIDTH, dress
from sysid.plots.palette import BOUND, DISTORTION, NOISE, PALETTE, Style
from sysid.records.arrays import FloatArray

NAME = "amplitude_split"
KINDS: Mapping[str, tuple[str, Style]] = {
    "systematic": ("systematic error", PALETTE["armax"]),
    "noise": ("noise", NOISE),
    "distortion": ("nonlinear distortion", DISTORTION),
}
MOST = 4
"""Joints that are drawn, side by side: the first ones."""


def splits(entries: Sequence[Entry]) -> tuple[Figure, str] | None:
    """A panel for each estimator and joint.

    Returns:
        The figure and its caption; None where no row has curves.
    """
    found = {entry.number: _rows(entry) for entry in entries}
    joints = list(dict.fromkeys(joint for rows in found.values() for joint in rows))[:MOST]
    if not joints:
        return None
    figure = Figure(figsize=(WIDTH, 1.0 + 0.95 * len(entries)), layout="constrained")
    panels = figure.subplots(len(entries), len(joints), squeeze=False, sharex="col", sharey=True)
    for row, entry in zip(panels, entries, strict=True):
        for axes, joint in zip(row, joints, strict=True):
            rows = found[entry.number].get(joint)
            if rows is None:
                axes.text(0.5, 0.5, "none", transform=axes.transAxes, ha="center", fontsize=7, color=BOUND.colour)
            else:
                _draw(axes, rows)
        row[0].set_ylabel(label(entry, 14), fontsize=7, rotation=0, ha="right", va="center")
    for column, joint in enumerate(joints):
        panels[0, column].set_title(literal(one_line(joint).replace("_", " ")), fontsize=8)
        ticks = sorted({float(a) for rows in found.values() if joint in rows for a in rows[joint]["mrad"]})
        panels[0, column].set_xscale("log")
        panels[0, column].set_xticks(ticks)
        panels[0, column].xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panels[0, column].xaxis.set_minor_locator(NullLocator())
        panels[0, column].set_xlim(ticks[0] / 1.5, ticks[-1] * 1.5)
    low, high = _ends([rows[joint] for rows in found.values() for joint in joints if joint in rows])
    panels[0, 0].set_yscale("log")
    panels[0, 0].set_ylim(low, high)
    panels[0, 0].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    dress(panels.flat)
    for axes in panels.flat:
        axes.tick_params(labelsize=6.5, pad=1.5)
    figure.supxlabel("amplitude of the command / mrad", fontsize=8)
    figure.supylabel("% of the linear part", fontsize=8)
    marks = [
        Line2D([], [], color=style.colour, marker=style.marker, ms=4, lw=1.2, label=text)
        for text, style in KINDS.values()
    ]
    marks.append(Line2D([], [], color=BOUND.colour, ls="", marker="_", ms=8, label="limit of the systematic error"))
    figure.legend(handles=marks, loc="outside upper left", ncols=2, frameon=False, fontsize=7)
    return figure, (
        "Errors of the response on the arm over the amplitude of the command, in percent of the linear part: what "
        "stays in the mean over waveforms, what differs between repeats, what differs between waveforms. Bars: 95 % "
        "intervals, cut off at the lower edge, where also stands what is 0; dotted: noise and distortion of the "
        "records themselves, without a model. The limit is wide where an estimator scatters."
    )


def _rows(entry: Entry) -> dict[str, dict[str, FloatArray]]:
    """Numbers over amplitude by joint."""
    figure = entry.figure(NAME)
    found = {}
    for joint, table in ({} if figure is None else figure.curves).items():
        needed = curves(table, "mrad", *KINDS)
        if needed is None or not (needed[0] > 0.0).all():
            continue
        rows = dict(zip(("mrad", *KINDS), needed, strict=True))
        for key in ("systematic_limit", "expected_noise", "expected_distortion"):
            values = numbers(table.get(key))
            if values is not None and len(values) == len(rows["mrad"]):
                rows[key] = values
        for key in KINDS:
            ends = numbers(table.get(f"{key}_interval"), 2)
            if ends is not None and ends.shape == (len(rows["mrad"]), 2):
                rows[f"{key}_interval"] = ends
        found[str(joint)] = rows
    return found


def _draw(axes: Axes, rows: Mapping[str, FloatArray]) -> None:
    for place, (key, (_, style)) in enumerate(KINDS.items()):
        at = rows["mrad"] * 1.06 ** (place - 1)  # beside each other, so that bars are told apart
        axes.plot(at, _positive(rows[key]), color=style.colour, marker=style.marker, ms=3.5, lw=1.0)
        none = at[rows[key] == 0.0]
        (edge,) = axes.plot(
            none,
            np.zeros(len(none)),
            transform=axes.get_xaxis_transform(),
            color=style.colour,
            marker=style.marker,
            mfc="white",
            ms=3.5,
            ls="",
            clip_on=False,
            zorder=4,
        )
        edge.set_in_layout(False)
        if f"{key}_interval" in rows:
            low, high = rows[f"{key}_interval"].T
            known = np.isfinite(low) & np.isfinite(high) & (high > 0.0)
            floor = np.maximum(low, 1e-3 * high)
            axes.vlines(at[known], floor[known], high[known], color=style.colour, lw=1.0)
        if f"expected_{key}" in rows:
            axes.plot(at, _positive(rows[f"expected_{key}"]), color=style.colour, lw=0.9, ls=":")
    if "systematic_limit" in rows:
        axes.plot(rows["mrad"], _positive(rows["systematic_limit"]), "_", color=BOUND.colour, ms=8)


def _ends(tables: Sequence[Mapping[str, FloatArray]]) -> tuple[float, float]:
    """Between which all marks lie; bars may be cut off."""
    values = np.concatenate([v for rows in tables for key, v in rows.items() if key != "mrad" and v.ndim == 1])
    values = values[np.isfinite(values) & (values > 0.0)]
    return (values.min() / 2.0, values.max() * 2.0) if len(values) else (0.1, 100.0)


def _positive(values: FloatArray) -> FloatArray:
    return np.where(values > 0.0, values, np.nan)
