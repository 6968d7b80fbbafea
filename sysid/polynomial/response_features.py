"""Gain, delay and settling time of an estimated impulse response."""

from dataclasses import dataclass

import numpy as np

from sysid.models.estimate import Estimate
from sysid.records.errors import SysidError

SETTLED = 0.02
"""Distance of the step response from its final value, relative to that, within which it has settled."""

SIGNIFICANT = 3.3
"""Standard deviations of a coefficient from which on it differs from zero: one in a thousand by chance."""


@dataclass(frozen=True)
class ResponseFeatures:
    """What an impulse response from one input says.

    Attributes:
        gain: Sum of the response: the gain at 0 Hz.
        gain_deviation: Its standard deviation.
        delay: First lag, samples, of two in a row that differ from zero; None where none do.
        settling: Lag, samples, from which on the step response stays within 2 % of the gain; None where it settles
            at the last coefficient only.
    """

    gain: float
    gain_deviation: float
    delay: int | None
    settling: int | None


def response_features(estimate: Estimate) -> list[ResponseFeatures]:
    """Features of the response to every input of an estimate of `impulseest`.

    Raises:
        SysidError: The estimate is of another method.
    """
    if estimate.method != "impulseest":
        raise SysidError(f"expected an estimate of impulseest, got one of {estimate.method}")
    inputs = len(estimate.data.input_names)
    length = len(estimate.parameters) // inputs
    first_lags = np.broadcast_to(estimate.orders["nk"], inputs)
    features = []
    for j in range(inputs):
        rows = slice(j * length, (j + 1) * length)
        features.append(_features(estimate.parameters[rows], estimate.covariance[rows, rows], int(first_lags[j])))
    return features


def _features(response: np.ndarray, covariance: np.ndarray, first: int) -> ResponseFeatures:
    """Features of one response (n,) with its covariance (n, n), whose first lag is `first`."""
    gain = float(response.sum())
    differs = np.abs(response) > SIGNIFICANT * np.sqrt(np.diag(covariance))
    in_a_row = np.flatnonzero(differs[:-1] & differs[1:])
    delay = first + int(in_a_row[0]) if len(in_a_row) else None
    outside = np.flatnonzero(np.abs(np.cumsum(response) - gain) > SETTLED * abs(gain))
    last = int(outside[-1]) + 1 if len(outside) else 0
    settling = first + last if last < len(response) - 1 else None
    return ResponseFeatures(gain, float(np.sqrt(max(covariance.sum(), 0.0))), delay, settling)
