"""Detection of changes by the energy of the innovations, with a threshold for a wanted rate of false alarms."""

from collections import deque
from dataclasses import dataclass
from itertools import islice

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

FEWEST_WINDOWS = 4  # of the calibration: the scatter of fewer says nothing


@dataclass(frozen=True)
class Scatter:
    """Scatter of the statistic over a stretch without a change.

    Attributes:
        mean: Of the statistic.
        deviation: Of the statistic.
        windows: Independent windows in the stretch.
        quantile: Deviations above the mean that give the wanted rate of false alarms.
    """

    mean: float
    deviation: float
    windows: float
    quantile: float

    def level(self, window_share: float) -> float:
        """Threshold of the statistic for a model of a stretch of which a window is this share."""
        # a short stretch knows its variance less well
        return self.mean + self.quantile * self.deviation * float(np.sqrt(1.0 + 1.0 / self.windows + window_share))


class ChangeTest:
    """Test of the variance of white errors over a sliding window against that of the model's own stretch.

    For a window of m errors, log(mean e^2 / variance) is the log-likelihood ratio of another variance up to constants
    [BassevilleNikiforov1993, sec. 2.4; WillskyJones1976]. Friction makes errors bursty, so the distribution of the
    statistic is not taken from theory: its mean and deviation are those over the calibration. A smooth normal process
    crosses a level z standard deviations above its mean nu exp(-z^2 / 2) times a second, nu being the rate at which it
    crosses its mean upwards [Rice1945]; the level follows from the wanted rate. As mean and deviation come from n
    independent windows, the quantile is Student's with n - 1 degrees of freedom. Logarithms of energies have a lighter
    upper tail than the normal distribution, which makes the level cautious.

    After a change the errors may be burstier than before: another payload, another friction. Then the threshold follows
    the scatter over the stretch since the change, and until that is as long as the calibration never falls below the
    one of the calibration.
    """

    def __init__(self, errors: FloatArray, variance: float, window: int, rate: float, dt: float) -> None:
        """Calibrate on errors (N,) without a change.

        Args:
            errors: Whitened errors.
            variance: Their variance.
            window: Length of the window in samples.
            rate: Wanted false alarms per second.
            dt: Sampling interval, s.
        """
        self._window, self._rate, self._dt = window, rate, dt
        self._calibration = len(errors)
        self._scatters: tuple[Scatter, ...] = (self._scatter(errors, variance),)
        self.restart()

    def _scatter(self, errors: FloatArray, variance: float) -> Scatter:
        """Scatter of the statistic over errors (N,) without a change."""
        energy = np.convolve(errors**2, np.full(self._window, 1.0 / self._window), mode="valid")
        statistics = np.log(energy / variance)
        mean, deviation = float(statistics.mean()), float(statistics.std())
        windows = max(len(errors) / self._window, FEWEST_WINDOWS)
        above = statistics > mean
        crossings = max(int(np.sum(above[1:] & ~above[:-1])), 1)
        crossing_rate = crossings / (len(statistics) * self._dt)
        # Rice's formula for the level z; a rate of alarms near that of the crossings leaves no threshold
        z = np.sqrt(2.0 * np.log(max(crossing_rate / self._rate, 2.0)))
        quantile = float(scipy.stats.t.isf(scipy.stats.norm.sf(z), windows - 1.0))
        return Scatter(mean, deviation, windows, quantile)

    def learn(self, errors: FloatArray, variance: float) -> None:
        """Take in the errors (N,) of a fit to the stretch since the last change, and their variance."""
        if len(errors) < FEWEST_WINDOWS * self._window:
            return
        with np.errstate(divide="ignore", invalid="ignore"):
            own = self._scatter(errors, variance)
        # an arm that stands still leaves windows without any energy, which tell no scatter
        if not np.isfinite(own.deviation):
            return
        self._scatters = (own,) if len(errors) >= self._calibration else (self._scatters[0], own)

    def restart(self) -> None:
        """Forget the errors so far."""
        self._recent: deque[float] = deque(maxlen=2 * self._window)

    def threshold(self, samples: int, parameters: int) -> float:
        """Level of the statistic for a model of this many parameters that was fitted to so many samples."""
        # a short stretch knows its parameters less well
        excess_by_parameters = float(np.log1p(parameters / samples))
        return excess_by_parameters + max(scatter.level(self._window / samples) for scatter in self._scatters)

    def update(self, error: float, variance: float) -> float:
        """Return the statistic after one more error; minus infinity while the window fills."""
        self._recent.append(error)
        if len(self._recent) < self._window:
            return -np.inf
        in_window = islice(self._recent, len(self._recent) - self._window, None)
        energy = sum(error * error for error in in_window)
        return float(np.log(energy / (self._window * variance)))

    def age(self, variance: float) -> int:
        """Samples since the most likely time of the change, within two windows [WillskyJones1976].

        If the variance changed n samples ago to the mean square of the errors since then, r times that before, the
        likelihood ratio is n (r - 1 - log r) / 2.
        """
        count = np.arange(1, len(self._recent) + 1)
        ratio = np.maximum(np.cumsum(np.array(self._recent)[::-1] ** 2) / (count * variance), 1.0)
        return int(np.argmax(count * (ratio - 1.0 - np.log(ratio))))
