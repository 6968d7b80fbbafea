"""Power spectral densities."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sysid.models.estimate import Estimate
from sysid.models.frequency_response import FrequencyResponse
from sysid.plots.palette import PALETTE, Style
from sysid.plots.panels import (
    channel_indices,
    channel_names,
    finish,
    frequency_axes,
    grid_of_frequencies,
    label,
    line,
    panels,
    shade,
    size_of,
)
from sysid.plots.traces import StyleChooser, Trace, named_items
from sysid.records.arguments import optional_text
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

Spectral = FrequencyResponse | Estimate
"""Anything with a spectrum of the disturbance."""


def spectra(
    responses: Spectral | Sequence[Spectral] | Mapping[str, Spectral] | FloatArray,
    traces: Sequence[Trace] | None = None,
    *,
    frequencies: FloatArray | None = None,
    output: int | str | None = None,
    unit: str = "",
    limits_hz: tuple[float, float] | None = None,
    size: tuple[float, float] | None = None,
) -> Figure:
    """Power spectral densities on logarithmic axes: of the disturbance, or of any traces.

    Of spectral estimates and of parametric ones the disturbance is drawn, with 95 % bands where they
    are known, a panel per output; a single spectral estimate is drawn with the spectra of its outputs and inputs.

    Args:
        responses: Spectral estimates (`spa`, `welch`) or parametric ones, one, several, or several by name; or
            frequencies in Hz (nf,) of the traces that follow.
        traces: Densities (nf,); a lag window can leave negative ones, which are left out.
        frequencies: Where parametric estimates are drawn, Hz; three decades up to Nyquist by default.
        output: Output by index or name; all when None.
        unit: Unit of the signal; the axis shows its square per Hz.
        limits_hz: Range of the frequency axis, Hz.
        size: Width and height, inch; by default enough for all panels.

    Returns:
        The figure.

    Raises:
        SysidError: Nothing to draw, or something that has no spectrum.
    """
    unit = optional_text("unit", unit) or ""
    if traces is not None:
        figure, grid = panels(1, 1, (7.0, 3.6) if size is None else size)
        f = np.asarray(responses, dtype=float)
        # A logarithmic axis has no 0 Hz.
        keep = f > 0.0
        for trace in traces:
            line(grid[0, 0], f[keep], _positive(trace.values[keep]), trace.style, trace.label)
        grid[0, 0].set_ylabel(label("spectral density", f"({unit}²/Hz)" if unit else ""))
    else:
        figure, grid = _of_records(responses, frequencies, output, unit, size)
    for axes in grid.ravel():
        axes.set_yscale("log")
    frequency_axes(grid, limits_hz)
    return finish(figure, grid, "frequency / Hz")


def _of_records(
    responses: object,
    frequencies: FloatArray | None,
    output: int | str | None,
    unit: str,
    size: tuple[float, float] | None,
) -> tuple[Figure, np.ndarray]:
    styles = StyleChooser()
    drawn = []
    for name, item in named_items(responses, (FrequencyResponse, Estimate)):
        response = item
        if isinstance(item, Estimate):
            response = item.spectrum(grid_of_frequencies(frequencies, item.model.dt))
        if response.noise_spectrum is None:
            raise SysidError(f"{response.method} gives no spectrum of the disturbance")
        shown = name or styles.label(item)
        drawn.append((f"{shown}, disturbance", response, styles.next(response.method)))
    first = drawn[0][1]
    _, ny, nu = first.response.shape
    if any(response.response.shape[1] != ny for _, response, _ in drawn):
        raise SysidError("spectra in one figure must have the same outputs")
    names = channel_names(first.output_names, ny, "y")
    rows = channel_indices("output", output, names)
    beside = len(drawn) == 1 and first.input_spectrum is not None and output is None
    height = len(rows) + nu * beside
    figure, grid = panels(height, 1, size_of(size, height, 1, (7.0, 3.6), (0.0, 2.0)), sharex=True)

    def density(axes: Axes, response: FrequencyResponse, field: str, i: int, style: Style, name: str | None) -> None:
        # A logarithmic axis has no zero.
        keep = response.frequencies > 0.0
        line(axes, response.frequencies[keep], _positive(getattr(response, field)[keep, i, i].real), style, name)

    for axes, i in zip(grid[:, 0], rows, strict=False):
        if beside and first.output_spectrum is not None:
            density(axes, first, "output_spectrum", i, PALETTE["measured"], "measured")
        for name, response, style in drawn:
            density(axes, response, "noise_spectrum", i, style, name)
            if _has_interval(response):
                keep = response.frequencies > 0.0
                low, high = (_positive(edge[keep, i]) for edge in response.noise_ci95())
                shade(axes, response.frequencies[keep], low, high, style)
        output_name = "output" if ny == 1 else names[i]
        axes.set_ylabel(_density(output_name, unit))
    for j, axes in enumerate(grid[len(rows) :, 0]):
        density(axes, first, "input_spectrum", j, PALETTE["measured"], None)
        input_name = "input" if nu == 1 else channel_names(first.input_names, nu, "u")[j]
        axes.set_ylabel(_density(input_name, ""))
    return figure, grid


def _has_interval(response: FrequencyResponse) -> bool:
    deviation = response.noise_deviation
    return response.degrees_of_freedom is not None if deviation is None else bool(np.isfinite(deviation).all())


def _density(name: str, unit: str) -> str:
    density_unit = f"({unit}²/Hz)" if unit else ""
    return label(f"{name}, density", density_unit)


def _positive(values: FloatArray) -> FloatArray:
    # A lag window can leave negative densities, for which a logarithmic axis has no place.
    return np.where(values > 0.0, values, np.nan)
