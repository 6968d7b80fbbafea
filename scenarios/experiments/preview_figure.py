"""Figures of waveforms and of previewed commands."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hmtb_twin import Status
from scenarios.experiments.preview import Preview
from scenarios.experiments.waveform import Waveform
from sysid.plots.palette import BOUND, PALETTE
from sysid.plots.panels import panels


def waveform_figure(waveform: Waveform) -> Figure:
    """Draw the 100 points over time and the power of each spectral line [Morris1996, fig. 11 to 16]."""
    figure, ((upper,), (lower,)) = panels(2, 1, (7.0, 4.6))
    # One point more: the last step is drawn to its end, where the file repeats.
    time = np.arange(len(waveform.points) + 1) / waveform.update_rate
    colour = PALETTE["armax"].colour
    upper.step(time, np.append(waveform.points, waveform.points[0]), where="post", color=colour, lw=1.2)
    upper.set(xlabel="time / s", ylabel="voltage / V", xlim=(0, waveform.period))
    frequency, density = waveform.psd()
    # Weaker ones are rounding.
    lines = density > 1e-12 * density.max()
    # Whole decades: between them labels would be close, or none.
    bottom, top = 10.0 ** np.floor(np.log10((0.3 * density[lines].min(), 15.0 * density.max())))
    lower.vlines(frequency[lines], bottom, density[lines], color=colour, lw=1.6)
    lower.plot(frequency[lines], density[lines], "o", ms=3, color=colour)
    lower.set(yscale="log", ylim=(bottom, top), xlabel="frequency / Hz", ylabel="density / (V²/Hz)")
    lower.set_xlim(-0.01 * waveform.update_rate, 0.51 * waveform.update_rate)
    title = f"{waveform.kind.replace('_', ' ')}: one period, order of excitation {waveform.order_of_excitation()}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's palette, one colour for each joint or axis."""

LINES = ("-", "--", "-.", ":", (0, (3, 1, 1, 1)), (0, (1, 1)), "-")
"""Line styles, which keep the lines distinct in a grey print."""

RED = "#e03131"
"""Colour of the ticks at which something is limited."""

_LIMITS = Status.VELOCITY_LIMITED | Status.JOINT_LIMITED | Status.SINGULAR | Status.CONVERTER_SATURATED

WINDOW = 8.0
"""Length drawn, s: four repetitions of a file."""


def preview_figure(preview: Preview) -> Figure:
    """Draw the first seconds of the commands of an experiment: volts, angles, rates and tool."""
    sample_time = preview.scenario.arm.sample_time
    count = min(len(preview.commands), round(WINDOW / sample_time))
    time = np.arange(count) * sample_time
    moving = preview.moving
    figure, grid = panels(4, 1, (8.0, 9.0), sharex=True)
    volts, angles, rates, tool = grid[:, 0]
    for index, axis in enumerate(preview.scenario.axes):
        _held_curve(volts, time, preview.volts[:count, index], index, axis)
    volts.set(ylabel="at the converter / V")
    shown = np.degrees(preview.commands[:count] - preview.commands[0])
    speeds = np.degrees(preview.rates[:count])
    limits = set[float]()
    for index, joint in enumerate(moving):
        column = preview.column(joint)
        _held_curve(angles, time, shown[:, column], index, joint.replace("_", " "))
        _held_curve(rates, time[: len(speeds)], speeds[:, column], index, joint.replace("_", " "))
        limits.add(float(np.degrees(preview.velocity_limits[column])))
    # Joints with the same limit share its line.
    for limit in sorted(limits):
        for sign in (-1.0, 1.0):
            rates.axhline(sign * limit, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    limited = (preview.status[:count] & _LIMITS) != 0
    for axes in (volts, angles, rates, tool):
        axes.vlines(time[limited], 0, 1, transform=axes.get_xaxis_transform(), color=RED, alpha=0.25, lw=1.0)
    angles.set(ylabel="command / deg")
    rates.set(ylabel="its rate / (deg/s)")
    for index, axis in enumerate("xyz"):
        _held_curve(tool, time, 1000.0 * preview.tool[:count, index], index, axis)
    tool.set(ylabel="tool, own frame / mm", xlabel="time / s", xlim=(0.0, max(time[-1], sample_time)))
    for axes in (volts, angles, tool):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    rates.annotate(
        "dashed: limit\nred: limited",
        (1.01, 0.5),
        xycoords="axes fraction",
        fontsize=8,
        color=BOUND.colour,
        va="center",
    )
    share = 100.0 * preview.velocity_limited
    figure.suptitle(
        f"{preview.scenario.name}, first {count * sample_time:g} s: {share:.3g} % at the velocity limit",
        x=0.01,
        ha="left",
        fontsize=11,
    )
    return figure


def _held_curve(axes: Axes, time: np.ndarray, values: np.ndarray, index: int, label: str) -> None:
    """Draw a curve that holds each value until the next, in the colour and style of its index."""
    axes.step(time, values, where="post", color=COLOURS[index], ls=LINES[index], lw=1.2, label=label)
