"""Figures of chapter III: records and their spectra."""

import numpy as np
from matplotlib.figure import Figure

from scenarios.registry import load
from scenarios.thesis.comparison import Comparison, JointResult
from scenarios.thesis.figure_style import MRAD, WIDTH, dress
from scenarios.thesis.period_spectra import period_spectra
from scenarios.waveform import RATE
from sysid.plots import (
    PALETTE,
    Trace,
    spectra,
)


def tests(study: Comparison, entry: JointResult) -> Figure:
    """Two seconds of each test: commanded and measured angle about the operating point."""
    figure = Figure(figsize=(WIDTH, 7.4), layout="constrained")
    grid = figure.subplots(4, 2, sharex=True).ravel()
    for axes, (number, data) in zip(grid, entry.data.items(), strict=False):
        count = min(len(data), round(2 * RATE))
        time = np.arange(count) / RATE
        axes.step(
            time, MRAD * data.u[:count, 0], where="post", color=PALETTE["measured"].colour, lw=1.1, label="commanded"
        )
        axes.plot(time, MRAD * data.y[:count, 0], color=PALETTE["armax"].colour, lw=1.4, label="measured")
        said = load(f"siso-{number}-{entry.joint}").description.split(": ", 1)[1]
        axes.set_title(f"{number}: {said}", loc="left", fontsize=7.5)
    dress(grid)
    for axes in grid[-2:]:
        axes.set_xlabel("time / s", fontsize=8)
    figure.supylabel("angle / mrad", fontsize=9)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    return figure


def data_spectra(study: Comparison, entry: JointResult) -> Figure:
    """Input, output and disturbance spectrum of the estimation data [Morris1996, fig. 27 to 29]."""
    found = period_spectra(entry.data[study.estimation_test])
    traces = [
        Trace("input", found.input, PALETTE["measured"]),
        Trace("output", found.output, PALETTE["armax"]),
        Trace("disturbance", found.disturbance, PALETTE["oe"]),
    ]
    return spectra(found.frequencies, traces, unit="rad", limits_hz=(0.4, 25.0), size=(WIDTH, 3.6))
