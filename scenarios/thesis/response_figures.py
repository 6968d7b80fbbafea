"""Frequency responses in the report's figures: their range, what the waveform file excites, labels of lines."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.experiments.waveform import POINTS
from scenarios.report.figure_style import NOT_EXCITED, WIDTH
from sysid import FrequencyResponse, StateSpace
from sysid.plots import BOUND, Curve, bode

FREQUENCIES = np.geomspace(0.05, 25.0, 300)

ZOOM = (0.1, 3.0)
"""Range that holds the joints' bandwidths, and below them what models extrapolate, Hz."""

EXCITED_FROM = SAMPLE_RATE / POINTS
"""Lowest frequency with power in the input of a 100-point file played at 50 Hz, Hz."""


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


def line_mark(axes: Axes, text: str, place: tuple[float, float], gap: float) -> None:
    """Write a word beside a vertical line, at a height in parts of the axes and so many points to the right."""
    coordinates = ("data", "axes fraction")
    axes.annotate(text, place, (gap, 0), coordinates, "offset points", fontsize=8, color=BOUND.colour)
