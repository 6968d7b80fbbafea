"""The 100-point file: one period of an excitation, as the excitation computer plays it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from scenarios.errors import ScenarioError

POINTS = 100
"""Points in one file; they hold one period [Morris1996, sec. II.2B]."""

RATE = 50.0
"""Rate of the position loop and of the record, Hz [Morris1996, sec. II.4]."""

WINDOW = POINTS / RATE
"""Length of one period at the default update rate, s."""


@dataclass(frozen=True)
class PowerSpectrum:
    """One-sided power spectral density of a periodic waveform.

    Attributes:
        frequency: Frequencies `(n,)`, Hz.
        density: Power spectral density `(n,)`, V^2/Hz.
    """

    frequency: np.ndarray
    density: np.ndarray


@dataclass(frozen=True, eq=False)
class Waveform:
    """One period of an excitation.

    Attributes:
        points: Samples of one period `(100,)`, V.
        kind: Name of the excitation, e.g. ``"prbs"``.
        parameters: What it was made from, by name (amplitude in V, frequencies in Hz, times in s).
        update_rate: Rate at which the converter steps through the points, Hz.
    """

    points: np.ndarray
    kind: str
    parameters: Mapping[str, float | int | bool] = field(default_factory=dict)
    update_rate: float = RATE

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.shape != (POINTS,) or not np.all(np.isfinite(points)):
            raise ScenarioError(f"a waveform file holds {POINTS} finite points; given an array of shape {points.shape}")
        if not self.update_rate > 0:
            raise ScenarioError(f"update rate must be above 0 Hz, given {self.update_rate}")
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    @property
    def period(self) -> float:
        """Length of one period, s."""
        return POINTS / self.update_rate

    def play(self, duration: float) -> np.ndarray:
        """Repeat the file for a time, holding each point until the next.

        Args:
            duration: Time to play, s.

        Returns:
            Volts at 50 Hz `(N, 1)` with `N = round(50 * duration)`.

        Raises:
            ScenarioError: The duration is not above zero.
        """
        count = round(RATE * duration) if np.isfinite(duration) else 0
        if count < 1:
            raise ScenarioError(f"duration must be at least one sample ({1 / RATE} s), given {duration} s")
        # The small shift keeps k * update_rate / RATE from rounding down onto the point before.
        index = np.floor(np.arange(count) * (self.update_rate / RATE) + 1e-9).astype(int) % POINTS
        return self.points[index][:, None]

    def order_of_excitation(self) -> int:
        """Count the lines of the two-sided spectrum that are not zero [Soderstrom1989, sec. 5.4].

        A sum of m sinusoids has order 2m; a file of 100 points at most 100.
        """
        power = np.abs(np.fft.fft(self.points)) ** 2
        return int(np.count_nonzero(power > 1e-20 * max(float(power.max()), np.finfo(float).tiny)))

    def psd(self) -> PowerSpectrum:
        """Power spectral density of one period, mean included; its integral is the mean square."""
        lines = np.fft.rfft(self.points) / POINTS
        power = np.abs(lines) ** 2
        power[1:-1] *= 2.0  # the mirror images; zero and the Nyquist frequency have none
        frequency = np.fft.rfftfreq(POINTS, 1.0 / self.update_rate)
        return PowerSpectrum(frequency, power * self.period)
