"""Whether simulation errors of a model follow its inputs slowly: a part of the response that the model lacks.

A lag of a few samples with a slow creep of a third of the gain looks, in a record of a few of its time constants, like
the lag alone beside a disturbance that walks. Coloured errors absorb the creep, whatever they are compared by.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from sysid.models.frequency_response import NORMAL_95
from sysid.models.model_forms import AnyModel, as_model
from sysid.models.predict import aligned, predict
from sysid.polynomial.least_squares import solve
from sysid.polynomial.regressors import lagged, output_lags
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData, complete_parts

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
    """Test of one path for a slow part of the response: evidence, gain, and the gain that the errors could hide.

    Attributes:
        output: Number of the output.
        input: Number of the input.
        p: p-value of the hypothesis that they do not follow it, of the test that tells more.
        is_shown: Whether one of the tests rejects this hypothesis at its level.
        gain: Gain at 0 Hz of the slow part, in output units per input unit, the largest of those that are as likely.
        time_constant: Time constant at which it fits best, s.
        possible_gain: Gain of a lag as long as the longest record, the largest of its 95 % interval, as a modulus: up
            to this the errors hide one.
        longest: Length of the longest record, s.
    """

    output: int
    input: int
    p: float
    is_shown: bool
    gain: float
    time_constant: float
    possible_gain: float
    longest: float


def slow_response(model: AnyModel, data: Sequence[IOData]) -> tuple[SlowResponse, ...]:
    """Test each path for a part of the response that is slower than the record resolves well.

    Simulation errors e are regressed on `LAGS` past errors, a constant and a straight line of each record, and the last
    two values of the input behind a lag of unit gain: an F test of these, at the time constants of `SHARES`, its
    p-value times their number, by Bonferroni. Then a t test of one lag, as long as the longest record, whose response
    is filtered by the colour of the errors. Inputs up to the sample before explain the present error, so that feedback
    alone is no slow response.

    Args:
        model: The model, in any form that `predict` takes.
        data: Records of its fit, about its operating point.

    Returns:
        Every path, the most significant first; empty for an unstable model and too short records.
    """
    first = data[0]
    model = aligned(as_model(model, first), first)
    if not model.is_stable():
        return ()
    parts = [part for part in complete_parts(data) if len(part) > 4 * LAGS]
    if not parts:
        return ()
    width = max(-(-max(map(len, parts)) // LONGEST), 1)
    errors = [_averaged(part.y - predict(model, part, steps=None), width) for part in parts]
    inputs = [_averaged(part.u - part.u.mean(axis=0), width) for part in parts]
    if not all(np.isfinite(error).all() for error in errors):
        return ()
    tested = []
    for i, j in np.ndindex(first.ny, first.nu):
        of_path = _tested([error[:, i] for error in errors], [u[:, j] for u in inputs], width * first.dt)
        if of_path is not None:
            tested.append(replace(of_path, output=i, input=j))
    return tuple(sorted(tested, key=lambda one: one.p))


def _averaged(signals: FloatArray, width: int) -> FloatArray:
    """Signals (N, n) averaged over blocks of `width` samples (N // width, n)."""
    count = len(signals) // width
    return signals[: count * width].reshape(count, width, -1).mean(axis=1)


def _tested(errors: Sequence[FloatArray], inputs: Sequence[FloatArray], dt: float) -> SlowResponse | None:
    """What the errors (N,) of one output tell of a slow response to one input (N,); None of too few samples."""
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
    gain, deviation = _one_lag(inputs, longest, beside, target)
    result = SlowResponse(
        output=0,
        input=0,
        p=2.0 * float(scipy.stats.norm.sf(abs(gain) / deviation)) if deviation > 0.0 else 1.0,
        is_shown=False,
        gain=gain,
        time_constant=longest * dt,
        possible_gain=abs(gain) + NORMAL_95 * deviation,
        longest=longest * dt,
    )
    if p >= LEVEL:
        return replace(result, is_shown=result.p < LEVEL_OF_ONE)
    # of time constants that are as good the slowest has the largest gain
    as_good = [one for statistic, one in tried if statistic > best - AS_GOOD]
    gains = [_one_lag(inputs, one, beside, target)[0] for one in as_good]
    return replace(result, p=p, is_shown=True, gain=max(gains, key=abs), time_constant=constant * dt)


def _one_lag(
    inputs: Sequence[FloatArray], constant: float, beside: FloatArray, target: FloatArray
) -> tuple[float, float]:
    """Gain of one lag and its standard deviation, beside past errors, constants and lines (rows, LAGS + 2 a record)."""
    without = solve(beside, target).solution
    colour = np.concatenate(([1.0], -without[:LAGS, 0]))
    slow = []
    for u in inputs:
        # the innovation is the error filtered by its colour, and so is what the input adds to it
        slow.append(scipy.signal.lfilter(colour, [1.0], _behind_lag(u, constant))[LAGS:])
    column = np.concatenate(slow)[:, None]
    column = column - beside @ solve(beside, column).solution
    rest = target - beside @ without
    energy = float(np.sum(column**2))
    if not energy > 0.0:
        return 0.0, 0.0
    gain = float(np.sum(column * rest)) / energy
    free = len(target) - beside.shape[1] - 1
    variance = float(np.sum((rest - gain * column) ** 2)) / free
    return gain, float(np.sqrt(variance / energy))


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
