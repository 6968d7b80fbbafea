"""Figures of the study that are not the analyst's: waveforms."""

import numpy as np
from matplotlib.figure import Figure

from scenarios.waveform import Waveform
from sysid.palette import GRID, PALETTE


def waveform_figure(waveform: Waveform) -> Figure:
    """The 100 points over time and the power of each spectral line [Morris1996, fig. 11 to 16].

    Args:
        waveform: The file.

    Returns:
        The figure.
    """
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1)
    time = np.arange(len(waveform.points) + 1) / waveform.update_rate
    colour = PALETTE["armax"].colour
    upper.step(time, np.append(waveform.points, waveform.points[0]), where="post", color=colour, lw=1.2)
    upper.set(xlabel="time / s", ylabel="voltage / V", xlim=(0, waveform.period))
    psd = waveform.psd()
    shown = psd.density > 1e-12 * psd.density.max()
    floor = 0.3 * psd.density[shown].min()
    lower.vlines(psd.frequency[shown], floor, psd.density[shown], color=colour, lw=1.6)
    lower.plot(psd.frequency[shown], psd.density[shown], "o", ms=3, color=colour)
    lower.set(yscale="log", xlabel="frequency / Hz", ylabel="density / (V²/Hz)")
    lower.set_xlim(-0.01 * waveform.update_rate, 0.51 * waveform.update_rate)
    for axes in (upper, lower):
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    title = f"{waveform.kind.replace('_', ' ')}: one period, order of excitation {waveform.order_of_excitation()}"
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure
