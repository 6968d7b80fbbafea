"""Spectra of a record whose input repeats, compared period by period, and where an input has power."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.experiments.waveform import POINTS
from scenarios.files.errors import MissingRecordError, ScenarioError
from sysid import FrequencyResponse, IOData

TOLD = 0.2
"""A gain counts as reliable where its standard deviation is below this share of it."""

TOGETHER = 7
"""Most periods in a block. The noise of the wires moves the joint beyond the end of a block, so that short blocks show
gains too small and disturbances too large, by a share that falls with their length."""

FEWEST = 3
"""Fewest periods of a record whose disturbance is told from its response."""

BLOCKS = 6
"""Fewest blocks, where there are enough periods."""

SIDE_LOBES = 10 ** (-42.7 / 20)
"""Highest side lobe of the Hamming window over its peak: with less power than this, an estimate is leakage."""


@dataclass(frozen=True, eq=False)
class PeriodSpectra:
    """Two-sided densities on the lines of a periodic input, each the mean over half a spacing to either side.

    Attributes:
        frequencies: Lines (n,), Hz.
        input: Of the input (n,), unit^2/Hz.
        output: Of the output (n,), unit^2/Hz.
        disturbance: Of what in the output does not follow the input from one block to the next (n,), unit^2/Hz.
        cross: Between output and input (n,), unit^2/Hz, complex.
        repeating: Share of the input's power that is the same in every block (n,): near one on the lines of the
            waveform; elsewhere the input is noise of the wires, which excites too.
        degrees_of_freedom: Of the disturbance on a line, from the periods compared.
        dt: Sampling interval, s.
    """

    frequencies: np.ndarray
    input: np.ndarray
    output: np.ndarray
    disturbance: np.ndarray
    cross: np.ndarray
    repeating: np.ndarray
    periods: int
    degrees_of_freedom: int
    dt: float

    @property
    def disturbance_share(self) -> float:
        """Power of the disturbance over that of the output."""
        return float(self.disturbance.sum() / self.output.sum())

    def reliable_response(self) -> FrequencyResponse:
        """Response with its covariance on reliable lines: standard deviation of the gain below `TOLD` times the gain.

        A line that the waveform does not excite is included if the noise of the wires excites it enough.
        """
        # Without power beyond rounding the ratio is that of rounding errors.
        powered = np.flatnonzero(self.input > np.finfo(float).eps ** 2 * self.input.max(initial=0.0))
        response = self.cross[powered] / self.input[powered]
        # Of the real part, and of the imaginary part; the disturbance is smooth over half a spacing.
        variance = 0.5 * self.disturbance[powered] / (self.periods * self.input[powered])
        reliable = np.sqrt(2.0 * variance) < TOLD * np.abs(response)
        return FrequencyResponse(
            self.frequencies[powered][reliable],
            response[reliable, None, None],
            self.dt,
            "etfe",
            covariance=variance[reliable, None, None, None, None] * np.eye(2),
            degrees_of_freedom=self.degrees_of_freedom,
        )


def period_spectra(data: IOData, period: int = POINTS) -> PeriodSpectra:
    """Compare blocks of whole periods, in samples, of a settled record of one channel [Pintelon2012, sec. 2.5].

    The input is periodic but for its noise; raises `ScenarioError` for fewer than three periods.
    """
    if data.nu != 1 or data.ny != 1:
        raise ScenarioError(f"expected one input and one output, given {data.nu} and {data.ny}")
    periods = len(data) // period
    if periods < FEWEST:
        raise ScenarioError(f"expected at least {FEWEST} periods of {period} samples, given {len(data)} samples")
    # Odd, so that as many lines of a block lie to either side of a line of the waveform.
    together = max((odd for odd in range(1, TOGETHER + 1, 2) if periods // odd >= BLOCKS), default=1)
    count, length = periods // together, together * period
    u, y = (np.fft.rfft(channel[: count * length, 0].reshape(count, length)) for channel in (data.u, data.y))
    power, cross = np.mean(np.abs(u) ** 2, axis=0), np.mean(y * u.conj(), axis=0)
    # One response over all blocks; what departs from it in a block is disturbance.
    response = np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0)
    disturbance = np.sum(np.abs(y - response * u) ** 2, axis=0) / (count - 1)
    # Neither 0 Hz, where the mean has been removed, nor the Nyquist frequency, which has no imaginary part.
    lines = np.arange(1, period // 2)
    near = together * lines[:, None] + np.arange(-(together // 2), together // 2 + 1)
    scale = data.dt / length

    def density(power: np.ndarray) -> np.ndarray:
        """Mean around each line of the waveform."""
        return np.asarray(scale * power[near].mean(axis=1))

    input_density = density(power)
    # What is the same in every block stays in the mean over blocks; noise averages out of it.
    repeating_power = scale * np.abs(np.mean(u, axis=0)[together * lines]) ** 2 / together
    repeating = np.divide(repeating_power, input_density, out=np.zeros(len(lines)), where=input_density > 0.0)
    return PeriodSpectra(
        frequencies=lines / (period * data.dt),
        input=input_density,
        output=density(np.mean(np.abs(y) ** 2, axis=0)),
        disturbance=density(disturbance),
        cross=density(cross),
        periods=count * together,
        # Real and imaginary part on each line, less one response that all blocks share.
        degrees_of_freedom=2 * (count - 1) * together,
        repeating=repeating,
        dt=data.dt,
    )


def excited_lines(response: FrequencyResponse, input: int = 0) -> NDArray[np.bool_]:
    """Return whether an input has more power than the window leaks from its strongest line (nf,)."""
    if response.input_spectrum is None:
        raise MissingRecordError(f"the response by {response.method} has no input spectrum")
    # What leaks from the strongest line hides weaker ones.
    power = response.input_spectrum[:, input, input].real
    return np.asarray(power > SIDE_LOBES * power.max())
