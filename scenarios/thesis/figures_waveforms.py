"""Figures of chapter II: the excitations as files of 100 points, with their spectra [Morris1996, fig. 11 to 16]."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.experiments.excitation import chirp, chirp_as_printed, two_sines, white_noise
from scenarios.experiments.registry import load
from scenarios.experiments.waveform import Waveform
from scenarios.report.figure_style import WIDTH, dress
from sysid.plots import PALETTE, Style

FILE, LINES = PALETTE["armax"], PALETTE["oe"]


@dataclass(frozen=True)
class WaveformFigure:
    """A figure of the thesis and the waveform files that reproduce it.

    Attributes:
        files: By what is said above them.
        thesis: Figures of the thesis.
        caption: What is shown and how it was made.
    """

    files: Mapping[str, Waveform]
    thesis: tuple[str, ...]
    caption: str


def waveform_figures() -> Mapping[str, WaveformFigure]:
    """The thesis' figures 11 to 16 by name, with its parameters where it gives them."""
    binary, pulse = (load(f"siso-{number}-shoulder_yaw").excitation[0].waveform() for number in (5, 7))
    return MappingProxyType(
        {
            "white-noise": WaveformFigure(
                {"white noise": white_noise(seed=0)},
                ("11",),
                "white noise: a hundred normal numbers, and their power on the lines of a file that repeats every 2 s.",
            ),
            "sum-of-sines": WaveformFigure(
                {"two sines of height 1 at 0.02 π and 0.08 π per point": two_sines(frequency=0.5, amplitude=2.0)},
                ("12", "13"),
                "sum of two sines, 1 and 4 cycles in the file: played at 50 Hz, all its power lies at 0.5 and 2 Hz.",
            ),
            "prbs": WaveformFigure(
                {"PRBS, 1 V, two points per bit": binary},
                ("14",),
                "the pseudorandom binary sequence of test 5 (the thesis does not give its own): its lines scatter "
                "about the envelope of the held bits, which falls to nothing at 25 Hz.",
            ),
            "chirp": WaveformFigure(
                {
                    "sweep from 1 to 2 Hz, as played": chirp(f_start=1.0, f_end=2.0),
                    "equation (2.15) as printed, 4 Hz at its centre": chirp_as_printed(
                        f_low=1.0, f_high=2.0, f_center=4.0
                    ),
                },
                ("15",),
                "chirp with the parameters of the thesis' figure. Above: a sweep over the file, which is what the twin "
                "plays. Below: the formula as the thesis prints it sweeps nothing; it is one tone at 5 Hz.",
            ),
            "bipolar-ramping-pulse": WaveformFigure(
                {"bipolar ramping pulse, 4 V, 1 Hz, 0.1 s": pulse},
                ("16",),
                "the bipolar ramping pulse of test 7: odd multiples of 1 Hz, as its two halves mirror each other.",
            ),
        }
    )


def waveform(files: Mapping[str, Waveform]) -> Figure:
    """Each file over its period, and its power on its lines."""
    figure = Figure(figsize=(WIDTH, 0.5 + 1.75 * len(files)), layout="constrained")
    grid = figure.subplots(len(files), 2, squeeze=False, sharex="col", width_ratios=[1.15, 1.0])
    dress(grid.ravel())
    for (title, file), (left, right) in zip(files.items(), grid, strict=True):
        time = np.arange(len(file.points) + 1) / file.update_rate
        # The last point is held too.
        _steps(left, time, np.append(file.points, file.points[-1]), FILE)
        left.set_title(title, loc="left", fontsize=8)
        left.set_ylabel("file / V", fontsize=8)
        left.set_xlim(0.0, file.period)
        density = file.psd()
        right.vlines(density.frequency, 0.0, density.density, color=LINES.colour, lw=1.4)
        right.set_ylabel("density / (V²/Hz)", fontsize=8)
        right.set_xlim(-0.3, 25.3)
        right.set_ylim(0.0, 1.06 * float(density.density.max()))
    for axes, text in zip(grid[-1], ("time / s", "frequency / Hz"), strict=True):
        axes.set_xlabel(text, fontsize=8)
    return figure


def _steps(axes: Axes, time: np.ndarray, volts: np.ndarray, style: Style) -> None:
    axes.step(time, volts, where="post", color=style.colour, lw=style.width)
