"""Spectra of a record with a periodic input: on the lines, with the disturbance separated by repetition."""

from dataclasses import dataclass

import numpy as np

from scenarios.experiments.waveform import POINTS
from scenarios.files.errors import ScenarioError
from sysid import FrequencyResponse, IOData

TOLD = 0.2
"""A gain counts as known where its standard deviation is below this share of it."""

TOGETHER = 7
"""Most periods in a block. The noise of the wires moves the joint beyond the end of a block, so that short blocks show
gains too small and disturbances too large, by a share that falls with their length."""

BLOCKS = 6
"""Fewest blocks, where there are enough periods."""


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
        periods: Periods compared.
        degrees_of_freedom: Of the disturbance on a line.
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

    def told(self) -> FrequencyResponse:
        """Response with its covariance where the gain is known to a fifth.

        A line that the waveform does not excite is told too if the noise of the wires does.
        """
        kept = self.input > np.finfo(float).eps ** 2 * self.input.max(initial=0.0)
        response = np.zeros(len(self.input), dtype=complex)
        response[kept] = self.cross[kept] / self.input[kept]
        variance = np.zeros(len(self.input))
        # Of the real part, and of the imaginary part; the disturbance is smooth over half a spacing.
        variance[kept] = 0.5 * self.disturbance[kept] / (self.periods * self.input[kept])
        kept &= np.sqrt(2.0 * variance) < TOLD * np.abs(response)
        covariance = variance[kept, None, None, None, None] * np.eye(2)
        return FrequencyResponse(
            self.frequencies[kept],
            response[kept, None, None],
            self.dt,
            "etfe",
            covariance=covariance,
            degrees_of_freedom=self.degrees_of_freedom,
        )


def period_spectra(data: IOData, period: int = POINTS) -> PeriodSpectra:
    """Split a record into blocks of whole periods and compare them [Pintelon2012, sec. 2.5].

    Args:
        data: One input, one output, settled, the input periodic but for its noise.
        period: Samples in one period.

    Returns:
        Densities on the lines between zero and the Nyquist frequency.

    Raises:
        ScenarioError: Fewer than three periods, or several channels.
    """
    if data.nu != 1 or data.ny != 1:
        raise ScenarioError(f"expected one input and one output, given {data.nu} and {data.ny}")
    periods = len(data) // period
    if periods < 3:
        raise ScenarioError(f"expected at least three periods of {period} samples, given {len(data)} samples")
    # Odd, so that as many lines of a block lie to either side of a line of the waveform.
    together = max((k for k in range(1, TOGETHER + 1, 2) if periods // k >= BLOCKS), default=1)
    count, length = periods // together, together * period
    u, y = (np.fft.rfft(x[: count * length, 0].reshape(count, length)) for x in (data.u, data.y))
    power, cross = np.mean(np.abs(u) ** 2, axis=0), np.mean(y * u.conj(), axis=0)
    # One response over all blocks; what departs from it in a block is disturbance.
    response = np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0)
    disturbance = np.sum(np.abs(y - response * u) ** 2, axis=0) / (count - 1)
    lines = np.arange(1, period // 2)
    near = together * lines[:, None] + np.arange(-(together // 2), together // 2 + 1)
    scale = data.dt / length
    entered, left = scale * power[near].mean(axis=1), scale * np.mean(np.abs(y) ** 2, axis=0)[near].mean(axis=1)
    noise = scale * disturbance[near].mean(axis=1)
    same = scale * np.abs(np.mean(u, axis=0)[together * lines]) ** 2 / together
    return PeriodSpectra(
        frequencies=lines / (period * data.dt),
        input=entered,
        output=left,
        disturbance=noise,
        cross=scale * cross[near].mean(axis=1),
        periods=count * together,
        degrees_of_freedom=2 * (count - 1) * together,
        repeating=np.divide(same, entered, out=np.zeros(len(lines)), where=entered > 0.0),
        dt=data.dt,
    )
