"""The figure that answers: bandwidths recovered, true and published."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ
from scenarios.report.figure_style import NOT_EXCITED, WIDTH, dress, method_style, short
from scenarios.thesis.comparison import Comparison
from sysid.models.bandwidth import half_power_hz
from sysid.plots import (
    BOUND,
    PALETTE,
)

ANY = "#555555"
"""Colour of marks in the legend that stand for every colour."""


def bandwidths(study: Comparison) -> Figure:
    """Recovered bandwidths with their intervals, the truth as a line, the published models as stars."""
    figure = Figure(figsize=(WIDTH, 6.8), layout="constrained")
    rows = [len(entry.models) + len(entry.published) for entry in study.joints.values()]
    panels = figure.subplots(len(rows), 1, sharex=True, height_ratios=rows)
    for axes, (name, entry) in zip(panels, study.joints.items(), strict=True):
        labels: list[str] = []
        for model in entry.models.values():
            style, hz = method_style(model.method), model.bandwidth_hz
            reach = [[hz - model.ci95[0]], [model.ci95[1] - hz]]
            axes.errorbar(hz, len(labels), xerr=reach, fmt=style.marker, color=style.colour, ms=6, capsize=4, lw=1.8)
            axes.plot(model.half_power_hz, len(labels), "|", color=style.colour, ms=13, mew=2.0)
            labels.append(model.label.replace(", sufficient without friction", " †"))
        for printed in entry.published:
            axes.plot(
                printed.bandwidth_hz, len(labels), PALETTE["published"].marker, color=PALETTE["published"].colour, ms=9
            )
            level = half_power_hz(printed.model)
            axes.plot(level, len(labels), "|", color=PALETTE["published"].colour, ms=13, mew=2.0)
            labels.append(f"published {printed.label}")
        axes.axvspan(*ABOUT_1_HZ, color=NOT_EXCITED, lw=0, zorder=0)
        axes.axvline(entry.truth.bandwidth_hz, color=PALETTE["truth"].colour, lw=1.8)
        axes.axvline(1.0, color=BOUND.colour, ls=":", lw=1.2)
        axes.set_yticks(range(len(labels)), labels, fontsize=8)
        axes.set_ylim(len(labels) - 0.4, -0.6)
        axes.set_title(f"{short(name)}: truth {entry.truth.bandwidth_hz:.3f} Hz", loc="left", fontsize=9)
        dress([axes])
    panels[-1].set_xlim(0.0, 1.55)
    panels[-1].set_xlabel("frequency / Hz")
    figure.legend(handles=_legend(), loc="outside upper left", ncols=2, fontsize=8, frameon=False)
    return figure


def _legend() -> list[Line2D | Patch]:
    star = PALETTE["published"]
    return [
        Line2D([], [], color=PALETTE["truth"].colour, lw=1.8, label="small-signal truth"),
        Line2D([], [], color=ANY, marker="o", ms=6, lw=1.8, label="bandwidth with 95 % interval"),
        Line2D([], [], color=star.colour, marker=star.marker, ms=9, ls="none", label="published model"),
        Line2D([], [], color=ANY, marker="|", ms=13, mew=2.0, ls="none", label="where the gain is 0.707"),
        Patch(color=NOT_EXCITED, label=f"about 1 Hz: {ABOUT_1_HZ[0]:g} to {ABOUT_1_HZ[1]:g} Hz"),
        Line2D([], [], color=BOUND.colour, ls=":", lw=1.2, label="1 Hz"),
    ]
