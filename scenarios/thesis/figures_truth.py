"""The figure of the true joints."""

import numpy as np
from matplotlib.figure import Figure

from scenarios.report.figure_style import FREQUENCIES, WIDTH, dress, short
from scenarios.thesis.comparison import Comparison
from sysid.plots import BOUND, INK

LINES = ("solid", (0, (6, 2)), (0, (1.5, 1.5)))
"""One kind of line for each joint: colours stand for methods in this report."""


def true_responses(study: Comparison) -> Figure:
    """Gain and phase of the true joints, with the bandwidth of each marked."""
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    gain, phase = figure.subplots(2, 1, sharex=True, height_ratios=(1.3, 1.0))
    for line, (name, entry) in zip(LINES, study.joints.items(), strict=True):
        response = entry.truth.model.frequency_response(FREQUENCIES)[:, 0, 0]
        level = 20.0 * np.log10(np.abs(response))
        label = f"{short(name)}: {entry.truth.bandwidth_hz:.3f} Hz"
        gain.plot(FREQUENCIES, level, color=INK, ls=line, lw=1.5, label=label)
        phase.plot(FREQUENCIES, np.degrees(np.unwrap(np.angle(response))), color=INK, ls=line, lw=1.5)
        at_dc = 20.0 * np.log10(abs(entry.truth.dc_gain))
        gain.plot(entry.truth.bandwidth_hz, at_dc + 20.0 * np.log10(np.sqrt(0.5)), "o", color=INK, ms=4)
    gain.axvline(1.0, color=BOUND.colour, ls=":", lw=1.2)
    gain.annotate(
        "1 Hz",
        (1.0, 0.03),
        xycoords=("data", "axes fraction"),
        xytext=(3, 0),
        textcoords="offset points",
        fontsize=8,
        color=BOUND.colour,
    )
    gain.legend(title="bandwidth (dots)", fontsize=8, title_fontsize=8, loc="lower left", frameon=False)
    gain.set_ylabel("gain / dB")
    phase.set_ylabel("phase / degrees")
    phase.set_xlabel("frequency / Hz")
    phase.set_xscale("log")
    phase.set_xlim(FREQUENCIES[0], FREQUENCIES[-1])
    dress((gain, phase))
    return figure
