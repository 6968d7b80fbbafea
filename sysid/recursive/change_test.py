"""Detection of changes by the energy of the innovations, with a threshold for a wanted rate of false alarms."""

from collections import deque
from itertools import islice

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

FEWEST_WINDOWS = 4  # of the calibration: the scatter of fewer says nothing


class ChangeTest:
    """Test of the variance of white errors over a sliding window against that of the model's own stretch.

    For a window of m errors, log(mean e^2 / variance) is the log-likelihood ratio of another variance up to constants
    [BassevilleNikiforov1993, sec. 2.4; WillskyJones1976]. Friction makes errors bursty, so the distribution of the
    statistic is not taken from theory: its mean and deviation are those over the calibration. A smooth normal process
    crosses a level z standard deviations above its mean nu exp(-z^2 / 2) times a second, nu being the rate at which it
    crosses its mean upwards [Rice1945]; the level follows from the wanted rate. As mean and deviation come from n
    independent windows, the quantile is Student's with n - 1 degrees of freedom. Logarithms of energies have a lighter
    upper tail than the normal distribution, which makes the level cautious.
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
        energy = np.convolve(errors**2, np.full(window, 1.0 / window), mode="valid")
        statistics = np.log(energy / variance)
        self._window = window
        self._mean, self._deviation = float(statistics.mean()), float(statistics.std())
        self._windows = max(len(errors) / window, FEWEST_WINDOWS)
        above = statistics > self._mean
        crossings = max(int(np.sum(above[1:] & ~above[:-1])), 1)
        crossing_rate = crossings / (len(statistics) * dt)
        # Rice's formula for the level z; a rate of alarms near that of the crossings leaves no threshold
        z = np.sqrt(2.0 * np.log(max(crossing_rate / rate, 2.0)))
        self._quantile = float(scipy.stats.t.isf(scipy.stats.norm.sf(z), self._windows - 1.0))
        self.restart()

    def restart(self) -> None:
        """Forget the errors so far."""
        self._recent: deque[float] = deque(maxlen=2 * self._window)

    def threshold(self, samples: int, parameters: int) -> float:
        """Level of the statistic for a model of this many parameters that was fitted to so many samples."""
        # a short stretch knows its variance and its parameters less well
        scatter = np.sqrt(1.0 + 1.0 / self._windows + self._window / samples)
        excess_by_parameters = float(np.log1p(parameters / samples))
        return self._mean + excess_by_parameters + self._quantile * self._deviation * float(scatter)

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
