"""The figure of fairness: what a model leaves unexplained in simulation and one step ahead, arm by arm."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hmtb_twin import STUDIED_JOINTS
from scenarios.report.figure_style import HIGH, WIDTH, dress, short
from scenarios.thesis.fairness_table import ArmFairness, FairModel, Fairness
from sysid.plots import INK, PALETTE, Style

LIMITS = (0.3, 300.0)
"""Limits of the axis, percent; values beyond are marked at its edge with an arrow."""


def dumbbells(fairness: Fairness) -> Figure:
    """For every model 100 − fit in simulation and one step ahead, on tests not seen; a panel for each joint and arm."""
    arms = [arm for arm in fairness.arms if arm.joints]
    rows = {joint: arms[0].joints[joint] for joint in STUDIED_JOINTS if joint in arms[0].joints}
    figure = Figure(
        figsize=(WIDTH, 1.1 + 0.19 * sum(len(models) + 2 for models in rows.values())), layout="constrained"
    )
    panels = figure.subplots(
        len(rows),
        len(arms),
        sharex=True,
        sharey="row",
        squeeze=False,
        height_ratios=[len(models) + 1 for models in rows.values()],
    )
    for line, (joint, named) in zip(panels, rows.items(), strict=True):
        for axes, arm in zip(line, arms, strict=True):
            _dumbbells(axes, arm.joints.get(joint, ()), fairness.estimation_test)
            axes.set_xscale("log")
            axes.set_xlim(*LIMITS)
            axes.set_xticks([1, 10, 100], ["1", "10", "100"])
            axes.minorticks_off()
        line[0].set_yticks(range(len(named)), [_label(entry) for entry in named])
        line[0].set_ylim(len(named) - 0.4, -0.6)
        line[0].set_ylabel(short(joint), fontsize=8)
    for axes, arm in zip(panels[0], arms, strict=True):
        axes.set_title(_arm(arm), fontsize=8)
    dress(panels.ravel())
    for axes in panels.ravel():
        # the grid marks the ticks
        axes.tick_params(labelsize=7, left=False, bottom=False)
    figure.supxlabel("100 − fit, median over single-joint tests not seen / %", fontsize=9)
    marks = [
        Line2D([], [], color=INK, marker="o", ls="", ms=5, label="in simulation"),
        Line2D([], [], color=INK, marker="o", mfc="white", ls="", ms=5, label="one step ahead"),
        Line2D([], [], color=INK, marker=">", ls="", ms=5, label="beyond the axis"),
    ]
    figure.legend(handles=marks, loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure


def _dumbbells(axes: Axes, models: Sequence[FairModel], own: int) -> None:
    """One line for each model from the filled mark to the open one."""
    scores = [(place, model, model.validation(own)) for place, model in enumerate(models)]
    known = [(place, model, fit) for place, model, fit in scores if fit is not None]
    if not known:
        return
    y = np.array([place for place, *_ in known])
    colours = np.array([_style(model).colour for _, model, _ in known])
    rest = np.array([[100 - fit.simulation, 100 - fit.one_step] for *_, fit in known])
    x = np.clip(rest, 1.1 * LIMITS[0], LIMITS[1] / 1.15)
    axes.hlines(y, x.min(axis=1), x.max(axis=1), colors=colours.tolist(), lw=1.4)
    # A model without a noise model has both in one place: the open mark lies inside the filled one.
    for k, size in enumerate((26, 12)):
        for beyond, mark in ((False, "o"), (True, ">")):
            here = (rest[:, k] > LIMITS[1]) == beyond
            if here.any():
                edge = colours[here].tolist()
                inside = edge if k == 0 else "white"
                axes.scatter(
                    x[here, k], y[here], s=size, c=inside, marker=mark, edgecolors=edge, linewidths=1.0, zorder=3
                )


def _arm(arm: ArmFairness) -> str:
    return f"{arm.condition.variant},\n{'with' if arm.condition.friction else 'no'} friction"


def _label(model: FairModel) -> str:
    if model.method == "oe_high":
        return "OE, sufficient order"
    return model.label if model.printed else model.label.split(" ")[0] + (" ★" if model.chosen else "")


def _style(model: FairModel) -> Style:
    if model.printed:
        return PALETTE["published"]
    return HIGH if model.method == "oe_high" else PALETTE[model.method]
