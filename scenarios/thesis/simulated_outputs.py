"""Simulated outputs beside measured ones: their peaks and their zero crossings."""

import numpy as np

import sysid
from sysid import IOData, StateSpace

PEAKS = 0.1
"""Share of the samples, those farthest from zero, that count as peaks of a record."""


def simulated(model: StateSpace, record: IOData) -> np.ndarray:
    """Return the simulated output (N,) of a model of one input and one output."""
    return np.asarray(sysid.predict(model, record, steps=None)[:, 0])


def peak_share(measured: np.ndarray, model_output: np.ndarray) -> float:
    """Return simulated over measured output (N,) at the measured peaks: below one where a model misses them."""
    # Not local maxima: noise of reading makes one of every few samples.
    peaks = np.abs(measured) >= np.quantile(np.abs(measured), 1.0 - PEAKS)
    # With the side on which the measurement is: a model on the other side does not reach the peak.
    sides = np.sign(measured[peaks])
    return float(np.sum(sides * model_output[peaks]) / np.sum(sides * measured[peaks]))


def crossing_distance(measured: np.ndarray, model_output: np.ndarray) -> float:
    """Return the median distance, samples, from a zero crossing of one signal to the nearest of the other.

    Infinite where either never crosses zero.
    """
    crossings, of_model = zero_crossings(measured), zero_crossings(model_output)
    if not len(crossings) or not len(of_model):
        return float("inf")
    after = np.searchsorted(of_model, crossings).clip(1, len(of_model) - 1) if len(of_model) > 1 else 0
    before = np.maximum(np.asarray(after) - 1, 0)
    # The nearest of the model's crossings is the last before or the first after.
    distances = np.minimum(np.abs(crossings - of_model[after]), np.abs(crossings - of_model[before]))
    # A median: where the signal only grazes zero, a crossing of one has none of the other near it.
    return float(np.median(distances))


def zero_crossings(signal: np.ndarray) -> np.ndarray:
    """Return the times, samples, at which a signal (N,) changes its sign, interpolated."""
    # A sample at zero belongs to the side that follows: it is one crossing, not two.
    positive = signal >= 0.0
    before = np.flatnonzero(positive[1:] != positive[:-1])
    return np.asarray(before + signal[before] / (signal[before] - signal[before + 1]))


def unchanged_fit(record: IOData) -> float:
    """Return the fit, percent, of predicting that the output stays as it was a sample before."""
    (fit,) = sysid.validation.fit_percent(record.y[1:], record.y[:-1])
    return float(fit)
