"""Whether a delay beyond those that are tested explains the output far better: a quick look at all of them.

Delays are tested up to a limit, since models at each of them cost time. A dead time beyond it hides in lags and initial
states: the answer looks like any other.
"""

from collections.abc import Sequence

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
    stretches = [liveliest_stretch(experiment, LONGEST, margin=0) for experiment in experiments]
    largest = min(map(len, stretches)) // SHARE
    first = max(tested - MARGIN, 0) + 1
    if largest <= first:
        return None
    of_levels = _costs(stretches, largest, differences=False)
    of_differences = _costs(stretches, largest, differences=True)
    for costs in (of_levels, of_differences):
        if costs[:first].min() < costs[first:].min() + FAR_BETTER:
            return None
    return first + int(np.argmin((of_levels + of_differences)[first:]))


def _costs(experiments: Sequence[IOData], largest: int, *, differences: bool) -> FloatArray:
    """-2 log likelihood of the best model behind each delay from 0 to the largest one (largest + 1,)."""
    inputs, outputs = [], []
    for experiment in experiments:
        u, y = experiment.u[:, 0] - experiment.u[0, 0], experiment.y[:, 0]
        # the input before the record is another constant: at its first sample there is a step of any size
        moving = np.column_stack((u, np.ones(len(u))))
        inputs.append(np.diff(moving, axis=0, prepend=0.0) if differences else moving)
        outputs.append(np.diff(y, prepend=y[0]) if differences else y - y.mean())
    count = sum(map(len, outputs))
    power = sum(float(y @ y) for y in outputs)
    # of inputs held at their first values before the record, and of any others
    least_held, least = np.full(largest + 1, power), np.full(largest + 1, power)
    slowest = np.log2(max(largest, 2))
    for constant in (0.0, *2.0 ** np.arange(np.ceil(slowest))):
        pole = np.exp(-1.0 / constant) if constant else 0.0
        responses = inputs
        for _ in range(LAGS if pole else 1):
            responses = [scipy.signal.lfilter([1.0 - pole], [1.0, -pole], x, axis=0) for x in responses]
            held, stepping = _unexplained(responses, outputs, largest, constant=not differences)
            least_held, least = np.minimum(least_held, held), np.minimum(least, stepping)
    # rounding of what is explained altogether
    floor = max(1e-20 * power, np.finfo(float).tiny)
    of_held, of_others = (count * np.log(np.maximum(squares, floor)) for squares in (least_held, least))
    return np.asarray(np.minimum(of_held, of_others + count * np.log(MOVED_BEFORE)))


def _unexplained(
    responses: Sequence[FloatArray], outputs: Sequence[FloatArray], largest: int, *, constant: bool
) -> tuple[FloatArray, FloatArray]:
    """Sums of squares of the outputs (N,) beside the responses (N, 2), delayed by 0 to `largest` samples.

    First beside multiples of the first response alone, then of both.
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
