"""Figures of chapter VI: the three-joint models on the exchange and on the fast chirp."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import sysid
from hmtb_twin import STUDIED_JOINTS
from scenarios.experiments.campaign import RPCM
from scenarios.experiments.log_review import SETTLING
from scenarios.report.figure_style import MRAD, WIDTH, dress, short
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.envelope import envelope
from scenarios.thesis.figures_chapter_6 import LOOKS
from scenarios.thesis.multivariable import WAYS, ThreeJointModel, Way
from sysid import IOData, ModelFit
from sysid.plots import GRID, INK, PALETTE, Style

DEGREES = float(np.degrees(1.0))

FEW = 250
"""Columns of a whole record in a figure of many panels."""

_COMMAND = Style("#56b4e9", "-", 1.2)
_BAND = "#f3f4f6"
_TITLES = {"simulation": "in simulation", "one_step": "one step ahead"}


def record(study: Comparison, name: str, *, start: float = 0.0, length: float | None = None, degrees: bool) -> Figure:
    """Commanded and measured angles of the three joints, without their means.

    Args:
        study: The study.
        name: Of the record.
        start: Where to begin behind the settled start, s.
        length: How much to show, s; all of it when None.
        degrees: Whether angles are in degrees, else in mrad.

    Returns:
        The figure.
    """
    data = _part(study.campaign.several(name), start, length)
    scale, unit = (DEGREES, "°") if degrees else (MRAD, "mrad")
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for i, (axes, joint) in enumerate(zip(panels, STUDIED_JOINTS, strict=True)):
        at = SETTLING + start
        envelope(axes, data.u[:, i], data.dt, _COMMAND, scale=scale, start=at, label="commanded", held=True, count=FEW)
        envelope(axes, data.y[:, i], data.dt, Style(INK, "-", 1.0), scale=scale, start=at, label="measured", count=FEW)
        axes.set_ylabel(f"{short(joint)} / {unit}", fontsize=8)
    panels[-1].set_xlabel("time / s", fontsize=8)
    if name == RPCM:
        _phases(study, panels)
    dress(panels)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def whole_outputs(study: Comparison, name: str) -> Figure:
    """Simulated outputs of the SysID and the OKID model over a whole record, and below each what they miss."""
    data, fits = _fits(study, name)
    figure = Figure(figsize=(WIDTH, 8.0), layout="constrained")
    panels = figure.subplots(6, 1, sharex=True, height_ratios=(1.3, 1.0) * 3)
    for i, joint in enumerate(STUDIED_JOINTS):
        upper, lower = panels[2 * i : 2 * i + 2]
        _band(upper, data.y[:, i], data.dt, PALETTE["measured"], DEGREES, "measured")
        for entry, fit in fits:
            style = _thin(LOOKS[entry.name])
            _band(upper, fit.simulated[:, i], data.dt, style, DEGREES, entry.name)
            _band(lower, data.y[:, i] - fit.simulated[:, i], data.dt, style, MRAD)
        upper.set_ylabel("angle / °", fontsize=8)
        lower.set_ylabel("missed / mrad", fontsize=8)
        upper.set_title(f"{short(joint)}: {_fit_text(fits, i, 'simulation')}", loc="left", fontsize=8)
    panels[-1].set_xlabel("time / s", fontsize=8)
    dress(panels)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure


def part_outputs(study: Comparison, name: str, *, start: float, length: float) -> Figure:
    """Outputs of both models over a part of a record, simulated (left) and predicted one step ahead (right)."""
    data, fits = _fits(study, name)
    part = _samples(data, start, length)
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    grid = figure.subplots(3, 2, sharex=True, sharey="row")
    time = SETTLING + data.dt * np.arange(part.start, part.stop)
    for i, joint in enumerate(STUDIED_JOINTS):
        for axes, way in zip(grid[i], WAYS, strict=True):
            axes.plot(time, MRAD * data.y[part, i], color=PALETTE["measured"].colour, lw=2.2, label="measured")
            for entry, fit in fits:
                values = fit.simulated if way == "simulation" else fit.predicted
                style = LOOKS[entry.name]
                axes.plot(time, MRAD * values[part, i], color=style.colour, ls=style.line, lw=1.0, label=entry.name)
            axes.set_title(_fit_text(fits, i, way), loc="left", fontsize=7.5)
        grid[i, 0].set_ylabel(f"{short(joint)} / mrad", fontsize=8)
    for axes, way in zip(grid[-1], WAYS, strict=True):
        axes.set_xlabel(f"time / s, {_TITLES[way]}", fontsize=8)
    dress(grid.ravel())
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return figure


def residuals(study: Comparison, name: str, *, start: float = 0.0, length: float | None = None) -> Figure:
    """One-step residuals of the SysID (left) and the OKID model (right) on the same axes."""
    data, fits = _fits(study, name)
    part = _samples(data, start, length)
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    grid = figure.subplots(3, 2, sharex=True, sharey="row")
    for column, (entry, fit) in enumerate(fits):
        for i, joint in enumerate(STUDIED_JOINTS):
            axes = grid[i, column]
            error = data.y[part, i] - fit.predicted[part, i]
            envelope(axes, error, data.dt, _thin(LOOKS[entry.name]), scale=MRAD, start=SETTLING + start, count=FEW)
            rms = MRAD * float(np.sqrt(np.mean((data.y[:, i] - fit.predicted[:, i]) ** 2)))
            mute = "" if entry.predicts(joint) else ", K = 0"
            axes.set_title(f"{short(joint)}: rms {rms:.3g} mrad{mute}", loc="left", fontsize=7.5)
            if column == 0:
                axes.set_ylabel("residual / mrad", fontsize=8)
        grid[-1, column].set_xlabel(f"time / s, {entry.name}", fontsize=8)
    dress(grid.ravel())
    return figure


def correlations(study: Comparison, name: str, *, inputs: Sequence[str]) -> Figure:
    """Autocorrelation of each joint's residual and correlation of yaw's with inputs, SysID left, OKID right."""
    figure = Figure(figsize=(WIDTH, 1.25 * (3 + len(inputs)) + 0.6), layout="constrained")
    grid = figure.subplots(3 + len(inputs), 2, sharey="row")
    for column, entry in enumerate(study.multivariable.pair()):
        test, style = entry.residual_test(name), LOOKS[entry.name]
        last = int(test.lags[-1])
        for i, joint in enumerate(STUDIED_JOINTS):
            axes = grid[i, column]
            _stems(axes, test.lags[1:], test.autocorrelation[1:, i, i], test.whiteness_bound, style)
            label = f"{short(joint)}: {test.outside_whiteness[i]} of {last} lags outside"
            axes.set_title(label, loc="left", fontsize=7.5)
        for row, joint in enumerate(inputs, start=3):
            axes, j = grid[row, column], STUDIED_JOINTS.index(joint)
            bound = float(test.independence_bound[0, j])
            _stems(axes, test.cross_lags, test.cross_correlation[:, 0, j], bound, style)
            axes.set_title(f"yaw residual with {short(joint)} input", loc="left", fontsize=7.5)
        grid[-1, column].set_xlabel(f"lag / samples, {entry.name}", fontsize=8)
    for axes in grid[:3, 0]:
        axes.set_ylabel("autocorrelation", fontsize=8)
    for axes in grid[3:, 0]:
        axes.set_ylabel("correlation", fontsize=8)
    dress(grid.ravel())
    _limits(grid)
    figure.supxlabel("grey: 99 % bounds", fontsize=8)
    return figure


def _band(axes: Axes, values: np.ndarray, dt: float, style: Style, scale: float, label: str | None = None) -> None:
    envelope(axes, values, dt, style, scale=scale, start=SETTLING, label=label, count=FEW)


def _limits(grid: np.ndarray) -> None:
    """Symmetric axis limits that hold the curve and the bounds."""
    for row in grid:
        top = max(abs(limit) for axes in row for limit in axes.get_ylim())
        for axes in row:
            axes.set_ylim(-top, top)


def _stems(axes: Axes, lags: np.ndarray, values: np.ndarray, bound: float, style: Style) -> None:
    """All stems as one line with gaps, which keeps the file of the figure small."""
    gap = np.full(len(lags), np.nan)
    x, y = np.column_stack((lags, lags, gap)), np.column_stack((np.zeros(len(lags)), values, gap))
    axes.axhspan(-bound, bound, color=GRID, alpha=0.6, lw=0)
    axes.plot(x.ravel(), y.ravel(), color=style.colour, lw=2.0, solid_capstyle="butt")
    axes.axhline(0.0, color=INK, lw=0.7)


def _fits(study: Comparison, name: str) -> tuple[IOData, list[tuple[ThreeJointModel, ModelFit]]]:
    data, pair = study.campaign.several(name), study.multivariable.pair()
    return data, list(zip(pair, sysid.compare([entry.model for entry in pair], data), strict=True))


def _fit_text(fits: Sequence[tuple[ThreeJointModel, ModelFit]], i: int, way: Way) -> str:
    values = [(fit.simulation if way == "simulation" else fit.one_step)[i] for _, fit in fits]
    return ", ".join(f"{entry.kind} {value:.1f} %" for (entry, _), value in zip(fits, values, strict=True))


def _thin(style: Style) -> Style:
    return Style(style.colour, "-", 0.8, style.marker)


def _part(data: IOData, start: float, length: float | None) -> IOData:
    part = _samples(data, start, length)
    return data[part.start : part.stop]


def _samples(data: IOData, start: float, length: float | None) -> slice:
    """Samples of a part; the whole record if it is shorter."""
    first = min(round(start / data.dt), max(len(data) - round((length or 0.0) / data.dt), 0))
    return slice(first, len(data) if length is None else min(first + round(length / data.dt), len(data)))


def _phases(study: Comparison, panels: Sequence[Axes]) -> None:
    """Shade every other phase of the exchange, number all above the first panel and name them below the last."""
    exchange = study.multivariable.exchange
    if exchange is None:
        return
    for number, phase in enumerate(exchange.phases, start=1):
        begin = max(phase.start, SETTLING)
        if number % 2:
            for axes in panels:
                axes.axvspan(begin, phase.end, color=_BAND, lw=0, zorder=0)
        at = (0.5 * (begin + phase.end), 1.02)
        panels[0].annotate(str(number), at, xycoords=("data", "axes fraction"), fontsize=8, ha="center")
    names = [f"{number} {phase.name}" for number, phase in enumerate(exchange.phases, start=1)]
    lines = [", ".join(names[k : k + 5]) for k in range(0, len(names), 5)]
    panels[-1].set_xlabel("\n".join(("time / s", *lines)), fontsize=8)
