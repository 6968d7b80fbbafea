"""Reference time: a fixed least-squares problem on a record, a unit of processor time that compares across machines."""

from time import thread_time

import numpy as np

from sysid import IOData

LAGS = 10
"""Past samples of every input and output among the regressors."""

REPEATS = 3
"""Repetitions at each measurement: the shortest counts, since other processes only add to it."""


class Ruler:
    """Processor time of an ordinary least-squares problem on a record: each output from ten past samples of all.

    It is measured in the process that runs the estimators, before the first and after the last of them, under the same
    clock, caches and load.
    """

    def __init__(self, record: IOData) -> None:
        signals, rows = np.hstack((record.y, record.u)), len(record) - LAGS
        self._outputs = np.array(record.y[LAGS:])
        starts = range(LAGS - 1, -1, -1)
        self._regressors = np.hstack([signals[start : start + rows] for start in starts])
        self.seconds = float("inf")
        """The shortest time so far, s."""

    def measure(self) -> None:
        """Measure again; the shortest time so far counts."""
        for _ in range(REPEATS):
            begun = thread_time()
            np.linalg.lstsq(self._regressors, self._outputs, rcond=None)
            self.seconds = min(self.seconds, thread_time() - begun)
