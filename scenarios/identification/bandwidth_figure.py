"""The figure of the 1 Hz finding: recovered bandwidths by joint, method and test, beside true and printed ones."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from scenarios.identification.bandwidth_study import BandwidthStudy
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, METHODS, RecoveredBandwidth
from scenarios.report.figure_style import NOT_EXCITED, dress, method_style, short
from scenarios.truth.published import published
from sysid.plots import BOUND, PALETTE

WIDTH = 7.0
"""Width, inch."""

ROW = 0.27
"""Height of a row, inch."""

BEST_LINEAR = "#6baed6"
"""Band of the best linear approximation."""


def bandwidth_figure(study: BandwidthStudy) -> Figure:
    """Draw the bandwidths: a panel for a joint, a row for a method and test.

    Seeds are light dots, the middle one of them a mark with its 95 % interval; a cross on the left edge stands for rows
    of which nothing can be claimed. On the right: how many intervals hold the small-signal truth, of how many.
    """
    methods = list(dict.fromkeys(row.method for row in study.rows))
    groups = []
    for joint in study.joints:
        # All tests of a method below each other.
        in_order = sorted(study.groups(joint), key=lambda rows: methods.index(rows[0].method))
        groups.append((joint, in_order))
    heights = [len(rows) + len(published(joint)) + 1.4 for joint, rows in groups]
    figure = Figure(figsize=(WIDTH, ROW * sum(heights) + 1.5), layout="constrained")
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axes, (joint, rows) in zip(panels, groups, strict=True):
        _panel(axes, study, joint, rows)
    ticks = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0]
    # Ratios count: intervals of bandwidths are symmetric on this scale.
    panels[0].set_xscale("log")
    panels[0].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panels[0].minorticks_off()
    panels[-1].set_xlabel("bandwidth / Hz")
    figure.suptitle(f"Bandwidths on the arm {study.condition}", fontsize=10, x=0.01, ha="left")
    figure.legend(handles=_legend(study), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def _panel(axes: Axes, study: BandwidthStudy, joint: str, rows: Sequence[Sequence[RecoveredBandwidth]]) -> None:
    labels: list[str] = []
    has_several_tests = len({row.test for row in study.rows}) > 1
    for group in rows:
        y, first = len(labels), group[0]
        _draw(axes, group, y)
        covering = f"{sum(row.covers for row in group)} of {len(group)}"
        beside_axes: tuple[str, str] = ("axes fraction", "data")
        axes.annotate(covering, (1.01, y), xycoords=beside_axes, va="center", fontsize=8, annotation_clip=False)
        label = METHODS[first.method]
        labels.append(f"{label}, test {first.test}" if has_several_tests else label)
        bla = first.best_linear
        if bla is not None and np.isfinite(bla).all():
            axes.fill_betweenx([y - 0.5, y + 0.5], bla[1], bla[2], color=BEST_LINEAR, lw=0.6, zorder=1)
    for printed in published(joint):
        style = PALETTE["published"]
        axes.plot(printed.bandwidth_hz, len(labels), style.marker, color=style.colour, ms=8, ls="none", zorder=6)
        labels.append(f"published {printed.label}")
    truth = study.truth.joint(joint).bandwidth_hz
    axes.axvspan(*ABOUT_1_HZ, color=NOT_EXCITED, lw=0, zorder=0)
    axes.axvline(truth, color=PALETTE["truth"].colour, lw=1.6, zorder=2)
    axes.axvline(1.0, color=BOUND.colour, ls=":", lw=1.2, zorder=2)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_title(f"{short(joint)}: truth {truth:.3f} Hz", loc="left", fontsize=9)
    axes.annotate("interval\nholds truth", (1.01, 1.0), xycoords="axes fraction", va="bottom", fontsize=7)
    dress([axes])


def _draw(axes: Axes, group: Sequence[RecoveredBandwidth], y: int) -> None:
    """Draw the bandwidths of one method and test in a row: all seeds, and the middle one with its interval."""
    style = method_style(group[0].method)
    claimed = sorted((row for row in group if not row.refused), key=lambda row: row.hz)
    if len(claimed) < len(group):
        edge: dict[str, Any] = {"transform": axes.get_yaxis_transform(), "clip_on": False}
        axes.plot(0.012, y, "x", color=style.colour, ms=6, mew=1.6, zorder=4, **edge)
    levels = [row.half_power_hz for row in group if np.isfinite(row.half_power_hz)]
    if levels:
        axes.plot(np.median(levels), y, "|", color=style.colour, ms=11, mew=1.8, zorder=5)
    if not claimed:
        return
    middle = claimed[(len(claimed) - 1) // 2]
    if len(claimed) > 1:
        # Shuffled, so that dots of equal bandwidths do not form a line.
        spread = np.linspace(-0.28, 0.28, len(claimed))[np.random.default_rng(0).permutation(len(claimed))]
        axes.plot([row.hz for row in claimed], y + spread, "o", color=style.colour, ms=3, alpha=0.35, mew=0, zorder=3)
    if np.isfinite(middle.ci95).all():
        axes.plot(middle.ci95, [y, y], "-", color=style.colour, lw=1.6, zorder=5)
    axes.plot(middle.hz, y, style.marker, color=style.colour, ms=5.5, ls="none", zorder=6)


def _legend(study: BandwidthStudy) -> list[Line2D | Patch]:
    star, grey = PALETTE["published"], "#555555"
    several = any(len(rows) > 1 for joint in study.joints for rows in study.groups(joint))

    def mark(shape: str, label: str, **style: float) -> Line2D:
        return Line2D([], [], color=grey, marker=shape, ls="none", label=label, **style)  # type: ignore[arg-type]

    handles: list[Line2D | Patch] = [
        Line2D([], [], color=PALETTE["truth"].colour, lw=1.6, label="small-signal truth"),
        Line2D([], [], color=BOUND.colour, ls=":", lw=1.2, label="1 Hz"),
        Patch(color=NOT_EXCITED, label=f"about 1 Hz: {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz"),
    ]
    if study.best_linear:
        handles.append(Patch(color=BEST_LINEAR, label="best linear truth, 95 %"))
    middle = "middle seed with 95 % interval" if several else "recovered with 95 % interval"
    handles.append(Line2D([], [], color=grey, marker="o", ms=5.5, lw=1.6, label=middle))
    if several:
        handles.append(mark("o", "each seed", ms=3, alpha=0.35))
    handles.append(mark("|", "gain 0.707, middle" if several else "gain 0.707", ms=11, mew=1.8))
    if any(published(joint) for joint in study.joints):
        handles.append(
            Line2D([], [], color=star.colour, marker=star.marker, ms=8, ls="none", label="printed in the thesis")
        )
    if any(row.refused for row in study.rows):
        handles.append(mark("x", "not claimed: record bears none", ms=6))
    return handles
