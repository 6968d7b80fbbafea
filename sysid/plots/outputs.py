"""Measured outputs beside those of models."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from sysid.plots.palette import PALETTE
from sysid.plots.panels import chosen, label, legend, line, panels, size_of
from sysid.plots.traces import Trace, traces_of
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
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
        outputs: Fits as `compare` returns them, or model outputs (N,) or (N, ny) on the same samples. Of fits to
            several experiments one is drawn by `data[k]` and `fit.by_experiment[k]`.
        output: Which output of the data, by index or name; all when None.
        start: Start of the piece, s from the first sample.
        length: Length of the piece, s; the rest of the record when None.
        ahead: Whether the predictions of fits are drawn, over the horizon that `compare` was asked for; otherwise
            their simulations.
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
            f"expected one IOData record, got {type(data).__name__}; of several experiments draw one after the other, "
            "with fit.by_experiment"
        )
    names, units = data.output_names or (), data.output_units or ("",) * data.ny
    rows = chosen("output", output, names)
    first = min(round(start / data.dt), max(len(data) - 2, 0))
    samples = len(data) if length is None else max(round(length / data.dt), 2)
    piece = slice(first, first + samples)
    if np.isnan(data.y[piece]).all():
        raise SysidError("no output sample of this piece is known")
    traces = traces_of(outputs, rows, ahead=ahead)
    figure, grid = panels(
        2 * len(rows),
        1,
        size_of(size, len(rows), 1, (7.0, 4.6), (0.0, 3.2)),
        sharex=True,
        ratios=(2, 1) * len(rows),
    )
    for a, i in enumerate(rows):
        upper, lower = grid[2 * a, 0], grid[2 * a + 1, 0]
        measured = data.y[piece, i] * scale
        line(upper, data.time[piece], measured, PALETTE["measured"], "measured", width=2.6)
        for trace in traces:
            values = _column(trace, i, data)
            line(upper, data.time[piece], values[piece] * scale, trace.style, trace.label)
            line(lower, data.time[piece], measured - values[piece] * scale, trace.style, None)
        shown = unit if unit is not None else units[i]
        upper.set_ylabel(label("output" if data.ny == 1 else names[i], shown))
        lower.set_ylabel(label("error", shown))
        if data.window > first:
            upper.axvspan(data.time[first], data.time[min(data.window, len(data) - 1)], color="#f0f0f0", lw=0, zorder=0)
    figure.align_ylabels(list(grid[:, 0]))
    grid[-1, 0].set_xlabel("time / s")
    legend(figure, grid[0, 0])
    return figure


def _column(trace: Trace, output: int, data: IOData) -> FloatArray:
    """What a trace says of one output (N,).

    Raises:
        SysidError: Another length than the record's, or other outputs.
    """
    values = trace.values[:, None] if trace.values.ndim == 1 else trace.values
    if len(values) != len(data):
        raise SysidError(f"{trace.label}: {len(values)} samples, the record has {len(data)}")
    if values.shape[1] not in (1, data.ny):
        raise SysidError(f"{trace.label}: {values.shape[1]} outputs, the record has {data.ny}")
    return values[:, output if values.shape[1] == data.ny else 0]
