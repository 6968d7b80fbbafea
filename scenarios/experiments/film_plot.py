"""Command and measured angle under a film, drawn once and uncovered as it runs."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hmtb_twin import JointLog
from sysid.plots import GRID, INK, Style

COMMAND = Style("#56b4e9", "-", 1.2)
MEASURED = Style(INK, "-", 1.2)
"""Styles of the commanded and of the measured angle of a joint."""

CURSOR = (213, 94, 0)
"""Colour of the line at the time of the frame."""

MOST = 3
"""Largest number of joints: those that are commanded to move most."""

NARROWEST = 320
"""Smallest width of a film with a plot, pixels: letters would be illegible."""

LARGE = 0.1
"""Motion that is drawn in degrees, rad; smaller ones in mrad from where the joint stood at the beginning."""

DPI = 100.0
"""Resolution at a picture height of 480 pixels; it grows with the picture, so that letters keep their share of it."""


def plotted_joints(log: JointLog, interval: slice) -> list[str]:
    """Excited joints, or all where the tool is moved: the `MOST` with the largest commands in an interval of a log."""
    swing = dict(zip(log.joints, np.ptp(log.commanded[interval], axis=0), strict=True))
    excited = [joint for joint in log.joints if joint in log.axes] or list(log.joints)
    largest = sorted(excited, key=swing.__getitem__, reverse=True)[:MOST]
    return [joint for joint in log.joints if joint in largest]


class MotionPlot:
    """Command and measured angle over time, one panel for each of `plotted_joints`.

    Args:
        log: The log.
        span: First and last time of the film, s.
        size: Width and height of the picture above the plot, pixels.
    """

    def __init__(self, log: JointLog, span: tuple[float, float], size: tuple[int, int]) -> None:
        # A sample before and after the span, so that the curves reach both ends.
        interval = slice(max(round(span[0] / log.dt) - 1, 0), round(span[1] / log.dt) + 2)
        joints = plotted_joints(log, interval)
        scale = max(size[1] / 480.0, 0.8)
        panel_height = 100 if len(joints) == 1 else 72
        # Even, as the encoder of films takes it.
        height = 2 * round(scale * (48 + panel_height * len(joints)) / 2)
        # Half a pixel more, because the size in pixels is rounded down.
        inches = ((size[0] + 0.5) / (scale * DPI), (height + 0.5) / (scale * DPI))
        figure = Figure(figsize=inches, dpi=scale * DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        panels = figure.subplots(len(joints), 1, sharex=True, squeeze=False)[:, 0]
        columns = [log.joint_index(joint) for joint in joints]
        in_degrees = bool(np.ptp(log.commanded[interval][:, columns], axis=0).max() > LARGE)
        lines = []
        for axes, joint in zip(panels, joints, strict=True):
            lines += _draw_joint(axes, log, joint, interval, in_degrees=in_degrees)
        panels[-1].set_xlim(*span)
        panels[-1].set_xlabel("time / s", fontsize=8.5, color=INK, labelpad=1)
        figure.legend(
            handles=lines[:2][::-1], loc="upper right", ncols=2, frameon=False, fontsize=8.5, borderaxespad=0.1
        )
        # Drawn twice in all, with and without curves: drawing a figure for every frame is slow.
        self._full = _picture_of(canvas)
        for line in lines:
            line.set_visible(False)
        self._empty = _picture_of(canvas)
        self._boxes = [axes.get_window_extent() for axes in panels]
        self._span, self._line = span, max(1, round(1.5 * scale))

    def at(self, time: float) -> np.ndarray:
        """Picture (height, width, 3), 8-bit RGB, with the curves up to a time, s."""
        picture = self._empty.copy()
        for box in self._boxes:
            first, last = self._span
            column = round(box.x0 + (time - first) / (last - first) * box.width)
            picture[:, :column] = self._full[:, :column]
            bottom, top = round(len(picture) - box.y0), round(len(picture) - box.y1)
            picture[top:bottom, column : column + self._line] = CURSOR
        return picture


def _draw_joint(axes: Axes, log: JointLog, joint: str, interval: slice, *, in_degrees: bool) -> list[Line2D]:
    """Draw measured angle and command of a joint, in degrees or as a change in mrad; return both curves."""
    column = log.joint_index(joint)
    time = np.arange(len(log))[interval] * log.dt
    commanded, measured = log.commanded[interval, column], log.measured[interval, column]
    name = joint.replace("_", " ")
    if in_degrees:
        title = f"{name} / deg"
        commanded, measured = np.degrees(commanded), np.degrees(measured)
    else:
        title = f"{name}, change / mrad"
        start = log.measured[0, column]
        commanded, measured = 1e3 * (commanded - start), 1e3 * (measured - start)
    lines = _curve(axes, time, measured, MEASURED, "measured", "default")
    # The hold keeps a command until the next tick.
    lines += _curve(axes, time, commanded, COMMAND, "command", "steps-post")
    axes.set_title(title, loc="left", fontsize=8.5, color=INK, pad=5)
    axes.grid(visible=True, color=GRID, lw=0.6)
    axes.tick_params(labelsize=8, colors=INK)
    axes.locator_params(axis="y", nbins=4)
    axes.spines[["top", "right"]].set_visible(False)
    values = np.concatenate((commanded, measured))
    finite = values[np.isfinite(values)]
    low, high = (finite.min(), finite.max()) if len(finite) else (0.0, 0.0)  # angles may be lost
    middle, half = (high + low) / 2.0, 0.56 * (high - low)
    # The noise of a joint at rest does not fill the panel.
    axes.set_ylim(middle - max(half, 0.5), middle + max(half, 0.5))
    return lines


def _curve(axes: Axes, time: np.ndarray, values: np.ndarray, style: Style, label: str, drawstyle: str) -> list[Line2D]:
    return axes.plot(time, values, color=style.colour, ls=style.line, lw=style.width, drawstyle=drawstyle, label=label)


def _picture_of(canvas: FigureCanvasAgg) -> np.ndarray:
    """Draw a figure; return its picture (height, width, 3), 8-bit RGB."""
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def with_plot(pictures: Iterator[np.ndarray], log: JointLog, times: np.ndarray) -> Iterator[np.ndarray]:
    """Put the plot under the pictures of a film that shows a log at these times (N,), s."""
    plot = None
    for time, picture in zip(times, pictures, strict=True):
        height, width = picture.shape[:2]
        if width < NARROWEST or len(times) < 2:
            yield picture
            continue
        if plot is None:
            plot = MotionPlot(log, (float(times[0]), float(times[-1])), (width, height))
        yield np.vstack((picture, plot.at(float(time))))
