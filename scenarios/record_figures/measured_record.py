"""One record with what it tells without a model, and its channels as figures name them."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

import sysid
from scenarios.files.data_file import joints_of
from scenarios.identification.identification import long_lag
from scenarios.record_figures.period_spectra import FEWEST, PeriodSpectra, period_spectra
from scenarios.report.figure_style import MRAD, short
from sysid import FrequencyResponse, IOData, SysidWarning
from sysid.records.repetition import repetitions

MOST_FREQUENCIES = 1000
"""Frequencies of a windowed spectrum, at most: more than a figure shows."""

SHORTEST_LAG = 10
"""Lag of a spectral window, samples, at least: shorter ones resolve nothing."""


@dataclass(frozen=True)
class Channels:
    """Inputs and outputs with the units of figures.

    Attributes:
        inputs: Names of the inputs.
        outputs: Names of the outputs.
        input_units: Units of their axes; empty where a record names none.
        output_units: The same of the outputs.
        input_scales: Factors from the units of the record to those of the axes.
        output_scales: The same of the outputs.
        joints: Joints of a record of the twin, whose names are those of the channels; none of others.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    input_scales: tuple[float, ...]
    output_scales: tuple[float, ...]
    joints: tuple[str, ...] = ()

    @classmethod
    def of(cls, record: IOData) -> "Channels":
        """Channels of a record; small angles are drawn in mrad."""
        joints = joints_of(record)
        inputs, outputs = record.input_names or (), record.output_names or ()
        # Commands and angles of a joint have its name: captions and axes say which of both is meant.
        if joints:
            inputs = outputs = tuple(map(short, joints))
        input_units, input_scales = _axis_units(record.input_units or ("",) * record.nu)
        output_units, output_scales = _axis_units(record.output_units or ("",) * record.ny)
        return cls(inputs, outputs, input_units, output_units, input_scales, output_scales, joints)

    @property
    def paths(self) -> dict[str, tuple[int, int]]:
        """Numbers of output and input of every path by its name; that of a joint to itself has the joint's name."""
        paths = {}
        for i, output in enumerate(self.outputs):
            for j, input in enumerate(self.inputs):
                name = output if self.joints and i == j else f"{input} → {output}"
                paths[name] = (i, j)
        return paths

    def gain_axis(self, output: int, input: int) -> str:
        """Label of the axis of a gain."""
        unit = self._gain_unit(output, input)
        return f"gain / ({unit})" if unit else "gain"

    def pulse_axis(self, output: int, input: int) -> str:
        """Label of the axis of a pulse response."""
        return self._gain_unit(output, input) or "output over input"

    def _gain_unit(self, output: int, input: int) -> str:
        """Unit of a gain in the units of the record; empty where one of both is not known."""
        units = [self.output_units[output], self.input_units[input]]
        if not all(units):
            return ""
        # Figures show angles in mrad; gains stay in the units of the record.
        scales = (self.output_scales[output], self.input_scales[input])
        native = ["rad" if scale == MRAD else unit for unit, scale in zip(units, scales, strict=True)]
        return "/".join(native)

    def output_axis(self, output: int, quantity: str = "") -> str:
        """Label of an axis of an output, or of a quantity in its unit."""
        return _labelled(quantity or self.outputs[output], self.output_units[output])

    def input_axis(self, input: int) -> str:
        """Label of an axis of an input."""
        return _labelled(self.inputs[input], self.input_units[input])

    def density_units(self, output: int, input: int) -> tuple[str, str, str]:
        """Units of spectral densities of an output, of an input, and between both; empty where they are not known."""
        of_output, of_input = self.output_units[output], self.input_units[input]
        between = f"{of_output}²/Hz" if of_output == of_input else f"{of_output}·{of_input}/Hz"
        return (
            f"{of_output}²/Hz" if of_output else "",
            f"{of_input}²/Hz" if of_input else "",
            between if of_output and of_input else "",
        )


def _axis_units(units: Sequence[str]) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Units of axes and the factors to them: those of the record, but mrad in place of rad."""
    shown = tuple("mrad" if unit == "rad" else unit for unit in units)
    return shown, tuple(MRAD if unit == "rad" else 1.0 for unit in units)


def _labelled(name: str, unit: str) -> str:
    return f"{name} / {unit}" if unit else name


@dataclass(frozen=True, eq=False)
class MeasuredRecord:
    """A record of which figures are drawn.

    Attributes:
        name: Name for views: that of its file.
        path: Its file.
        parts: Its stretches without lost inputs, about the means, or as they are with `keep_mean`.
        keep_mean: Whether the values are as they are.
    """

    name: str
    path: Path
    parts: tuple[IOData, ...]
    keep_mean: bool = False

    @property
    def longest(self) -> IOData:
        """The longest stretch, which figures over time show."""
        return max(self.parts, key=len)

    @property
    def place(self) -> int:
        """Index of the longest stretch without gaps."""
        return max(range(len(self.parts)), key=lambda k: len(self.parts[k]))

    @cached_property
    def period(self) -> int:
        """Samples after which the inputs of the longest stretch repeat, at least three times; 0 where they do not."""
        # Of the longest stretch alone: other stretches may begin at another phase of the sequence.
        for repetition in repetitions([self.longest]):
            if repetition.count >= FEWEST:
                return repetition.period
        return 0

    @cached_property
    def lag(self) -> int:
        """Lag of the spectral windows, samples: a tenth of the samples [Morris1996, sec. III.1].

        Several inputs that repeat move together on every line of their period: only a window that covers several lines
        tells their effects apart.
        """
        lag, inputs = long_lag(self.parts), self.longest.nu
        if inputs > 1 and self.period:
            return min(lag, max(self.period // (2 * inputs), SHORTEST_LAG))
        return lag

    @cached_property
    def windowed(self) -> FrequencyResponse:
        """Response and spectra by a Hamming window; the lines of an input that repeats lie on its frequencies.

        Raises:
            SysidError: The record is too short, or an input is constant.
        """
        dt = self.longest.dt
        # Half of what the window resolves, but no more values than a figure shows.
        spacing = 1.0 / (2.0 * dt * min(max(self.lag, 1), MOST_FREQUENCIES))
        # A window shorter than the period covers several lines, so that its frequencies may lie anywhere.
        if self.period and self.lag > self.period:
            line = 1.0 / (self.period * dt)
            spacing = line / max(round(line / spacing), 1)
        # The Nyquist frequency itself counts, whatever rounding says.
        count = int(0.5 / dt / spacing + 1e-9)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            return sysid.spa(self.parts, lag=self.lag, frequencies=np.arange(1, count + 1) * spacing)

    @cached_property
    def repeated(self) -> PeriodSpectra | None:
        """Spectra by repetition of a record of one input and one output; None where its input does not repeat."""
        # Blocks of periods with several inputs hold one equation on each line, and as many unknowns as inputs.
        record = self.longest
        if not self.period or record.nu > 1 or record.ny > 1 or not record.complete:
            return None
        # The first, incomplete period is left out: the record may begin with a transient.
        first = len(record) % self.period
        return period_spectra(record[first:], self.period)
