"""The figure of a tracking: bandwidth and delay over time with their intervals, true and detected changes."""

import numpy as np
from matplotlib.figure import Figure

from scenarios.identification.tracking import Tracking
from sysid.plots.palette import BOUND, PALETTE
from sysid.plots.panels import finish, line, panels, shade

ALARM = "#d55e00"
"""Colour of an alarm."""


def tracking_figure(tracking: Tracking) -> Figure:
    """Draw bandwidth and delay with their 95 % intervals, alarms, and the truth of each payload."""
    track, style, truth, bla = tracking.track, PALETTE["armax"], PALETTE["truth"], PALETTE["bla"]
    # A picture does not resolve more.
    drawn = slice(None, None, max(1, len(track.times) // 1000))
    figure, grid = panels(2, 1, (8.0, 5.6), sharex=True, ratios=(2.0, 1.0))
    for axes, name, scale, one in ((grid[0, 0], "bandwidth", 1.0, "hz"), (grid[1, 0], "delay", 1e3, "delay")):
        values, ends = scale * getattr(track, name)[drawn], scale * getattr(track, f"{name}_ci95")[drawn]
        line(axes, track.times[drawn], values, style, "tracked, with 95 % interval")
        shade(axes, track.times[drawn], ends[:, 0], ends[:, 1], style)
        # What is very wide right after an alarm must not flatten all else.
        shown = [*np.nanpercentile(ends[:, 0], [5]), *np.nanpercentile(ends[:, 1], [95])]
        for number, stretch in enumerate(tracking.truth):
            labels = ("small-signal truth", "best linear truth, 95 %") if number == 0 else (None, None)
            span = stretch.begin, stretch.end
            linear, best = (scale * getattr(stretch, f"{kind}_{one}") for kind in ("small_signal", "best_linear"))
            axes.hlines(linear, *span, color=truth.colour, lw=1.6, label=labels[0])
            low, high = stretch.best_linear_ci95 if name == "bandwidth" else (best, best)
            if np.isfinite(best):
                axes.fill_between(span, low, high, color=bla.colour, alpha=0.25, lw=1.2, label=labels[1])
            shown += [value for value in (linear, low, high) if np.isfinite(value)]
            axes.axvline(stretch.begin, color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
            if name == "bandwidth":
                place = axes.get_xaxis_transform()
                axes.text(stretch.begin, 0.98, f" {stretch.payload}", transform=place, va="top", fontsize=9)
        for number, change in enumerate(track.changes):
            axes.axvline(change.detected, color=ALARM, lw=1.4, label=None if number else "alarm")
        margin = 0.15 * (max(shown) - min(shown))
        axes.set_ylim(min(shown) - margin, max(shown) + margin)
    grid[0, 0].set(ylabel="bandwidth / Hz", title=tracking.name)
    grid[1, 0].set(ylabel="delay / ms", xlim=(track.times[0], track.times[-1]))
    return finish(figure, grid, "time / s")
