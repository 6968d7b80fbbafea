"""The oscilloscope's screen: voltages, joint commands, their rates and the way of the tool."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hmtb_twin import JOINTS
from hmtb_twin.parameters import SAMPLE_TIME
from scenarios.preview import Preview
from sysid.palette import BOUND, GRID, INK

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's palette, one for each joint or axis."""

LINES = ("-", "--", "-.", ":", (0, (3, 1, 1, 1)), (0, (1, 1)), "-")
"""So that a print in grey tells the lines apart."""

WINDOW = 8.0
"""What the screen shows, s: four repetitions of a file."""


def preview_figure(preview: Preview) -> Figure:
    """Draw the first seconds of what an experiment will command.

    Args:
        preview: The preview.

    Returns:
        The figure.
    """
    count = min(len(preview.commands), round(WINDOW / SAMPLE_TIME))
    time = np.arange(count) * SAMPLE_TIME
    moving = preview.moving
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    volts, angles, rates, tool = figure.subplots(4, 1, sharex=True)
    for number, axis in enumerate(preview.scenario.axes):
        _line(volts, time, preview.volts[:count, number], number, axis)
    volts.set(ylabel="at the converter / V")
    shown = np.degrees(preview.commands[:count] - preview.commands[0])
    speeds = np.degrees(preview.rates[:count])
    for number, joint in enumerate(moving):
        column = JOINTS.index(joint)
        _line(angles, time, shown[:, column], number, joint.replace("_", " "))
        _line(rates, time[: len(speeds)], speeds[:, column], number, joint.replace("_", " "))
    for limit in sorted({float(np.degrees(preview.velocity_limits[JOINTS.index(joint)])) for joint in moving}):
        for sign in (-1.0, 1.0):
            rates.axhline(sign * limit, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    angles.set(ylabel="command / deg")
    rates.set(ylabel="its rate / (deg/s)")
    for number, axis in enumerate("xyz"):
        _line(tool, time, 1000.0 * preview.tool[:count, number], number, axis)
    tool.set(ylabel="tool, own frame / mm", xlabel="time / s", xlim=(0.0, max(time[-1], SAMPLE_TIME)))
    for axes in (volts, angles, rates, tool):
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        if axes.get_legend_handles_labels()[0] and axes is not rates:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    rates.annotate("dashed: limit", (1.01, 0.5), xycoords="axes fraction", fontsize=8, color=BOUND.colour, va="center")
    limited = 100.0 * preview.velocity_limited
    figure.suptitle(
        f"{preview.scenario.name}: what will be commanded, first {count * SAMPLE_TIME:g} s; {limited:.3g} % at the "
        "velocity limit",
        x=0.01,
        ha="left",
        fontsize=11,
    )
    return figure


def _line(axes: Axes, time: np.ndarray, values: np.ndarray, number: int, label: str) -> None:
    axes.step(time, values, where="post", color=COLOURS[number], ls=LINES[number], lw=1.2, label=label)
