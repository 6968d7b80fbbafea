"""Signals over time: records, and measured outputs beside those of models."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sysid.plots.palette import PALETTE, Style
from sysid.plots.panels import LONG, channel_indices, finish, label, line, panels, piece_of, shade_window, size_of
from sysid.plots.traces import Trace, traces_of
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.validation.compare import ModelFit


def output_comparison(
    data: IOData,
    outputs: Trace | ModelFit | Sequence[Trace | ModelFit],
    *,
    output: int | str | None = None,
    start: float = 0.0,
    length: float | None = None,
    ahead: bool = False,
    scale: float = 1.0,
    unit: str | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Measured output and model outputs over a piece of time, and their differences below.

    Args:
        data: The measurement.
        outputs: Fits of `compare`, or model outputs (N,) or (N, ny) on the same samples. Of fits to
            several experiments one is drawn by `data[k]` and `fit.by_experiment[k]`.
        output: Which output of the data, by index or name; all when None.
        start: Start of the piece, s from the first sample.
        length: Length of the piece, s; the rest of the record when None.
        ahead: Whether to draw the predictions of fits, over the horizon of `compare`; otherwise their simulations.
        scale: Factor on all values, e.g. 1000 for mrad.
        unit: Unit after scaling; that of the data by default.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: No such output, or model outputs of another length than the record.
    """
    if not isinstance(data, IOData):
        raise SysidError(
            f"expected one IOData record, got {type(data).__name__}; draw several experiments one by one, with "
            "fit.by_experiment"
        )
    names, units = data.output_names or (), data.output_units or ("",) * data.ny
    rows = channel_indices("output", output, names)
    piece = piece_of(data, start, length)
    if np.isnan(data.y[piece]).all():
        raise SysidError("no output sample of this piece is known")
    traces = traces_of(outputs, rows, names, ahead=ahead)
    figure, grid = panels(
        2 * len(rows), 1, size_of(size, len(rows), 1, (7.0, 4.6), (0.0, 3.2)), sharex=True, ratios=(2, 1) * len(rows)
    )
    for a, i in enumerate(rows):
        upper, lower = grid[2 * a, 0], grid[2 * a + 1, 0]
        measured = data.y[piece, i] * scale
        # Wider than the line of any model, which is then drawn on top of it.
        line(upper, data.time[piece], measured, PALETTE["measured"], "measured", width=2.6)
        for trace in traces:
            values = _column(trace, i, data)
            line(upper, data.time[piece], values[piece] * scale, trace.style, trace.label)
            line(lower, data.time[piece], measured - values[piece] * scale, trace.style, None)
        shown = unit if unit is not None else units[i]
        point = None if data.output_offset is None else data.output_offset * scale
        name = "output" if names == ("y1",) else names[i]
        upper.set_ylabel(_label(name, shown, [point], i))
        lower.set_ylabel(label("error", shown))
        shade_window(upper, data, piece.start)
    return finish(figure, grid, "time / s")


def _label(name: str, unit: str, points: Sequence[FloatArray | None], channel: int) -> str:
    """Label of an axis, which says where an operating point was subtracted."""
    removed = [point[channel] for point in points if point is not None and abs(point[channel]) > ROUNDING]
    if not removed:
        return label(name, unit)
    is_common = len(removed) == len(points) and np.ptp(removed) == 0.0
    origin = f"{removed[0]:.4g}" if is_common else "the operating point"
    return label(f"{name}, deviation from {origin}", unit)


def _column(trace: Trace, output: int, data: IOData) -> FloatArray:
    """Values of a trace for one output (N,)."""
    values = trace.values[:, None] if trace.values.ndim == 1 else trace.values
    if len(values) != len(data):
        raise SysidError(f"{trace.label}: {len(values)} samples, the record has {len(data)}")
    if values.shape[1] not in (1, data.ny):
        raise SysidError(f"{trace.label}: {values.shape[1]} outputs, the record has {data.ny}")
    column = output if values.shape[1] == data.ny else 0
    return values[:, column]


ROUNDING = 1e-12  # largest operating point that counts as none, in units of the channel

LOOKS = tuple(PALETTE[name] for name in ("armax", "oe", "okid", "iv4", "bj", "pem_ss", "arx", "spa"))
"""Styles of several experiments, in their sequence."""


def record(
    data: IOData | Sequence[IOData] | Mapping[str, IOData],
    *,
    start: float = 0.0,
    length: float | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Outputs and inputs over time, a panel each; several experiments in one figure.

    A held input is drawn in steps, missing samples are gaps, the initialisation window is shaded.

    Args:
        data: One record, several with the same channels, or several by name.
        start: Start of the piece that is drawn, s from the first sample.
        length: Length of the piece, s; the rest of the record when None.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, or records with different channels.
    """
    experiments = as_experiments(list(data.values()) if isinstance(data, Mapping) else data, missing=True, series=True)
    if isinstance(data, Mapping):
        names = list(data)
    else:
        names = [experiment.name or f"experiment {k + 1}" for k, experiment in enumerate(experiments)]
    if len(set(names)) < len(names):
        names = [f"{k + 1}: {name}" for k, name in enumerate(names)]
    first = experiments[0]
    count = first.ny + first.nu
    labels = (*(first.output_names or ()), *(first.input_names or ()))
    units = (*(first.output_units or ("",) * first.ny), *(first.input_units or ("",) * first.nu))
    figure, grid = panels(count, 1, size_of(size, count, 1, (7.0, 2.6), (0.0, 1.5)), sharex=True)
    several = len(experiments) > 1
    for k, (name, e) in enumerate(zip(names, experiments, strict=True)):
        piece = piece_of(e, start, length)
        # one experiment: outputs and inputs in different colours
        look = LOOKS[k % len(LOOKS)] if several else None
        output_style, input_style = look or PALETTE["armax"], look or PALETTE["oe"]
        outputs, inputs = grid[: e.ny, 0], grid[e.ny :, 0]
        for c, axes in enumerate(outputs):
            # One entry in the legend for each experiment.
            legend = name if c == 0 and several else None
            _trace(axes, e.time[piece], e.y[piece, c], output_style, legend, held=False)
            shade_window(axes, e, piece.start)
        for c, axes in enumerate(inputs):
            _trace(axes, e.time[piece], e.u[piece, c], input_style, None, held=e.intersample == "zoh")
            shade_window(axes, e, piece.start)
    for row, (name, unit) in enumerate(zip(labels, units, strict=True)):
        if row < first.ny:
            points, channel = [e.output_offset for e in experiments], row
        else:
            points, channel = [e.input_offset for e in experiments], row - first.ny
        grid[row, 0].set_ylabel(_label(name, unit, points, channel))
    return finish(figure, grid, "time / s")


def _trace(axes: Axes, time: FloatArray, values: FloatArray, style: Style, name: str | None, *, held: bool) -> None:
    # a single sample between two gaps has no line: it needs a marker
    present = np.isfinite(values)
    follows, precedes = np.concatenate(([False], present[:-1])), np.concatenate((present[1:], [False]))
    alone = present & ~follows & ~precedes
    steps = "steps-post" if held else "default"
    width = 1.0 if len(time) <= LONG else 0.7
    axes.plot(time, values, color=style.colour, lw=width, drawstyle=steps, label=name)
    axes.plot(time[alone], values[alone], ls="none", marker=".", ms=3, color=style.colour)
