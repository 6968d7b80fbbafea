"""Figure of a log: commands, angles, errors and efforts of joints over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmtb_twin.control.experiment import Status
from hmtb_twin.files.errors import TwinError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hmtb_twin.bus.joint_log import JointLog

COMMAND, MEASURED, OTHER, LIMIT = "#8a8a8a", "#0072b2", "#000000", "#d55e00"
"""Colours of the command, of the angle, of what has a panel of its own, and of limits: told apart by everyone."""

MOST_JOINTS = 3
"""Joints that are drawn where none is named and none is excited alone: those whose angles move most."""

LIMITED = Status.VELOCITY_LIMITED | Status.JOINT_LIMITED
"""Flags of the status at which a command stood at its velocity limit or at an end of a joint's range."""


def log_figure(log: "JointLog", joints: str | Sequence[str] | None = None) -> "Figure":
    """Draw joints of a log, a row for each: angles in deg, command less angle in mrad, and effort in N m.

    Args:
        log: The log.
        joints: The joint, or several; by default those that are excited, or where none is, those that move most.

    Raises:
        TwinError: An unknown joint, or one that is named twice.
    """
    from matplotlib.figure import Figure

    chosen = _chosen(log, joints)
    columns = [log.joint_index(joint) for joint in chosen]
    figure = Figure(figsize=(10.0, 0.9 + 1.9 * len(chosen)), layout="constrained")
    panels = figure.subplots(len(chosen), 3, sharex=True, squeeze=False)
    limited = (log.status & LIMITED) != 0
    for row, joint, column in zip(panels, chosen, columns, strict=True):
        _draw_joint(row, log, joint, column, limited)
    for axes, title in zip(panels[0], ("angle / deg", "command less angle / mrad", "effort / N m"), strict=True):
        axes.set_title(title, fontsize=9)
    for axes in panels[-1]:
        axes.set_xlabel("time / s", fontsize=8)
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    figure.suptitle(f"{log.name}, arm {log.provenance.get('variant', 'unknown')}, seed {log.seed}", fontsize=10)
    return figure


def _chosen(log: "JointLog", joints: str | Sequence[str] | None) -> tuple[str, ...]:
    """The joints to draw, in the sequence of the arm."""
    if joints is None:
        excited = [axis for axis in log.axes if axis in log.joints]
        # Axes of the tool are no joints: what they move shows in the angles.
        moved = np.argsort(-np.ptp(log.true_angles, axis=0), kind="stable")[:MOST_JOINTS]
        named = excited or [log.joints[column] for column in sorted(moved.tolist())]
    else:
        named = [joints] if isinstance(joints, str) else list(joints)
    columns = [log.joint_index(joint) for joint in named]
    if not columns or len(set(columns)) < len(columns):
        raise TwinError(f"joints = {tuple(named)} given, expected one or more of {', '.join(log.joints)}, each once")
    return tuple(named)


def _draw_joint(row: "Sequence[Axes]", log: "JointLog", joint: str, column: int, limited: np.ndarray) -> None:
    angles, errors, efforts = row
    command, measured = log.felt[:, column], log.measured[:, column]
    angles.plot(log.time, np.degrees(command), color=COMMAND, lw=0.9, drawstyle="steps-post", label="command")
    angles.plot(log.time, np.degrees(measured), color=MEASURED, lw=1.0, label="measured")
    errors.plot(log.time, 1e3 * (command - measured), color=OTHER, lw=0.8)
    efforts.plot(log.time, log.effort[:, column], color=OTHER, lw=0.8)
    if limited.any():
        # A mark at the foot of the panel: a line there would hide the curve.
        times = log.time[limited]
        foot = np.full(len(times), 0.02)
        label = "a command at a limit of rate or range"
        angles.plot(times, foot, "|", color=LIMIT, ms=6.0, transform=angles.get_xaxis_transform(), label=label)
    angles.set_ylabel(joint.replace("_", " "), fontsize=8)
    for axes in row:
        axes.grid(visible=True, color="#e3e3e3", lw=0.5)
        axes.tick_params(labelsize=8)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
