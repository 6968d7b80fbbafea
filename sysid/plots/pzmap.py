"""Poles and zeros."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from sysid.plots.palette import BOUND, GRID
from sysid.plots.panels import finish, panels
from sysid.plots.traces import REACH, Rooted, roots_of
from sysid.records.printing import counted


def pzmap(
    systems: Rooted | Sequence[Rooted] | Mapping[str, Rooted],
    *,
    regions: bool = True,
    size: tuple[float, float] = (4.6, 4.9),
) -> Figure:
    """Poles (crosses) and zeros (rings) in the z plane; roots far outside the unit circle are counted in the legend.

    Of estimates the path from input to output is drawn, without the noise model.

    Args:
        systems: Models or estimates: one, several, or several by name.
        regions: Whether the 95 % regions of estimates are drawn; a line for a real root.
        size: Width and height, inch.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, or something without poles.
    """
    figure, grid = panels(1, 1, size)
    axes = grid[0, 0]
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(angle), np.sin(angle), color=BOUND.colour, lw=0.9)
    axes.axhline(0.0, color=GRID, lw=0.8, zorder=0)
    axes.axvline(0.0, color=GRID, lw=0.8, zorder=0)
    for position, system in enumerate(roots_of(systems, regions=regions)):
        poles, zeros = system.model.poles(), system.model.zeros()
        counts = {"pole": int((np.abs(poles) > REACH).sum()), "zero": int((np.abs(zeros) > REACH).sum())}
        beyond = ", ".join(counted(count, root) for root, count in counts.items() if count)
        label = f"{system.label} ({beyond} beyond the frame)" if beyond else system.label
        # Markers of later systems are smaller, so that coinciding roots stay visible.
        marker_size = max(9 - 1.2 * position, 4.0)
        axes.plot(poles.real, poles.imag, "x", color=system.style.colour, ms=marker_size, mew=1.7, label=label)
        axes.plot(zeros.real, zeros.imag, "o", color=system.style.colour, ms=marker_size, mew=1.3, mfc="none")
        for outline in system.regions:
            axes.plot(outline.real, outline.imag, color=system.style.colour, lw=0.8, zorder=1)
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), aspect="equal")
    axes.set_ylabel("imaginary part of z")
    return finish(figure, grid, "real part of z (× pole, ○ zero)")
