"""Panels over frequency and in the z plane: gains, phases, spectra, poles and zeros."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from scenarios.files.errors import MissingRecordError
from scenarios.record_figures.period_spectra import PeriodSpectra
from scenarios.report.chart import Panel, Series
from scenarios.report.figure_style import points
from sysid import FrequencyResponse, StateSpace
from sysid.plots import BOUND, PALETTE, Style

HZ, DEGREES = "frequency / Hz", "phase / °"

REACH = 1.5
"""Limits of the z plane; roots beyond are counted in the legend."""

RELIABLE = 0.2
"""Standard deviation of a gain, relative to it, below which it is drawn as known."""

ROUNDING = 1e-15
"""Density relative to the largest that is rounding."""


def gain_series(label: str, response: FrequencyResponse, style: Style, output: int = 0, input: int = 0) -> Series:
    """Gain from an input to an output, with its 95 % band where it is known."""
    gain = response.magnitude[:, output, input]
    low = high = None
    if response.covariance is not None:
        low, high = (end[:, output, input] for end in response.magnitude_ci95())
    # A gain of zero has no place on a logarithmic axis.
    return Series(label, response.frequencies, np.where(gain > 0.0, gain, np.nan), style, low, high)


def phase_series(
    label: str,
    response: FrequencyResponse,
    style: Style,
    reference: tuple[NDArray[np.float64], NDArray[np.float64]],
    output: int = 0,
    input: int = 0,
) -> Series:
    """Phase in degrees, unwrapped onto the same turn as a reference.

    Args:
        label: Name in the legend.
        response: The response.
        style: Its look.
        reference: Frequencies (n,), Hz, so dense that the phase moves by less than half a turn between two, and the
            phase there (n,), rad, unwrapped.
        output: Number of the output.
        input: Number of the input.
    """
    angle = np.angle(response.response[:, output, input])
    # An estimate alone does not tell how many full turns its phase has made.
    turns = np.round((angle - np.interp(response.frequencies, *reference)) / (2 * np.pi))
    return Series(label, response.frequencies, np.degrees(angle - 2 * np.pi * turns), style)


def reliable_lines(response: FrequencyResponse, output: int = 0, input: int = 0) -> NDArray[np.bool_]:
    """Return where the gain of a path is known to a fifth (nf,); elsewhere it shows noise and distortion.

    Raises:
        MissingRecordError: The response has no covariance.
    """
    covariance = response.covariance
    if covariance is None:
        raise MissingRecordError(f"the response by {response.method} has no covariance")
    # Of real and imaginary part together: whatever the phase, the gain errs by no more.
    spread = np.sqrt(np.trace(covariance[:, output, input], axis1=1, axis2=2))
    return np.asarray(spread < RELIABLE * response.magnitude[:, output, input])


def spectra_panels(
    windowed: FrequencyResponse,
    repeated: PeriodSpectra | None,
    output: int = 0,
    input: int = 0,
    *,
    scales: tuple[float, float] = (1.0, 1.0),
    units: tuple[str, str, str] = ("", "", ""),
    beside: Sequence[Sequence[Series]] = ((), (), (), ()),
    limits: tuple[float, float],
) -> tuple[Panel, ...]:
    """Spectra of disturbance, output and input, and between both [Morris1996, fig. 27 to 30].

    Args:
        windowed: Windowed spectra at the frequencies that are drawn; what is negative is left out.
        repeated: Spectra by repetition of the same pair; None where the input does not repeat.
        output: Number of the output.
        input: Number of the input.
        scales: Factors from the units of the record to those of the figure, of output and input.
        units: Units of the densities of outputs, of inputs, and between both.
        beside: Further curves of each panel.
        limits: Lowest and highest frequency, Hz.
    """
    of_output, of_input = scales
    panels = []
    for (title, density, by_repetition, scale, unit), further in zip(
        (
            ("disturbance", windowed.noise_spectrum, "disturbance", of_output**2, units[0]),
            ("output", windowed.output_spectrum, "output", of_output**2, units[0]),
            ("input", windowed.input_spectrum, "input", of_input**2, units[1]),
            ("cross, magnitude", windowed.cross_spectrum, "cross", of_output * of_input, units[2]),
        ),
        beside,
        strict=True,
    ):
        series = []
        if density is not None:
            row = input if title == "input" else output
            column = output if title in ("disturbance", "output") else input
            values = density[:, row, column]
            power = np.abs(values) if title.startswith("cross") else values.real
            # The Hamming window makes densities negative: gaps.
            positive = scale * np.where(power > 0.0, power, np.nan)
            look = Style(PALETTE["spa"].colour, "-", 0.8)
            series.append(Series("Hamming window", windowed.frequencies, positive, look))
        if repeated is not None:
            lines = np.abs(getattr(repeated, by_repetition))
            # Lines without input power beyond rounding are left out.
            beyond_rounding = np.where(lines > ROUNDING * lines.max(), scale * lines, np.nan)
            series.append(Series("by repetition", repeated.frequencies, beyond_rounding, points("oe", "^")))
        label = f"density / ({unit})" if unit else "density"
        panels.append(Panel(HZ, label, [*series, *further], title, "xy", limits))
    return tuple(panels)


def root_panel(systems: Iterable[tuple[str, StateSpace, Style]]) -> Panel:
    """Poles and transmission zeros of models in the z plane, with the unit circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 91)
    series = [Series("unit circle", np.cos(angle), np.sin(angle), Style(BOUND.colour, "-", 0.9))]
    for label, model, look in systems:
        for poles_or_zeros, values, marker in (("poles", model.poles(), "x"), ("zeros", model.zeros(), "o")):
            inside = values[(np.abs(values.real) < REACH) & (np.abs(values.imag) < REACH)]
            beyond = len(values) - len(inside)
            name = f"{label}, {poles_or_zeros}"
            if beyond:
                name += f" ({beyond} beyond)"
            series.append(Series(name, inside.real, inside.imag, Style(look.colour, "", 1.0, marker)))
    ends = (-REACH, REACH)
    return Panel("real part of z", "imaginary part of z", series, "", "", ends, ends, equal=True)
