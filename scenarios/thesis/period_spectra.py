"""Spectra of a record with a periodic input: on the lines, with the disturbance told apart by repetition."""

from dataclasses import dataclass

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.waveform import POINTS
from sysid import IOData


@dataclass(frozen=True)
class PeriodSpectra:
    """Two-sided densities on the lines of a periodic input.

    Attributes:
        frequencies: Lines (n,), Hz.
        input: Of the input (n,), unit^2/Hz.
        output: Of the output (n,), unit^2/Hz.
        disturbance: Of what in the output does not follow the input from one period to the next (n,), unit^2/Hz.
    """

    frequencies: np.ndarray
    input: np.ndarray
    output: np.ndarray
    disturbance: np.ndarray


def period_spectra(data: IOData, period: int = POINTS) -> PeriodSpectra:
    """Split a record into periods and compare them [Pintelon2012, sec. 2.5].

    Args:
        data: One input, one output, settled, the input periodic but for its noise.
        period: Samples in one period.

    Returns:
        Densities on the lines between zero and the Nyquist frequency.

    Raises:
        ScenarioError: Fewer than three periods.
    """
    count = len(data) // period
    if count < 3:
        raise ScenarioError(f"expected at least three periods of {period} samples, given {len(data)} samples")
    u, y = (np.fft.rfft(x[: count * period, 0].reshape(count, period))[:, 1 : period // 2] for x in (data.u, data.y))
    scale = data.dt / period
    # One response over all periods; what departs from it in a period is disturbance.
    response = np.sum(y * u.conj(), axis=0) / np.sum(np.abs(u) ** 2, axis=0)
    disturbance = np.sum(np.abs(y - response * u) ** 2, axis=0) / (count - 1)
    return PeriodSpectra(
        np.arange(1, period // 2) / (period * data.dt),
        scale * np.mean(np.abs(u) ** 2, axis=0),
        scale * np.mean(np.abs(y) ** 2, axis=0),
        scale * disturbance,
    )
