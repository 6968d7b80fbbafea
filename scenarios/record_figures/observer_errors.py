"""Prediction and smoothing errors of observers over their number of Markov parameters [Morris1996, sec. V.2B]."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import sysid
from sysid import IOData, SysidError, SysidWarning
from sysid.records.data import as_experiments

NUMBERS = (1, 2, 3, 4, 5, 6, 8, 10)
"""Numbers of observer Markov parameters whose prediction errors are compared."""

FEWEST_ROWS = 2
"""Windows of a record for each sample in them, at least: fewer leave the errors of a fit to chance."""


@dataclass(frozen=True)
class ObserverError:
    """Standard deviations of an observer's errors, relative to that of the output.

    Attributes:
        p: Observer Markov parameters.
        prediction: Of the prediction from p samples before.
        smoothing: Of the estimate from p samples before and p after.
    """

    p: int
    prediction: float
    smoothing: float


def observer_errors(
    data: IOData | Sequence[IOData], numbers: tuple[int, ...] = NUMBERS, *, output: int = 0
) -> tuple[ObserverError, ...]:
    """Prediction and smoothing errors of observers, in parts of the output's standard deviation, a row for each number.

    The thesis does not say what its smoothing error is; it is read as that of the best linear estimate of a sample from
    p samples of all inputs and outputs on both sides of it, and of the other channels in between.

    Args:
        data: One record, or several without means; missing outputs are left out.
        numbers: Numbers p; those for which the records are too short have no row.
        output: Number of the output.
    """
    records = as_experiments(data, missing=True)
    known = np.concatenate([record.y[:, output] for record in records])
    spread = float(np.nanstd(known))
    errors = []
    for p in numbers:
        # One regression has 2p + 1 samples of every channel: with fewer rows it fits the noise.
        windows = _windows(records, p)
        if len(windows) < FEWEST_ROWS * windows.shape[1]:
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", SysidWarning)
                # The error is that of the observer: the order of the realisation does not enter it.
                variance = sysid.okid(data, 1, p=p).noise_variance[output, output]
        # Too short, or the input excites too few lags: the other numbers may do.
        except SysidError:
            continue
        smoothing = _smoothing_error(windows, p, records[0].nu + output)
        errors.append(ObserverError(p, float(np.sqrt(variance)) / spread, smoothing / spread))
    return tuple(errors)


def _windows(records: Sequence[IOData], p: int) -> NDArray[np.float64]:
    """Samples of every channel from p before to p after a sample, channel by channel; windows without gaps alone."""
    length = 2 * p + 1
    windows = []
    for record in records:
        if len(record) >= length:
            channels = np.hstack((record.u, record.y))
            of_record = np.lib.stride_tricks.sliding_window_view(channels, length, axis=0)
            windows.append(of_record.reshape(len(of_record), -1))
    if not windows:
        return np.empty((0, (records[0].nu + records[0].ny) * length))
    rows = np.concatenate(windows)
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])


def _smoothing_error(windows: NDArray[np.float64], p: int, channel: int) -> float:
    """Standard deviation of the best linear estimate's error of the middle sample of a channel, in its unit."""
    middle = channel * (2 * p + 1) + p
    # The measurement that is estimated must not help.
    columns, target = np.delete(windows, middle, axis=1), windows[:, middle]
    return float(np.std(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]))
