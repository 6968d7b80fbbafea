"""Magnitude and phase over frequency."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sysid.models.frequency_response import FrequencyResponse
from sysid.plots.palette import BOUND, PALETTE
from sysid.plots.panels import (
    channel_indices,
    channel_names,
    check_same_channels,
    decibel,
    finish,
    fit_to_lines,
    frequency_axes,
    line,
    panels,
    shade,
    size_of,
)
from sysid.plots.traces import Curve, Drawable, curves_of
from sysid.records.arguments import number_pair, real_number, truth_value
from sysid.records.arrays import FloatArray
from sysid.validation.model_error import ModelError

SIGNIFICANT = 2.0  # least magnitude of a response, in standard deviations, for its phase to be drawn
FARTHEST = 10.0  # dB beyond the curves that the axis includes of an interval with distortion and order, for each end
DEEPEST = -90.0  # lowest magnitude that the axis includes, dB


def bode(
    curves: Drawable | Sequence[Drawable] | Mapping[str, Drawable],
    *,
    frequencies: FloatArray | None = None,
    output: int | str | None = None,
    input: int | str | None = None,
    error: ModelError | None = None,
    relative_to_dc: bool = False,
    mark_hz: float | None = None,
    limits_hz: tuple[float, float] | None = None,
    phase_limits: tuple[float, float] | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Magnitude in dB and phase in degrees over frequency, with 95 % bands where the response has a covariance.

    With several channels a column per input and two rows per output. A best linear approximation is drawn with the
    standard deviations of noise and nonlinear distortion in a single realisation.

    Args:
        curves: Responses, models or estimates: one, several, or several by name. Of python-control and SciPy, systems
            in discrete time with a sampling interval.
        frequencies: Frequencies of models and estimates, Hz; three decades up to Nyquist by default.
        output: Output by index or name; all when None.
        input: Input by index or name; all when None.
        error: Intervals of the gain with nonlinear distortion and too low an order, drawn as lines.
        relative_to_dc: Draw a line 3 dB below unity, where a unit-gain servo has its bandwidth.
        mark_hz: A frequency to mark in both panels, Hz.
        limits_hz: Range of the frequency axis, Hz.
        phase_limits: Range of the phase axis, degrees.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, something without a response, responses with different channels.
    """
    relative_to_dc = truth_value("relative_to_dc", relative_to_dc)
    if phase_limits is not None:
        phase_limits = number_pair("phase_limits", phase_limits, "the lowest and the highest phase, degrees")
    if mark_hz is not None:
        mark_hz = real_number("mark_hz", mark_hz, "be a frequency in Hz", lambda f: bool(np.isfinite(f)))
    drawn = curves_of(curves, frequencies)
    outputs, inputs = _channels(drawn)
    rows, columns = channel_indices("output", output, outputs), channel_indices("input", input, inputs)
    single = len(rows) == len(columns) == 1
    # A model is drawn without noise, so that its phase tells how many full turns that of data has made.
    reference = next((curve.response for curve in drawn if _of_model(curve.response)), None)
    figure, grid = panels(
        2 * len(rows), len(columns), size_of(size, len(rows), len(columns), (7.0, 5.4), (3.0, 4.4)), sharex=True
    )
    for a, i in enumerate(rows):
        for b, j in enumerate(columns):
            upper, lower = grid[2 * a, b], grid[2 * a + 1, b]
            for curve in drawn:
                _draw(upper, lower, curve, reference, i, j)
            if relative_to_dc:
                _half_power(upper)
            fit_to_lines(upper, floor=DEEPEST)
            if error is not None:
                _draw_error(upper, error, i, j)
            fit_to_lines(lower)
            if not single:
                upper.set_title(f"{inputs[j]} → {outputs[i]}", loc="left", fontsize=9)
            if b == 0:
                upper.set_ylabel("magnitude / dB")
                lower.set_ylabel("phase / degrees")
            if phase_limits is not None:
                lower.set_ylim(*phase_limits)
    if mark_hz is not None:
        for axes in grid.ravel():
            axes.axvline(mark_hz, color=BOUND.colour, ls=":", lw=1.0)
    frequency_axes(grid, limits_hz)
    return finish(figure, grid, "frequency / Hz")


def _channels(curves: Sequence[Curve]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of outputs and inputs, those of the first curve with names."""
    check_same_channels([(curve.label, curve.response.response.shape[1:]) for curve in curves])
    _, ny, nu = curves[0].response.response.shape
    outputs: tuple[str, ...] = next((c.response.output_names for c in curves if c.response.output_names), ())
    inputs: tuple[str, ...] = next((c.response.input_names for c in curves if c.response.input_names), ())
    return channel_names(outputs, ny, "y"), channel_names(inputs, nu, "u")


def _draw(upper: Axes, lower: Axes, curve: Curve, reference: FrequencyResponse | None, i: int, j: int) -> None:
    style = curve.style or PALETTE.get(curve.response.method, PALETTE["measured"])
    f = curve.response.frequencies
    # A logarithmic axis has no 0 Hz.
    keep = f > 0.0
    magnitude = curve.response.magnitude[keep, i, j]
    phase = _phase(curve.response, reference, i, j)[keep]
    line(upper, f[keep], decibel(magnitude), style, curve.label)
    line(lower, f[keep], phase, style, None)
    for level in curve.levels:
        # A variance estimated as zero would be drawn at -6000 dB: it leaves a gap.
        values = np.where(level.values[keep, i, j] > 0.0, level.values[keep, i, j], np.nan)
        if np.isfinite(values).any():
            line(upper, f[keep], decibel(values), level.style, level.label)
    if curve.response.covariance is None:
        return
    # Without input power the band is infinite: it is omitted there.
    determined = keep & np.isfinite(curve.response.covariance[:, i, j]).all(axis=(1, 2))
    path = curve.response.select(determined, inputs=[j], outputs=[i])
    low, high = (edge[:, 0, 0] for edge in path.magnitude_ci95())
    shade(upper, f[determined], decibel(low), decibel(high), style)
    spread = path.quantile_95 * np.degrees(path.phase_deviation()[:, 0, 0])
    centre = phase[determined[keep]]
    spread = np.where(np.isfinite(centre), spread, np.nan)
    shade(lower, f[determined], centre - spread, centre + spread, style)


def _draw_error(upper: Axes, error: ModelError, i: int, j: int) -> None:
    """Ends of the interval with distortion and order, where the record tells it."""
    f = error.frequencies
    # Below the strong lines of the input nothing is measured.
    keep = (f > 0.0) & (f >= error.strong_line)
    for end, label in zip(error.interval, ("95 % with distortion and order", None), strict=True):
        ends = decibel(end[keep, i, j])
        line(upper, f[keep], ends, BOUND, label)
        # an end that leads far away is cut off: it would flatten the curves
        low, high = upper.get_ylim()
        known = np.clip(ends[np.isfinite(ends)], low - FARTHEST, high + FARTHEST)
        upper.set_ylim(known.min(initial=low), known.max(initial=high))


def _of_model(response: FrequencyResponse) -> bool:
    """Whether a response is that of a model, whose smooth phase can be unwrapped reliably."""
    # Data of these two kinds may lack all that other nonparametric responses are recognised by.
    if response.method in ("etfe", "data"):
        return False
    return response.coherence is None and response.degrees_of_freedom is None and response.cross_spectrum is None


def _phase(response: FrequencyResponse, reference: FrequencyResponse | None, i: int, j: int) -> FloatArray:
    """Unwrapped phase in degrees (nf,), that of data beside the phase of a reference model, if any.

    NaN where the response is smaller than its uncertainty, so that its phase is random.
    """
    value = response.response[:, i, j]
    significant = np.isfinite(value)
    if response.covariance is not None:
        deviation = response.magnitude_deviation()[:, i, j]
        significant &= ~(np.abs(value) < SIGNIFICANT * deviation)
    out = np.full(len(value), np.nan)
    out[significant] = np.degrees(np.unwrap(np.angle(value[significant])))
    if reference is not None and not _of_model(response):
        # noise can add full turns to the phase of data between two frequencies; the model has the right number
        turns = np.degrees(reference.phase[:, i, j])
        finite = np.isfinite(turns)
        if finite.any():
            beside = np.interp(response.frequencies, reference.frequencies[finite], turns[finite])
            out -= 360.0 * np.round((out - beside) / 360.0)
    return out


def _half_power(upper: Axes) -> None:
    upper.axhline(20 * np.log10(np.sqrt(0.5)), color=BOUND.colour, ls=BOUND.line, lw=BOUND.width)
    upper.annotate(
        "−3 dB",
        (1, -3.01),
        xycoords=("axes fraction", "data"),
        xytext=(-3, 2),
        ha="right",
        textcoords="offset points",
        fontsize=8,
        color=BOUND.colour,
    )
