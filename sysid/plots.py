"""Figures: one palette, axes with units, frequency in Hz on a logarithmic axis.

Every function takes records as estimators and tests return them, one or several or several by name, and returns a
matplotlib `Figure` that belongs to no window; save it with `figure.savefig(path)`.

    import sysid, sysid.plots

    found = sysid.oe(data, 2, 2, 1)
    sysid.plots.bode([sysid.spa(data), found]).savefig("bode.png")
    sysid.plots.pzmap({"identified": found}).savefig("roots.png")
    sysid.plots.correlations(sysid.resid(found, data)).savefig("residuals.png")
    sysid.plots.output_comparison(data, sysid.compare(found, data)).savefig("outputs.png")

`Curve`, `Roots` and `Trace` give a record a name and a `Style` of its own.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sysid.arrays import FloatArray
from sysid.compare import ModelFit
from sysid.data import IOData
from sysid.frequency import FrequencyResponse
from sysid.palette import BOUND, GRID, INK, PALETTE, Style
from sysid.resid import ResidualTest
from sysid.traces import Curve, Drawable, Rooted, Roots, Trace, curves_of, roots_of, traces_of

__all__ = [
    "GRID",
    "PALETTE",
    "Curve",
    "Roots",
    "Style",
    "Trace",
    "bode",
    "correlations",
    "output_comparison",
    "pzmap",
    "spectra",
]


def bode(
    curves: Drawable | Sequence[Drawable] | Mapping[str, Drawable],
    *,
    frequencies: FloatArray | None = None,
    output: int = 0,
    input: int = 0,
    relative_to_dc: bool = False,
    mark_hz: float | None = None,
    limits_hz: tuple[float, float] | None = None,
    phase_limits: tuple[float, float] | None = None,
    size: tuple[float, float] = (7.0, 5.4),
) -> Figure:
    """Magnitude in dB and phase in degrees over frequency, with 95 % bands where the response has a covariance.

    Args:
        curves: Responses, models or estimates: one, several, or several by name.
        frequencies: Where models and estimates are drawn, Hz; three decades up to Nyquist by default.
        output: Row of the response.
        input: Column of the response.
        relative_to_dc: Draw a line 3 dB below unity, where a unit-gain servo has its bandwidth.
        mark_hz: A frequency to mark in both panels, Hz.
        limits_hz: Range of the frequency axis, Hz.
        phase_limits: Range of the phase axis, degrees.
        size: Width and height, inch.

    Returns:
        The figure.
    """
    figure, (upper, lower) = _panels(2, size, sharex=True)
    for curve in curves_of(curves, frequencies):
        style = curve.style or PALETTE.get(curve.response.method, PALETTE["measured"])
        f = curve.response.frequencies
        keep = f > 0.0
        magnitude = curve.response.magnitude[keep, output, input]
        phase = np.degrees(curve.response.phase[keep, output, input])
        _line(upper, f[keep], _decibel(magnitude), style, curve.label)
        _line(lower, f[keep], phase, style, None)
        if curve.response.covariance is not None:
            # Where the input has no power the band has no end; it is left out there, not drawn over everything.
            known = keep & np.isfinite(curve.response.covariance[:, output, input]).all(axis=(1, 2))
            part = FrequencyResponse(
                f[known],
                curve.response.response[known][:, [output]][:, :, [input]],
                curve.response.dt,
                curve.response.method,
                curve.response.covariance[known][:, [output]][:, :, [input]],
                degrees_of_freedom=curve.response.degrees_of_freedom,
            )
            low, high = (edge[:, 0, 0] for edge in part.magnitude_ci95())
            upper.fill_between(f[known], _decibel(low), _decibel(high), color=style.colour, alpha=0.18, lw=0)
            spread = part.quantile_95 * np.degrees(part.phase_deviation()[:, 0, 0])
            centre = phase[known[keep]]
            lower.fill_between(f[known], centre - spread, centre + spread, color=style.colour, alpha=0.18, lw=0)
    if relative_to_dc:
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
    _fit_to_lines(upper, floor=-90.0)
    _fit_to_lines(lower, floor=-np.inf)
    for axes in (upper, lower):
        axes.set_xscale("log")
        if mark_hz is not None:
            axes.axvline(mark_hz, color=BOUND.colour, ls=":", lw=1.0)
        if limits_hz is not None:
            axes.set_xlim(*limits_hz)
    _plain_frequencies(lower)
    upper.set_ylabel("magnitude / dB")
    lower.set_ylabel("phase / degrees")
    if phase_limits is not None:
        lower.set_ylim(*phase_limits)
    lower.set_xlabel("frequency / Hz")
    _legend(figure, upper)
    return figure


def pzmap(
    systems: Rooted | Sequence[Rooted] | Mapping[str, Rooted], *, size: tuple[float, float] = (4.6, 4.9)
) -> Figure:
    """Poles (crosses) and zeros (rings) in the z plane; roots far outside the unit circle are counted in the legend.

    Args:
        systems: Models or estimates: one, several, or several by name.
        size: Width and height, inch.

    Returns:
        The figure.
    """
    figure, (axes,) = _panels(1, size)
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(angle), np.sin(angle), color=BOUND.colour, lw=0.9)
    axes.axhline(0.0, color=GRID, lw=0.8, zorder=0)
    axes.axvline(0.0, color=GRID, lw=0.8, zorder=0)
    reach = 1.6
    for number, system in enumerate(roots_of(systems)):
        poles, zeros = system.model.poles(), system.model.zeros()
        beyond = int((np.abs(zeros) > reach).sum() + (np.abs(poles) > reach).sum())
        label = system.label + (f" ({beyond} outside)" if beyond else "")
        grow = 9 - 1.2 * number
        axes.plot(poles.real, poles.imag, "x", color=system.style.colour, ms=grow, mew=1.7, label=label)
        axes.plot(zeros.real, zeros.imag, "o", color=system.style.colour, ms=grow, mew=1.3, mfc="none")
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    axes.set_xlabel("real part of z (× pole, ○ zero)")
    axes.set_ylabel("imaginary part of z")
    _legend(figure, axes)
    return figure


def output_comparison(
    data: IOData,
    outputs: Trace | ModelFit | Sequence[Trace | ModelFit],
    *,
    output: int = 0,
    start: float = 0.0,
    length: float = 6.0,
    scale: float = 1.0,
    unit: str | None = None,
    size: tuple[float, float] = (7.0, 4.6),
) -> Figure:
    """Measured output and model outputs over a piece of time, and their differences below.

    Args:
        data: The measurement.
        outputs: Fits as `compare` returns them, or model outputs (N,) on the same samples.
        output: Which output of the data.
        start: Start of the piece, s.
        length: Length of the piece, s.
        scale: Factor on all values, e.g. 1000 for mrad.
        unit: Unit after scaling; that of the data by default.
        size: Width and height, inch.

    Returns:
        The figure.
    """
    first = min(round(start / data.dt), max(len(data) - 2, 0))
    piece = slice(first, first + max(round(length / data.dt), 2))
    time, measured = data.time[piece], data.y[piece, output] * scale
    unit = unit if unit is not None else (data.output_units or ("",))[output]
    figure, (upper, lower) = _panels(2, size, sharex=True, ratios=(2, 1))
    _line(upper, time, measured, PALETTE["measured"], "measured", width=2.6)
    for trace in traces_of(outputs, output):
        _line(upper, time, trace.values[piece] * scale, trace.style, trace.label)
        _line(lower, time, measured - trace.values[piece] * scale, trace.style, None)
    upper.set_ylabel(f"output / {unit}" if unit else "output")
    lower.set_ylabel(f"error / {unit}" if unit else "error")
    lower.set_xlabel("time / s")
    _legend(figure, upper)
    return figure


def correlations(
    panels: ResidualTest | Sequence[tuple[str, FloatArray | NDArray[np.int_], FloatArray, FloatArray | float]],
    style: Style = PALETTE["oe"],
    *,
    output: int = 0,
    input: int = 0,
    size: tuple[float, float] = (7.0, 4.4),
) -> Figure:
    """Correlation coefficients over lag with their bounds: whiteness and independence of residuals.

    Args:
        panels: A residual test, as `resid` returns it; or per panel: what is on the vertical axis,
            lags (n,) in samples, coefficients (n,), bound, one or (n,).
        style: Colour of the method.
        output: Output of the residual test.
        input: Input of the residual test.
        size: Width and height, inch.

    Returns:
        The figure.
    """
    bounds = "99 % bounds"
    if isinstance(panels, ResidualTest):
        bounds = f"{100 * panels.level:g} % bounds"
        panels = _of_test(panels, output, input)
    figure, axes_list = _panels(len(panels), size)
    for axes, (label, lags, values, bound) in zip(axes_list, panels, strict=True):
        limit = np.broadcast_to(np.asarray(bound, dtype=float), lags.shape)
        axes.fill_between(lags, -limit, limit, color=GRID, alpha=0.7, lw=0, label=bounds)
        axes.vlines(lags, 0.0, values, color=style.colour, lw=1.3)
        axes.plot(lags, values, ls="none", marker="o", ms=2.6, color=style.colour)
        axes.axhline(0.0, color=INK, lw=0.8)
        # The zero lag of an autocorrelation is one by definition; the axis is for the lags that carry information.
        shown = values[lags != 0] if label.startswith("auto") else values
        top = 1.25 * max(float(np.abs(shown).max(initial=0.0)), float(limit.max()), 1e-6)
        axes.set_ylim(-top, top)
        axes.set_ylabel(label)
    axes_list[-1].set_xlabel("lag / samples")
    _legend(figure, axes_list[0])
    return figure


def spectra(
    frequencies: FloatArray,
    traces: Sequence[Trace],
    *,
    unit: str = "",
    limits_hz: tuple[float, float] | None = None,
    size: tuple[float, float] = (7.0, 3.6),
) -> Figure:
    """Power spectral densities on logarithmic axes.

    Args:
        frequencies: Hz (nf,).
        traces: Densities (nf,); a lag window can leave negative ones, which are left out.
        unit: Unit of the signal; the axis shows its square per Hz.
        limits_hz: Range of the frequency axis, Hz.
        size: Width and height, inch.

    Returns:
        The figure.
    """
    figure, (axes,) = _panels(1, size)
    keep = frequencies > 0.0
    for trace in traces:
        positive = np.where(trace.values > 0.0, trace.values, np.nan)
        _line(axes, frequencies[keep], positive[keep], trace.style, trace.label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    if limits_hz is not None:
        axes.set_xlim(*limits_hz)
    _plain_frequencies(axes)
    axes.set_xlabel("frequency / Hz")
    axes.set_ylabel(f"spectral density / ({unit}²/Hz)" if unit else "spectral density")
    _legend(figure, axes)
    return figure


def _of_test(
    test: ResidualTest, output: int, input: int
) -> list[tuple[str, FloatArray | NDArray[np.int_], FloatArray, FloatArray | float]]:
    return [
        ("autocorrelation", test.lags, test.autocorrelation[:, output, output], test.whiteness_bound),
        (
            "correlation with input",
            test.cross_lags,
            test.cross_correlation[:, output, input],
            float(test.independence_bound[output, input]),
        ),
    ]


def _panels(
    count: int, size: tuple[float, float], *, sharex: bool = False, ratios: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(count, 1, sharex=sharex, squeeze=False, height_ratios=ratios)
    panels = [axes for (axes,) in grid]
    for axes in panels:
        axes.grid(True, which="major", color=GRID, lw=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=9, colors=INK)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, panels


def _line(
    axes: Axes, x: FloatArray, y: FloatArray, style: Style, label: str | None, *, width: float | None = None
) -> None:
    marker = "" if style.line else style.marker
    axes.plot(x, y, color=style.colour, ls=style.line, lw=width or style.width, marker=marker, ms=5, label=label)


def _legend(figure: Figure, axes: Axes) -> None:
    """A legend above the figure, where it never covers data."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        # An entry takes its handle, about half an inch, and its text, at 9 points about 0.068 inch a letter.
        entry = 0.55 + 0.068 * max(len(label) for label in labels)
        columns = min(len(handles), max(1, int(figure.get_figwidth() / entry)))
        figure.legend(handles, labels, loc="outside upper left", ncols=columns, frameon=False, fontsize=9)


def _fit_to_lines(axes: Axes, *, floor: float) -> None:
    """Let the lines set the vertical range, not their bands."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()] or [np.zeros(1)])
    values = values[np.isfinite(values)]
    low, high = max(float(values.min(initial=0.0)), floor), float(values.max(initial=0.0))
    margin = 0.06 * max(high - low, 1.0)
    axes.set_ylim(low - margin, high + margin)


def _plain_frequencies(axes: Axes) -> None:
    """Write 0.1, 1, 10 instead of powers of ten."""
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _decibel(magnitude: FloatArray) -> FloatArray:
    return 20.0 * np.log10(np.maximum(magnitude, np.finfo(float).tiny))
