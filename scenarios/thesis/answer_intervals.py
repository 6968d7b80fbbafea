"""Intervals of the gains that a study recovers, beside the best linear gain over other sequences of the same kind."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from scenarios.files.errors import ScenarioError
from sysid import Estimate, IOData, SysidWarning, model_error
from sysid.records.repetition import repetitions

HZ = 1.0
"""Frequency of the gains, Hz: the bandwidth that the thesis claims."""

SEQUENCES = 24
"""Other sequences over which the best linear gain is the mean."""

FIRST_SEED = 1001
"""Their first seed: none that a study plays."""


@dataclass(frozen=True)
class HeldGains:
    """How many 95 % intervals of models of a joint hold its best linear gain at `HZ`.

    Attributes:
        best_linear: The gain, the mean over `sequences`.
        sequences: Their number.
        models: Models with an interval.
        by_noise: Of these, those whose interval from noise alone holds it.
        with_error: Those whose interval with nonlinear distortion and too low an order does.
    """

    best_linear: float
    sequences: int
    models: int
    by_noise: int
    with_error: int


def held_gains(sequences: Sequence[IOData], models: Iterable[tuple[Estimate, IOData]]) -> HeldGains:
    """Count the intervals of models that hold the best linear gain.

    Args:
        sequences: Settled records of other sequences, without means.
        models: Models of a joint, each with the record of its fit.

    Raises:
        ScenarioError: A sequence that does not repeat within its record.
    """
    truth = best_linear_gain(sequences)
    count, by_noise, with_error = 0, 0, 0
    for estimate, record in models:
        # An unstable model is none that could be simulated, and has no interval.
        if not estimate.model.is_stable():
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)
            error = model_error(estimate, record, HZ)
        count += 1
        by_noise += _holds(error.noise_alone, truth)
        with_error += _holds(error.interval, truth)
    return HeldGains(truth, len(sequences), count, by_noise, with_error)


def _holds(interval: tuple[np.ndarray, np.ndarray], truth: float) -> bool:
    """Whether an interval of one gain holds the truth."""
    low, high = (end.item() for end in interval)
    return bool(low <= truth <= high)


def best_linear_gain(sequences: Sequence[IOData]) -> float:
    """Return the gain at `HZ` of the linear system nearest to records of several sequences.

    It is |E(Y conj U)| / E(|U|^2) over the mean periods of the sequences [Pintelon2012, sec. 3.4].

    Raises:
        ScenarioError: A sequence that does not repeat within its record, or has no line at that frequency.
    """
    cross, power = 0.0 + 0.0j, 0.0
    for record in sequences:
        found = repetitions([record])
        if not found:
            raise ScenarioError(f"{record.name}: a record of two periods of its command or more expected")
        (group,) = found
        line = HZ * group.period * record.dt
        if abs(line - round(line)) > 1e-9:
            raise ScenarioError(f"{record.name}: a period of whole seconds expected, got {group.period} samples")
        u, y = (np.fft.rfft(group.folded([signal]).mean(axis=0)[:, 0])[round(line)] for signal in (record.u, record.y))
        cross += y * np.conj(u)
        power += float(abs(u) ** 2)
    return float(abs(cross) / power)
