"""Look of the report's figures: width, colours, axes."""

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.waveform import POINTS
from sysid import FrequencyResponse, StateSpace
from sysid.plots import BOUND, GRID, INK, PALETTE, Curve, Style, bode

WIDTH = 5.2
"""Width of a figure, inch: narrow enough to be read on a phone."""

FREQUENCIES = np.geomspace(0.05, 25.0, 300)

ZOOM = (0.1, 3.0)
"""Range that holds the joints' bandwidths, and below them what models extrapolate, Hz."""

NOT_EXCITED = "#eef0f2"

MRAD = 1000.0

HIGH = Style("#7a5195", (0, (1, 1.2)), 1.6, "P")  # type: ignore[arg-type]
"""Style of the output-error model of higher order, unlike that of the thesis' own."""

EXCITED_FROM = SAMPLE_RATE / POINTS
"""Lowest frequency with power in the input of a 100-point file played at 50 Hz, Hz."""


def method_style(method: str) -> Style:
    """Colour and line of an estimation method, the same in every figure."""
    return HIGH if method == "oe_high" else PALETTE[method]


def short(name: str) -> str:
    """A joint's name for people."""
    return name.replace("_", " ")


def dc_bode(curves: Sequence[Curve]) -> Figure:
    """Bode plot with the level 3 dB below one and 1 Hz marked, and what is not excited shaded."""
    return mark_excited(bode(curves, relative_to_dc=True, mark_hz=1.0, limits_hz=(0.05, 25.0), size=(WIDTH, 6.0)))


def mark_excited(figure: Figure) -> Figure:
    """Shade the frequencies at which the PRBS file has no power: there a model says what it extrapolates."""
    for number, axes in enumerate(figure.axes):
        left = axes.get_xlim()[0]
        axes.axvspan(left, EXCITED_FROM, color=NOT_EXCITED, lw=0, zorder=0)
        axes.set_xlim(left=left)
        if number == 0:
            at = (float(np.sqrt(left * EXCITED_FROM)), 0.03)
            axes.annotate(
                "not excited", at, xycoords=("data", "axes fraction"), ha="center", fontsize=8, color=BOUND.colour
            )
    return figure


def well_known(response: FrequencyResponse) -> FrequencyResponse:
    """The lines up to half of Nyquist whose gain is known to a fifth; the others show noise and distortion."""
    covariance = response.covariance
    if covariance is None:
        return response
    spread = np.sqrt(np.trace(covariance[:, 0, 0], axis1=1, axis2=2))
    kept = (spread < 0.2 * response.magnitude[:, 0, 0]) & (response.frequencies <= SAMPLE_RATE / 4)
    return FrequencyResponse(
        response.frequencies[kept], response.response[kept], response.dt, response.method, covariance[kept]
    )


def model_response(model: StateSpace) -> FrequencyResponse:
    """Response of a model over the frequencies of the report."""
    return FrequencyResponse(FREQUENCIES, model.frequency_response(FREQUENCIES), model.dt, "model")


def dress(panels: Iterable[Axes]) -> None:
    """Grid, small labels and open corners for every panel."""
    for axes in panels:
        axes.grid(True, color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)


def line_mark(axes: Axes, text: str, place: tuple[float, float], gap: float) -> None:
    """Write a word beside a vertical line, at a height in parts of the axes and so many points to the right."""
    coordinates = ("data", "axes fraction")
    axes.annotate(text, place, (gap, 0), coordinates, "offset points", fontsize=8, color=BOUND.colour)


def plain_marks(axis: Axis, ends: tuple[float, float]) -> None:
    """Mark a logarithmic axis with plain numbers that do not meet: powers of ten alone beyond two decades.

    Args:
        axis: The axis.
        ends: Its limits.
    """
    wide = ends[1] > 100.0 * ends[0]
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=6))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
