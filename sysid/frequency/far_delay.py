"""Whether a delay beyond those that are tested explains the output far better: a quick look at all of them.

Delays are tested up to a limit, since models at each of them cost time. A dead time beyond it hides in lags and initial
states: the answer looks like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.frequency.delay_profile import liveliest_stretch
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

FAR_BETTER = 20.0
"""-2 log likelihood by which a delay beyond the limit must be better."""

MOVED_BEFORE = 2.0
"""Ratio by which squares must fall for an input that was not held at its first value before the record.

A step test with a step at its first sample, too, fits a little better whatever its delay.
"""

BADLY = 0.1
"""Part of the output that inputs held before the record must leave."""

STEP = 0.5
"""Ratio of neighbouring time constants, octaves."""

SHARE = 3
"""Part of the shortest record up to which delays are looked at: one third."""

MARGIN = 5
"""Samples below the limit from which on a delay counts as one that the tests may not have reached."""

LONGEST = 10_000
"""Samples of each record that are looked at: those in which the input moves most."""

LAGS = 2
"""Equal lags of a model, at most: a chain of more of them looks like one with a delay."""


def far_delay(experiments: Sequence[IOData], tested: int) -> int | None:
    """The delay that explains the output best, if it lies beyond those tested and is far better than all of them.

    Models are a gain, one lag or two equal ones of several time constants, behind any delay, a constant in the output
    and one in the input before the record. A walk in the output would choose among them by chance, in the output
    itself; a white disturbance would in its differences: a delay must be far better by both.

    Args:
        experiments: Complete records with one input and one output.
        tested: Largest delay that is tested otherwise, samples.

    Returns:
        The delay in samples; None if those tested explain the output about as well.
    """
    longest = max(map(len, experiments))
    # a short part tells nothing of long delays, and must not hide them
    long_ones = [experiment for experiment in experiments if 2 * len(experiment) >= longest]
    stretches = [liveliest_stretch(experiment, LONGEST, margin=0) for experiment in long_ones]
    largest = min(map(len, stretches)) // SHARE
    first = max(tested - MARGIN, 0) + 1
    if largest <= first:
        return None
    of_levels = _Squares.of(stretches, largest, differences=False)
    of_differences = _Squares.of(stretches, largest, differences=True)
    moved = of_levels.needs_step_before()
    levels, differences = of_levels.costs(moved=moved), of_differences.costs(moved=moved)
    for costs in (levels, differences):
        if costs[:first].min() < costs[first:].min() + FAR_BETTER:
            return None
    return first + int(np.argmin((levels + differences)[first:]))


@dataclass(frozen=True, eq=False)
class _Squares:
    """Sums of squares that the best model behind each delay leaves of the outputs.

    Attributes:
        held: With inputs held at their first values before the record (largest + 1,).
        stepping: With inputs that had any other value before it, likewise.
        power: Of the outputs themselves.
        count: Number of samples.
    """

    held: FloatArray
    stepping: FloatArray
    power: float
    count: int

    @staticmethod
    def of(experiments: Sequence[IOData], largest: int, *, differences: bool) -> "_Squares":
        """Fit models with one lag, or two equal ones, behind every delay up to the largest; the best of each counts."""
        inputs, outputs = [], []
        for experiment in experiments:
            u, y = experiment.u[:, 0] - experiment.u[0, 0], experiment.y[:, 0]
            # the input before the record is another constant: at its first sample there is a step of any size
            moving = np.column_stack((u, np.ones(len(u))))
            inputs.append(np.diff(moving, axis=0, prepend=0.0) if differences else moving)
            outputs.append(np.diff(y, prepend=y[0]) if differences else y - y.mean())
        power = sum(float(y @ y) for y in outputs)
        least_held, least = np.full(largest + 1, power), np.full(largest + 1, power)
        octaves = np.log2(max(largest, 2))
        for constant in (0.0, *2.0 ** np.arange(0.0, np.ceil(octaves), STEP)):
            pole = np.exp(-1.0 / constant) if constant else 0.0
            responses = inputs
            for _ in range(LAGS if pole else 1):
                responses = [scipy.signal.lfilter([1.0 - pole], [1.0, -pole], x, axis=0) for x in responses]
                held, stepping = _unexplained(responses, outputs, largest, constant=not differences)
                least_held, least = np.minimum(least_held, held), np.minimum(least, stepping)
        return _Squares(least_held, least, power, sum(map(len, outputs)))

    def needs_step_before(self) -> bool:
        """Whether inputs held before the record explain the outputs badly, and others far better."""
        held, stepping = float(self.held.min()), float(self.stepping.min())
        return held > BADLY * self.power and held > MOVED_BEFORE * stepping

    def costs(self, *, moved: bool) -> FloatArray:
        """-2 log likelihood behind each delay, with a step before the record or without."""
        squares = self.stepping if moved else self.held
        # rounding of what is explained altogether
        floor = max(1e-20 * self.power, np.finfo(float).tiny)
        return np.asarray(self.count * np.log(np.maximum(squares, floor)))


def _unexplained(
    responses: Sequence[FloatArray], outputs: Sequence[FloatArray], largest: int, *, constant: bool
) -> tuple[FloatArray, FloatArray]:
    """Sums of squares that responses (N, 2), delayed by 0 to `largest` samples, leave of the outputs (N,).

    First multiples of the first response alone, then of both.
    """
    products, gram = np.zeros((largest + 1, 2)), np.zeros((largest + 1, 2, 2))
    for x, y in zip(responses, outputs, strict=True):
        n = len(x)
        # a response delayed by d loses its last d samples
        kept = n - 1 - np.arange(largest + 1)
        for i in range(2):
            correlation = scipy.signal.correlate(y, x[:, i], mode="full", method="fft")
            products[:, i] += correlation[n - 1 : n + largest]
            for j in range(2):
                gram[:, i, j] += np.cumsum(x[:, i] * x[:, j])[kept]
        if constant:
            # of each record its mean, which the outputs have lost already
            sums = np.cumsum(x, axis=0)[kept]
            gram -= sums[:, :, None] * sums[:, None, :] / n
    power = sum(float(y @ y) for y in outputs)
    left = []
    for used in (1, 2):
        inverse = np.linalg.pinv(gram[:, :used, :used], rcond=1e-12, hermitian=True)
        explained = np.einsum("di,dij,dj->d", products[:, :used], inverse, products[:, :used])
        left.append(np.maximum(power - explained, 0.0))
    return left[0], left[1]
