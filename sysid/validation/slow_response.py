"""Whether simulation errors of a model follow its inputs slowly: a part of the response that the model lacks.

A lag of a few samples with a slow creep of a third of the gain looks, in a record of a few of its time constants, like
the lag alone beside a disturbance that walks. Coloured errors absorb the creep, whatever they are compared by.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.models.model_forms import AnyModel, as_model
from sysid.models.predict import aligned, predict
from sysid.polynomial.least_squares import solve
from sysid.polynomial.regressors import lagged, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

SHARES = (0.5, 1, 2, 4, 8, 16, 32)
"""Time constants that are tried, in parts of the longest record: up to two records."""

AS_GOOD = 4.0
"""Sum of squares, in variances, by which a time constant may explain less than the best and be as good."""

LAGS = 12
"""Past errors beside which the slow inputs must explain the present one: their colour."""

LEVEL = 0.01
"""p-value from which on the errors follow an input, by any of the time constants."""

LEVEL_OF_ONE = 0.05
"""The same of a lag as long as the record, tested alone: beside a disturbance that walks it is the last to show."""

LONGEST = 10_000
"""Samples of a record from which on neighbours are averaged: what is tested is slow."""


@dataclass(frozen=True)
class SlowResponse:
    """What the simulation errors of one path show.

    Attributes:
        output: Number of the output.
        input: Number of the input.
        p: p-value of the hypothesis that they do not follow it, over all time constants.
        gain: Gain at 0 Hz of the slow part, in output units per input unit, the largest of those that are as likely.
        time_constant: Time constant at which it fits best, s.
    """

    output: int
    input: int
    p: float
    gain: float
    time_constant: float


def slow_response(model: AnyModel, data: Sequence[IOData]) -> tuple[SlowResponse, ...]:
    """Parts of the response slower than the record resolves well, one for each path whose errors show one.

    Simulation errors e are regressed on `LAGS` past errors, a constant and a straight line of each record, and the last
    two values of the input behind a lag of unit gain: an F test of these, at the time constants of `SHARES`, its
    p-value times their number, by Bonferroni. Then a t test of one lag, as long as the longest record, whose response
    is filtered by the colour of the errors. Inputs up to the sample before explain the present error, so that feedback
    alone is no slow response.

    Args:
        model: The model, in any form that `predict` takes.
        data: Records of its fit, about its operating point.

    Returns:
        The paths, the most significant first; empty for an unstable model and too short records.
    """
    first = data[0]
    model = aligned(as_model(model, first), first)
    if not model.is_stable():
        return ()
    parts = [part for record in data for part in record.complete_parts() if len(part) > 4 * LAGS]
    if not parts:
        return ()
    width = max(-(-max(map(len, parts)) // LONGEST), 1)
    errors = [_averaged(part.y - predict(model, part, steps=None), width) for part in parts]
    inputs = [_averaged(part.u - part.u.mean(axis=0), width) for part in parts]
    if not all(np.isfinite(error).all() for error in errors):
        return ()
    found = []
    for i, j in np.ndindex(first.ny, first.nu):
        of_path = _tested([error[:, i] for error in errors], [u[:, j] for u in inputs])
        if of_path is not None:
            p, gain, constant = of_path
            found.append(SlowResponse(i, j, p, gain, constant * width * first.dt))
    return tuple(sorted(found, key=lambda one: one.p))


def _averaged(signals: FloatArray, width: int) -> FloatArray:
    """Signals (N, n) averaged over blocks of `width` samples (N // width, n)."""
    count = len(signals) // width
    return signals[: count * width].reshape(count, width, -1).mean(axis=1)


def _tested(errors: Sequence[FloatArray], inputs: Sequence[FloatArray]) -> tuple[float, float, float] | None:
    """p-value, gain at 0 Hz and time constant of a slow part; None where the errors do not show one."""
    longest = max(map(len, errors))
    count = sum(len(error) - LAGS for error in errors)
    common = scipy.linalg.block_diag(*(_line(len(error) - LAGS) for error in errors))
    past = np.concatenate([lagged(error, output_lags(LAGS), LAGS) for error in errors])
    target = np.concatenate([error[LAGS:] for error in errors])[:, None]
    free = count - past.shape[1] - common.shape[1] - 2
    if free < 2 * LAGS:
        return None
    basis, _ = np.linalg.qr(np.column_stack((past, common)))
    rest = target - basis @ (basis.T @ target)
    tried = []
    for share in SHARES:
        slow = np.concatenate([_slow(u, longest / share) for u in inputs])
        slow = slow - basis @ (basis.T @ slow)
        fitted = slow @ solve(slow, rest).solution
        explained, left = float(np.sum(fitted**2)), float(np.sum((rest - fitted) ** 2))
        if left > 0.0:
            tried.append((explained * free / left, longest / share))
    if not tried:
        return None
    best, constant = max(tried)
    p = min(len(SHARES) * float(scipy.stats.f.sf(0.5 * best, 2, free)), 1.0)
    beside = np.column_stack((past, common))
    if p >= LEVEL:
        p, gain = _one_lag(inputs, longest, beside, target)
        return (p, gain, float(longest)) if p < LEVEL_OF_ONE else None
    # of time constants that are as good the slowest has the largest gain
    as_good = [one for statistic, one in tried if statistic > best - AS_GOOD]
    gains = [_one_lag(inputs, one, beside, target)[1] for one in as_good]
    return p, max(gains, key=abs), constant


def _one_lag(
    inputs: Sequence[FloatArray], constant: float, beside: FloatArray, target: FloatArray
) -> tuple[float, float]:
    """p-value and gain of one lag beside past errors, constants and lines (rows, LAGS + 2 of each record)."""
    colour = np.concatenate(([1.0], -solve(beside, target).solution[:LAGS, 0]))
    slow = []
    for u in inputs:
        # the innovation is the error filtered by its colour, and so is what the input adds to it
        slow.append(scipy.signal.lfilter(colour, [1.0], _behind_lag(u, constant))[LAGS:])
    column = np.concatenate(slow)[:, None]
    column = column - beside @ solve(beside, column).solution
    rest = target - beside @ solve(beside, target).solution
    energy = float(np.sum(column**2))
    if not energy > 0.0:
        return 1.0, 0.0
    gain = float(np.sum(column * rest)) / energy
    free = len(target) - beside.shape[1] - 1
    variance = float(np.sum((rest - gain * column) ** 2)) / free
    if not variance > 0.0:
        return 1.0, 0.0
    return 2.0 * float(scipy.stats.t.sf(abs(gain) * np.sqrt(energy / variance), free)), gain


def _line(samples: int) -> FloatArray:
    """A constant and a straight line (N, 2)."""
    return np.column_stack((np.ones(samples), np.linspace(-1.0, 1.0, samples)))


def _slow(u: FloatArray, constant: float) -> FloatArray:
    """Input behind a lag of unit gain, of one and of two samples before, from `LAGS` on (N - LAGS, 2)."""
    response = _behind_lag(u, constant)
    return np.column_stack((response[LAGS:], response[LAGS - 1 : -1]))


def _behind_lag(u: FloatArray, constant: float) -> FloatArray:
    """Input behind a lag of unit gain and a delay of one sample (N,)."""
    pole = np.exp(-1.0 / constant)
    return np.asarray(scipy.signal.lfilter([0.0, 1.0 - pole], [1.0, -pole], u))
