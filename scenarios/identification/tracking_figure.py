"""The figure of a tracking: bandwidth and delay over time with their intervals, true and detected changes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.identification.tracking import Stretch, Tracking
from sysid.plots.palette import BOUND, PALETTE
from sysid.plots.panels import finish, line, panels, shade

ALARM = "#d55e00"
"""Colour of an alarm."""

MILLISECONDS = 1e3


def tracking_figure(tracking: Tracking) -> Figure:
    """Draw bandwidth and delay with their 95 % intervals, alarms, and the truth of each payload."""
    figure, grid = panels(2, 1, (8.0, 5.6), sharex=True, ratios=(2.0, 1.0))
    upper, lower = grid[0, 0], grid[1, 0]
    _draw_quantity(upper, tracking, "bandwidth", 1.0)
    _draw_quantity(lower, tracking, "delay", MILLISECONDS)
    times = tracking.track.times
    upper.set(ylabel="bandwidth / Hz", title=tracking.name)
    lower.set(ylabel="delay / ms", xlim=(times[0], times[-1]))
    return finish(figure, grid, "time / s")


def _draw_quantity(axes: Axes, tracking: Tracking, name: str, scale: float) -> None:
    """Draw bandwidth or delay over time, with its limits fitted to what matters."""
    track, style = tracking.track, PALETTE["armax"]
    # A picture does not resolve more.
    drawn = slice(None, None, max(1, len(track.times) // 1000))
    values, ends = scale * getattr(track, name)[drawn], scale * getattr(track, f"{name}_ci95")[drawn]
    line(axes, track.times[drawn], values, style, "tracked, with 95 % interval")
    shade(axes, track.times[drawn], ends[:, 0], ends[:, 1], style)
    # What is very wide right after an alarm must not flatten all else.
    extent = [*np.nanpercentile(ends[:, 0], [5]), *np.nanpercentile(ends[:, 1], [95])]
    for k, stretch in enumerate(tracking.truth):
        extent += _draw_truth(axes, stretch, name, scale, with_label=k == 0)
        if name == "bandwidth":
            above = axes.get_xaxis_transform()
            axes.text(stretch.begin, 0.98, f" {stretch.payload}", transform=above, va="top", fontsize=9)
    for k, change in enumerate(track.changes):
        label = "alarm" if k == 0 else None
        axes.axvline(change.detected, color=ALARM, lw=1.4, label=label)
    margin = 0.15 * (max(extent) - min(extent))
    axes.set_ylim(min(extent) - margin, max(extent) + margin)


def _draw_truth(axes: Axes, stretch: Stretch, name: str, scale: float, *, with_label: bool) -> list[float]:
    """Draw both truths of a part of the record, and return the values that must be seen."""
    truth, bla = PALETTE["truth"], PALETTE["bla"]
    labels = ("small-signal truth", "best linear truth, 95 %") if with_label else ("_nolegend_", "_nolegend_")
    span = stretch.begin, stretch.end
    if name == "bandwidth":
        linear, best = scale * stretch.small_signal_hz, scale * stretch.best_linear_hz
        low, high = stretch.best_linear_ci95
    else:
        linear, best = scale * stretch.small_signal_delay, scale * stretch.best_linear_delay
        low, high = best, best  # its interval is not known
    axes.hlines(linear, *span, color=truth.colour, lw=1.6, label=labels[0])
    if np.isfinite(best):
        axes.fill_between(span, low, high, color=bla.colour, alpha=0.25, lw=1.2, label=labels[1])
    axes.axvline(stretch.begin, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    return [value for value in (linear, low, high) if np.isfinite(value)]
