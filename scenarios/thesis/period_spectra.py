"""Spectra of a record with a periodic input: on the lines, with the disturbance told apart by repetition."""

from dataclasses import dataclass

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.waveform import POINTS
from sysid import FrequencyResponse, IOData

TOLD = 0.2
"""A gain counts as told where its standard deviation is below this share of it."""


@dataclass(frozen=True, eq=False)
class PeriodSpectra:
    """Two-sided densities on the lines of a periodic input.

    Attributes:
        frequencies: Lines (n,), Hz.
        input: Of the input (n,), unit^2/Hz.
        output: Of the output (n,), unit^2/Hz.
        disturbance: Of what in the output does not follow the input from one period to the next (n,), unit^2/Hz.
        cross: Between output and input (n,), unit^2/Hz, complex.
        repeating: Share of the input's power that is the same in every period (n,): one on the lines of the waveform;
            elsewhere the input is noise of the wires, which excites too.
        periods: Periods compared.
        dt: Sampling interval, s.
    """

    frequencies: np.ndarray
    input: np.ndarray
    output: np.ndarray
    disturbance: np.ndarray
    cross: np.ndarray
    repeating: np.ndarray
    periods: int
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
        # Of the real part, and of the imaginary part.
        variance[kept] = 0.5 * self.disturbance[kept] / (self.periods * self.input[kept])
        kept &= np.sqrt(2.0 * variance) < TOLD * np.abs(response)
        covariance = variance[kept, None, None, None, None] * np.eye(2)
        return FrequencyResponse(
            self.frequencies[kept], response[kept, None, None], self.dt, "etfe", covariance=covariance
        )


def period_spectra(data: IOData, period: int = POINTS) -> PeriodSpectra:
    """Split a record into periods and compare them [Pintelon2012, sec. 2.5].

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
    count = len(data) // period
    if count < 3:
        raise ScenarioError(f"expected at least three periods of {period} samples, given {len(data)} samples")
    u, y = (np.fft.rfft(x[: count * period, 0].reshape(count, period))[:, 1 : period // 2] for x in (data.u, data.y))
    scale = data.dt / period
    power, cross = np.mean(np.abs(u) ** 2, axis=0), np.mean(y * u.conj(), axis=0)
    excited = power > 0.0
    # One response over all periods; what departs from it in a period is disturbance.
    response = np.divide(cross, power, out=np.zeros_like(cross), where=excited)
    disturbance = np.sum(np.abs(y - response * u) ** 2, axis=0) / (count - 1)
    repeating = np.divide(np.abs(np.mean(u, axis=0)) ** 2, power, out=np.zeros_like(power), where=excited)
    return PeriodSpectra(
        frequencies=np.arange(1, period // 2) / (period * data.dt),
        input=scale * power,
        output=scale * np.mean(np.abs(y) ** 2, axis=0),
        disturbance=scale * disturbance,
        cross=scale * cross,
        repeating=repeating,
        periods=count,
        dt=data.dt,
    )
