"""Inputs that play one sequence at different times, whose paths a record hardly tells apart."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

ALIKE = 0.9  # correlation at the best lag from which two inputs play one sequence
TOLD_APART = 2.0  # turns of the phase between two copies over a doubling of the frequency that tell their paths apart


def least_frequency_told(experiments: Sequence[IOData]) -> float:
    """Lowest frequency, Hz, from which the paths of all inputs are told apart; 0 where no two play one sequence.

    The contributions of an input and of a copy of it, T seconds later, differ by a phase that turns once in 1 / T Hz.
    The error of a response changes within about an octave: over a narrower band than a turn, errors of both paths look
    alike. Records of different lags tell more than each alone; the longest lag counts.
    """
    nu, dt = experiments[0].nu, experiments[0].dt
    highest = 0.0
    for first, second in combinations(range(nu), 2):
        lags = [_lag_of_copy(experiment.u[:, first], experiment.u[:, second]) for experiment in experiments]
        if any(lag is None for lag in lags):
            # in one record the two are different signals
            continue
        longest = max(abs(lag) for lag in lags if lag is not None) * dt
        highest = max(highest, TOLD_APART / longest if longest > 0.0 else np.inf)
    return float(min(highest, 0.5 / dt))


def _lag_of_copy(first: FloatArray, second: FloatArray) -> int | None:
    """Samples by which a signal (N,) follows another one that is like it, the fewest; None of signals not alike."""
    x, y = first - first.mean(), second - second.mean()
    length = scipy.fft.next_fast_len(2 * len(x))
    products = scipy.fft.irfft(scipy.fft.rfft(y, length) * scipy.fft.rfft(x, length).conj(), length)
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    if size <= 0.0:
        return None
    # of copies with a shift, the overlap alone can be alike
    lags = np.concatenate((np.arange(len(x)), np.arange(-(length - len(x)), 0)))
    overlap = 1.0 - np.abs(lags) / len(x)
    correlation = np.abs(products) / size
    shifts = lags[(overlap >= 0.5) & (correlation >= ALIKE * overlap)]
    return int(shifts[np.argmin(np.abs(shifts))]) if len(shifts) else None
