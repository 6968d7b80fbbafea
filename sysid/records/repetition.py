"""Repetition of inputs: the sequence that a generator plays over and over, within a record or in several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

LEAST_SHARE = 0.5  # part of the input's power that repeats, at least: the rest is noise of wires and converters
SIGNIFICANT = 5.0  # standard deviations of the correlation between periods: one lag of a thousand is tested
EXACT = 1e-9  # power that does not repeat, relative to that of the input, of a sequence without any noise
AS_GOOD = 1.25  # power that does not repeat, over that of the best period, up to which a shorter period is preferred
CANDIDATES = 40  # lags with the highest correlation that are tried as periods
STILL = 1e-12  # deviation of an input, relative to its largest value, that is rounding
SHORTEST = 2  # samples of a period


@dataclass(frozen=True)
class Repetition:
    """A sequence of the inputs that is played several times.

    Attributes:
        period: Its length, samples.
        starts: First sample of every whole period that was played: experiment and row.
        share: Part of the inputs' power that repeats, 0 to 1; noise in the command does not.
    """

    period: int
    starts: tuple[tuple[int, int], ...]
    share: float

    @property
    def count(self) -> int:
        """Number of whole periods."""
        return len(self.starts)

    def folded(self, signals: Sequence[FloatArray]) -> FloatArray:
        """Cut signals of the experiments (N_i, n) into the periods (count, period, n)."""
        return np.array([signals[k][start : start + self.period] for k, start in self.starts])


def repetitions(experiments: Sequence[IOData]) -> tuple[Repetition, ...]:
    """Find the sequences that the inputs of records repeat; none where nothing repeats.

    A period is a lag at which inputs correlate with themselves, all of them together and over the whole record, by far
    more than signals as smooth as they are would by chance; the shortest of those that explain the inputs equally well.
    Records that play one sequence, from any phase of it on, share one `Repetition`. Initialisation windows are left
    out. Offsets of the inputs do not matter; noise, quantisation and the hold of a converter lower the share.
    """
    groups: list[Repetition] = []
    patterns: list[FloatArray] = []
    for k, experiment in enumerate(experiments):
        x = _standardised(experiment.u[experiment.window :])
        period, share = _period(x)
        if not period:
            continue
        # the last whole periods: a transient has died out by then
        first = len(x) - len(x) // period * period
        pattern = x[first:].reshape(-1, period, x.shape[1]).mean(axis=0)
        rows = experiment.window + np.arange(first, len(x), period)
        joined = False
        for g, group in enumerate(groups):
            shift = _common_phase(patterns[g], pattern)
            if shift is None:
                continue
            rows = rows + shift
            rows = rows[rows + period <= len(experiment)]
            starts = group.starts + tuple((k, int(row)) for row in rows)
            groups[g] = Repetition(period, starts, min(share, group.share))
            joined = True
            break
        if not joined:
            groups.append(Repetition(period, tuple((k, int(row)) for row in rows), share))
            patterns.append(pattern)
    alone = [k for k in range(len(experiments)) if not any(k == of for g in groups for of, _ in g.starts)]
    return (*groups, *_equal_records(experiments, alone))


def phase_labels(experiments: Sequence[IOData]) -> tuple[NDArray[np.int_], ...]:
    """Label of every sample of each experiment (N_i,): equal ones where the inputs play the same part of a sequence.

    A signal less its means over each label is what does not repeat with the inputs. Samples of experiments that repeat
    nothing all have the label 0.
    """
    labels = [np.zeros(len(experiment), dtype=int) for experiment in experiments]
    first_label = 1
    for group in repetitions(experiments):
        # the first whole period of an experiment tells the phase of all its samples
        first_rows: dict[int, int] = {}
        for k, row in group.starts:
            first_rows.setdefault(k, row)
        for k, row in first_rows.items():
            labels[k] = first_label + (np.arange(len(experiments[k])) - row) % group.period
        first_label += group.period
    return tuple(labels)


def _standardised(u: FloatArray) -> FloatArray:
    """Inputs (N, nu) without means, of unit power; constant ones are left out."""
    peaks = np.abs(u).max(axis=0, initial=0.0)
    # squares of very large or small values would leave the range of numbers
    x = u / np.where(peaks > 0.0, peaks, 1.0)
    x = x - x.mean(axis=0)
    size = np.sqrt(np.mean(x**2, axis=0))
    moves = size > STILL
    return np.asarray(x[:, moves] / size[moves])


def _period(x: FloatArray) -> tuple[int, float]:
    """Return the shortest period of signals (N, n) and the share of their power that repeats; 0, 0.0 without one."""
    n = len(x)
    if not x.size or n < 2 * SHORTEST + 2:
        return 0, 0.0
    correlation = _lag_correlations(x)
    lags = np.arange(1, len(correlation) - 1)
    # a local maximum, the ends of a plateau included
    is_peak = (correlation[1:-1] >= correlation[:-2]) & (correlation[1:-1] >= correlation[2:])
    peaks = lags[is_peak & (lags >= SHORTEST) & (correlation[1:-1] >= LEAST_SHARE)]
    if not len(peaks):
        return 0, 0.0
    strongest = peaks[np.argsort(-correlation[peaks], kind="stable")][:CANDIDATES]
    # shorter periods may be less alike than their multiples, as those of a hold that does not divide them
    earliest = peaks[:CANDIDATES]
    candidates = np.unique(np.concatenate((strongest, earliest)))
    remainders = np.array([unrepeated_share(x, int(period)) for period in candidates])
    good = candidates[remainders <= AS_GOOD * remainders.min() + EXACT]
    period = int(good[0])
    remainder = float(remainders[candidates == period][0])
    if remainder > 1.0 - LEAST_SHARE or not _is_significant(x, period, remainder):
        return 0, 0.0
    return period, 1.0 - remainder


def _lag_correlations(x: FloatArray) -> FloatArray:
    """Correlation of signals (N, n) with themselves at lags 0 to N / 2 + 1, all signals together."""
    n = len(x)
    size = scipy.fft.next_fast_len(2 * n, real=True)
    spectrum = np.abs(scipy.fft.rfft(x, size, axis=0)) ** 2
    # one lag beyond half of the record: whether a sequence that is played twice ends there shows beside its neighbours
    lags = np.arange(n // 2 + 2)
    products = scipy.fft.irfft(spectrum.sum(axis=1), size)[lags]
    power = np.concatenate(([0.0], np.cumsum(np.sum(x**2, axis=1))))
    early, late = power[n - lags], power[n] - power[lags]
    return np.asarray(products / np.sqrt(np.maximum(early * late, np.finfo(float).tiny)))


def unrepeated_share(x: FloatArray, period: int) -> float:
    """Power of signals (N, n) about the mean of their whole periods, over all their power; free of bias."""
    count = len(x) // period
    folded = x[len(x) - count * period :].reshape(count, period, -1)
    within = np.sum((folded - folded.mean(axis=0)) ** 2) / (count - 1)
    total = np.sum((folded - folded.mean(axis=(0, 1))) ** 2) / count
    return float(within / total) if total > 0.0 else 1.0


def _is_significant(x: FloatArray, period: int, remainder: float) -> bool:
    """Whether periods of signals (N, n) are more alike than smooth signals are by chance.

    The transform of their correlation by Fisher is about normal. The number of independent values in a period is that
    of the lines that carry its power.
    """
    if remainder <= EXACT:
        return True
    count = len(x) // period
    folded = x[len(x) - count * period :].reshape(count, period, -1)
    power = np.abs(scipy.fft.rfft(folded.mean(axis=0), axis=0)[1:]) ** 2
    values = 2.0 * float(power.sum()) ** 2 / float(np.sum(power**2))
    freedom = (count - 1) * values - 3.0
    return freedom > 0.0 and bool(np.arctanh(1.0 - remainder) * np.sqrt(freedom) > SIGNIFICANT)


def _common_phase(pattern: FloatArray, other: FloatArray) -> int | None:
    """Return how many samples after the start of the other period the pattern (period, n) begins; None if nowhere."""
    if pattern.shape != other.shape:
        return None
    products = scipy.fft.rfft(other, axis=0) * scipy.fft.rfft(pattern, axis=0).conj()
    correlation = scipy.fft.irfft(products.sum(axis=1), len(pattern))
    size = np.sqrt(np.sum(pattern**2) * np.sum(other**2))
    shift = int(np.argmax(correlation))
    # means over periods have less noise than single ones
    return shift if correlation[shift] > np.sqrt(LEAST_SHARE) * size else None


def _equal_records(experiments: Sequence[IOData], candidates: Sequence[int]) -> list[Repetition]:
    """Repetitions among whole records: one sequence that several of them play once, from its start."""
    groups: list[Repetition] = []
    signals: list[FloatArray] = []
    for k in candidates:
        experiment = experiments[k]
        x = _standardised(experiment.u[experiment.window :])
        start = (k, experiment.window)
        joined = False
        for g, group in enumerate(groups):
            share = _likeness(signals[g], x)
            if share > 0.0:
                groups[g] = Repetition(len(x), (*group.starts, start), min(share, group.share))
                joined = True
                break
        if not joined:
            groups.append(Repetition(len(x), (start,), 1.0))
            signals.append(x)
    return [group for group in groups if group.count > 1]


def _likeness(x: FloatArray, y: FloatArray) -> float:
    """Correlation of two sets of signals of unit power (N, n) that play one sequence; 0 if they do not."""
    if x.shape != y.shape or not x.size:
        return 0.0
    share = min(float(np.mean(x * y)), 1.0)
    if share < LEAST_SHARE or not _is_significant(np.vstack((x, y)), len(x), 1.0 - share):
        return 0.0
    return share
