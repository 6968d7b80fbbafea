"""Figure of a log: commands, angles, errors and efforts of joints over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COMMAND, MEASURED, OTHER, LIMIT = "#8a8a8a", "#0072b2", "#000000", "#d55e00"
"""Colours of the command, of the angle, of what has a panel of its own, and of limits: told apart by everyone."""


@dataclass(frozen=True, eq=False)
class JointCurves:
    """One joint over time.

    Attributes:
        joint: Its name.
        command: Commanded angle that the arm felt (N,), rad.
        measured: Measured angle (N,), rad.
        effort: Torque of its drive (N,), N m.
    """

    joint: str
    command: np.ndarray
    measured: np.ndarray
    effort: np.ndarray


def log_figure(title: str, time: np.ndarray, curves: Sequence[JointCurves], limited: np.ndarray) -> "Figure":
    """Draw a row for each joint: angles in deg, command less angle in mrad, and effort in N m.

    Args:
        title: Title of the figure.
        time: Times (N,), s.
        curves: The joints.
        limited: Where a command stood at a limit of rate or range (N,).
    """
    # Here, because matplotlib takes a second to load.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 0.9 + 1.9 * len(curves)), layout="constrained")
    panels = figure.subplots(len(curves), 3, sharex=True, squeeze=False)
    for row, joint in zip(panels, curves, strict=True):
        _draw_joint(row, time, joint, limited)
    for axes, heading in zip(panels[0], ("angle / deg", "command less angle / mrad", "effort / N m"), strict=True):
        axes.set_title(heading, fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("time / s", fontsize=8)
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    figure.suptitle(title, fontsize=10)
    return figure


def _draw_joint(row: "Sequence[Axes]", time: np.ndarray, joint: JointCurves, limited: np.ndarray) -> None:
    angles, errors, efforts = row
    command, measured = np.degrees(joint.command), np.degrees(joint.measured)
    angles.plot(time, command, color=COMMAND, lw=0.9, drawstyle="steps-post", label="command")
    angles.plot(time, measured, color=MEASURED, lw=1.0, label="measured")
    errors.plot(time, 1e3 * (joint.command - joint.measured), color=OTHER, lw=0.8)
    efforts.plot(time, joint.effort, color=OTHER, lw=0.8)
    if limited.any():
        # Marks at the foot of the panel: lines there would hide the curve.
        times = time[limited]
        foot = np.full(len(times), 0.02)
        label = "a command at a limit of rate or range"
        angles.plot(times, foot, "|", color=LIMIT, ms=6.0, transform=angles.get_xaxis_transform(), label=label)
    angles.set_ylabel(joint.joint.replace("_", " "), fontsize=8)
    for axes in row:
        axes.grid(visible=True, color="#e3e3e3", lw=0.5)
        axes.tick_params(labelsize=8)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
