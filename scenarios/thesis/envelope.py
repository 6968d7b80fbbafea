"""Envelope of a long record for a figure: minimum and maximum of each column."""

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from scenarios.files.errors import ScenarioError
from sysid.plots import Style

COLUMNS = 600
"""Columns of a long record: about the resolution of the eye at the width of a page."""


def envelope(
    axes: Axes,
    values: np.ndarray,
    dt: float,
    style: Style,
    *,
    scale: float = 1.0,
    start: float = 0.0,
    label: str | None = None,
    held: bool = False,
    count: int = COLUMNS,
) -> None:
    """Plot a record over time: a long one as the band between minimum and maximum of each column, a short one as it is.

    Missing samples (NaN) leave a gap where a column has no other.

    Args:
        axes: Where to draw.
        values: One channel `(N,)`.
        dt: Sampling interval, s.
        style: How it looks; a band has its colour alone.
        scale: Factor from the unit of the values to that of the axis, e.g. 1000 from rad to mrad.
        start: Time of the first sample, s.
        label: Text of the legend.
        held: Whether a short record is drawn as steps, as a held command is.
        count: Columns; fewer make a figure of many panels lighter.

    Raises:
        ScenarioError: More than one channel, or none.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 1 or len(values) == 0:
        raise ScenarioError(f"expected the samples (N,) of one channel, given an array of shape {values.shape}")
    if len(values) <= 2 * count:
        time = start + dt * np.arange(len(values))
        drawing = "steps-post" if held else "default"
        axes.plot(
            time, scale * values, color=style.colour, ls=style.line, lw=style.width, drawstyle=drawing, label=label
        )
        return
    time, low, high = columns(values, dt, count)
    # The edge shows where a column is flat.
    axes.fill_between(start + time, scale * low, scale * high, color=style.colour, lw=0.4, label=label)


def columns(values: np.ndarray, dt: float, count: int = COLUMNS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Minimum and maximum of every column.

    A column takes the first sample of the next with it, so that neighbours meet as the line through the samples does.

    Args:
        values: One channel `(N,)`, N above the count.
        dt: Sampling interval, s.
        count: Columns.

    Returns:
        Times of their middles from the first sample, the outer ones at the ends of the record, s, least values and
        greatest values, `(count,)` each.
    """
    edges = np.linspace(0, len(values) - 1, count + 1).round().astype(int)
    parts = [values[a : b + 1] for a, b in pairwise(edges)]
    time = 0.5 * dt * (edges[:-1] + edges[1:])
    time[[0, -1]] = 0.0, dt * edges[-1]
    # fmin and fmax take the value that is known
    return time, np.array([np.fmin.reduce(part) for part in parts]), np.array([np.fmax.reduce(part) for part in parts])
