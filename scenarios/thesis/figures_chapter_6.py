"""Figures of chapter VI: the three-joint models."""

import numpy as np
from matplotlib.figure import Figure

from hmtb_twin import JOINTS
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figure_style import FREQUENCIES, WIDTH, dress, short
from sysid.plots import (
    PALETTE,
)


def coupled(study: Comparison) -> Figure:
    """Gain of the true three-joint response, channel by channel, beside the block-diagonal models."""
    names = list(study.joints)
    chosen = [JOINTS.index(name) for name in names]
    true = np.abs(study.truth.model.frequency_response(FREQUENCIES)[:, chosen][:, :, chosen])
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    grid = figure.subplots(len(names), len(names), sharex=True, sharey=True)
    looks = {"SysID model": PALETTE["armax"], "OKID model": PALETTE["okid"]}
    for i, j in np.ndindex(grid.shape):
        axes = grid[i, j]
        axes.loglog(FREQUENCIES, np.maximum(true[:, i, j], 1e-9), color=PALETTE["truth"].colour, lw=2.0, label="truth")
        for entry in study.three_joint:
            if i == j and entry.name in looks:
                gain = np.abs(entry.model.frequency_response(FREQUENCIES)[:, i, j])
                style = looks[entry.name]
                axes.loglog(FREQUENCIES, gain, color=style.colour, ls=style.line, lw=1.3, label=entry.name)
        axes.set_ylim(1e-4, 3.0)
        if i == 0:
            axes.set_title(f"from {short(names[j])}", fontsize=8)
        if j == 0:
            axes.set_ylabel(f"to {short(names[i])}", fontsize=8)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    dress(grid.ravel())
    figure.supxlabel("frequency / Hz", fontsize=9)
    figure.supylabel("gain / (rad/rad)", fontsize=9)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure
