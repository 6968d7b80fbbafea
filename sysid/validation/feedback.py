"""Test for feedback: does the output depend on inputs of the future?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import LeastSquares, solve, solve_blocks
from sysid.polynomial.regressors import lagged, output_lags
from sysid.records.arguments import confidence_level, truth_value, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.records.repetition import phase_labels
from sysid.records.trends import ROUNDING

ALIKE = 1e-3  # p-value of "no direct path" below which what a controller feeds back at once may look like one
EXACT = 1e-9  # size of what does not repeat of a signal, relative to all of it, that is rounding
BLOCK = 2**16  # rows of a regression that are copied at a time


@dataclass(frozen=True, eq=False, repr=False)
class FeedbackTest(Locked):
    """Significance of feedback from every output to every input.

    Attributes:
        p_values: Of the hypothesis that the input does not depend on past values of the output (ny, nu); NaN where the
            input follows from its own past, as a periodic one does, and 1 without noise: no test can tell then.
        level: Confidence level.
        output_names: One name per output.
        input_names: One name per input.
    """

    p_values: FloatArray
    level: float
    output_names: tuple[str, ...]
    input_names: tuple[str, ...]

    @property
    def feedback(self) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
        """Whether there is feedback at the level (ny, nu)."""
        return np.asarray(self.p_values < 1.0 - self.level)

    def __str__(self) -> str:
        """A line per pair."""
        overall = "yes" if self.feedback.any() else "none seen"
        lines = [f"Feedback at {100 * self.level:g} %: {overall}"]
        for (i, j), p in np.ndenumerate(self.p_values):
            seen = "feedback" if self.feedback[i, j] else "none seen"
            lines.append(f"  from {self.output_names[i]} to {self.input_names[j]}: {seen} (p = {p:.3g})")
        return "\n".join(lines)


def feedback(
    data: IOData | Sequence[IOData], *, lags: int = 20, direct: bool = True, level: float = 0.99
) -> FeedbackTest:
    """Test data for feedback from outputs to inputs; unlike MATLAB's `feedback` of models, it closes no loop.

    It tests whether the inputs depend on past outputs [Ljung1999, sec. 13.4; Sims1972]. Each output is regressed on its
    own past and on past and future inputs; without feedback, the next innovation of the disturbance has no part in any
    input, and no future input gets a coefficient. An F test of these, exact for a normal disturbance that `lags` past
    outputs make white. Means are removed first, and where the inputs repeat a sequence, all that repeats with it: the
    answer of a nonlinear system to the sequence is no feedback, although a linear model leaves it. Where nothing
    repeats, it looks like feedback if the input is smooth.

    Args:
        data: One experiment, or several.
        lags: Number of past outputs, past inputs and future inputs; more than the delay of the system.
        direct: Whether an output may depend on the input of the same instant; otherwise that counts as feedback.
        level: Confidence level, between 0 and 1.

    Returns:
        p-values and flags.

    Raises:
        SysidError: Constant input, lags or level out of range, missing outputs, too little data.
    """
    experiments = tuple(e.detrend() for e in as_experiments(data))
    first, lags, level = experiments[0], whole_number("lags", lags, 1), confidence_level(level)
    lowest = 0 if truth_value("direct", direct) else 1
    check_excitation(experiments, [0] * first.nu)
    # the last `lags` samples of a record have no future inputs, the first ones no past
    labels = phase_labels(experiments)
    usable = [pair for pair in zip(experiments, labels, strict=True) if len(pair[0]) > 2 * lags + pair[0].window]
    rows = sum(len(e) - max(lags, e.window) - lags for e, _ in usable)
    width = lags * (1 + 2 * first.nu) + first.nu
    # as many degrees of freedom as coefficients at least
    if rows < 2 * width:
        raise SysidError(
            f"too little data: {width} coefficients of lags = {lags} need {2 * width} rows, {len(experiments)} "
            f"experiment(s) have {rows}; pass smaller lags"
        )
    p_values = np.empty((first.ny, first.nu))
    for i, j in np.ndindex(p_values.shape):
        p_values[i, j] = _p_beside_repetition(usable, i, j, lags, lowest)
    return FeedbackTest(p_values, level, first.output_names or (), first.input_names or ())


Labelled = tuple[IOData, NDArray[np.int_]]
"""An experiment with the phase label of each of its samples."""


def _p_beside_repetition(experiments: Sequence[Labelled], i: int, j: int, lags: int, lowest: int) -> float:
    """`_feedback_p` of what does not repeat with the inputs, where that tells feedback from a direct path."""
    rows = sum(len(e) - max(lags, e.window) - lags for e, _ in experiments)
    test = _long_feedback_p if rows > BLOCK else _feedback_p
    p_value = test(experiments, i, j, lags, lowest)
    repeats = any(labels.any() for _, labels in experiments)
    if lowest > 0 or not repeats or p_value < ALIKE or not test(experiments, i, j, lags, 1) < ALIKE:
        return p_value
    # what a controller feeds back at once may be all that differs between the periods of the input, and looks like a
    # direct path: then the sequence, of which a disturbance knows nothing, has to tell
    return test([(e, np.zeros_like(labels)) for e, labels in experiments], i, j, lags, lowest)


def _feedback_p(experiments: Sequence[Labelled], i: int, j: int, lags: int, lowest: int) -> float:
    """p-value of the future inputs j in a regression of output i on its past and on all inputs.

    `lowest` is the first lag of input j at which the output may depend on it: from there on it is no future one.
    """
    future, past, target, phases = [], [], [], []
    for experiment, labels in experiments:
        start = max(lags, experiment.window)
        future.append(lagged(experiment.u[:, j], range(-lags, lowest), start, lags))
        blocks = [lagged(experiment.y[:, i], output_lags(lags), start, lags)]
        for k, u in enumerate(experiment.u.T):
            # only the tested input may be restricted: the output may depend on the others at once
            first_lag = lowest if k == j else 0
            blocks.append(lagged(u, range(first_lag, lags + 1), start, lags))
        past.append(np.hstack(blocks))
        target.append(experiment.y[start : len(experiment) - lags, i])
        phases.append(labels[start : len(experiment) - lags])
    columns = np.hstack((np.vstack(future), np.vstack(past)))
    return addition_p(columns, lags + lowest, np.concatenate(target), np.concatenate(phases))


def _long_feedback_p(experiments: Sequence[Labelled], i: int, j: int, lags: int, lowest: int) -> float:
    """`_feedback_p` of long records, in blocks of rows."""
    nu = experiments[0][0].nu
    spans = [(e, labels, max(lags, e.window), len(e) - lags) for e, labels in experiments]
    rows = sum(end - start for _, _, start, end in spans)
    # numbered without gaps: labels of samples outside the spans have no mean
    phases, numbers = np.unique(np.concatenate([k[start:end] for _, k, start, end in spans]), return_inverse=True)
    per_span = np.split(numbers, np.cumsum([end - start for _, _, start, end in spans])[:-1])
    members = np.bincount(numbers)
    # each regressor by its input, or None for the output, and its lag
    signals: list[tuple[int | None, int]] = [(j, lag) for lag in range(-lags, lowest)]
    signals += [(None, lag) for lag in range(1, lags + 1)]
    for k in range(nu):
        signals += [(k, lag) for lag in range(lowest if k == j else 0, lags + 1)]

    def column(experiment: IOData, k: int | None, lag: int, begin: int, end: int) -> FloatArray:
        signal = experiment.y[:, i] if k is None else experiment.u[:, k]
        return signal[begin - lag : end - lag]

    # the target is the output at lag zero
    signals.append((None, 0))
    means, repeats = np.empty((len(phases), len(signals))), np.empty(len(signals), dtype=bool)
    for n, (source, lag) in enumerate(signals):
        values = np.concatenate([column(e, source, lag, start, end) for e, _, start, end in spans])
        means[:, n] = np.bincount(numbers, values) / members
        repeats[n] = _is_rounding(values - means[numbers, n], values - values.mean())

    def blocks(first: int) -> Iterator[FloatArray]:
        for (e, _, start, end), of_span in zip(spans, per_span, strict=True):
            for begin in range(start, end, BLOCK):
                last = min(begin + BLOCK, end)
                values = np.column_stack([column(e, k, lag, begin, last) for k, lag in signals[first:]])
                values -= means[of_span[begin - start : last - start], first:]
                values[:, repeats[first:]] = 0.0
                yield values

    added, count = lags + lowest, len(signals) - 1
    total = sum(float(np.sum(block[:, -1] ** 2)) for block in blocks(count))
    full, nested = solve_blocks(partial(blocks, 0), count), solve_blocks(partial(blocks, added), count - added)
    return _p_of_addition(full, nested, total, rows, len(phases))


def feedback_p(experiments: Sequence[IOData], lags: int = 20, *, direct: bool = True) -> FloatArray:
    """p-values of feedback (ny, nu), see `feedback`; NaN where the data are too few to test."""
    try:
        return feedback(experiments, lags=lags, direct=direct).p_values
    except SysidError:
        return np.full((experiments[0].ny, experiments[0].nu), np.nan)


def interchanged(experiments: Sequence[IOData]) -> tuple[IOData, ...]:
    """The same records with outputs as inputs, and inputs as outputs."""
    return tuple(IOData(e.y, e.u, e.dt, window=e.window) for e in experiments)


def addition_p(columns: FloatArray, added: int, target: FloatArray, labels: NDArray[np.int_] | None = None) -> float:
    """p-value of the F test that the first `added` columns explain nothing that the others and a constant do not.

    NaN if they cannot. The means of the columns (rows, p) are subtracted in place.

    Args:
        columns: Regressors (rows, p).
        added: Number of those that are tested, the first ones.
        target: What they explain (rows,).
        labels: Rows of equal label (rows,) have a constant of their own; one for all without labels.
    """
    constants = 1
    if labels is None:
        y = (target - target.mean())[:, None]
        columns -= columns.mean(axis=0)
    else:
        y, constants = _less_label_means(target[:, None].copy(), labels)
        columns, _ = _less_label_means(columns, labels)
    total = float(y[:, 0] @ y[:, 0])
    full = _solution(columns, y)
    nested = _solution(columns[:, added:], y) if columns.shape[1] > added else None
    return _p_of_addition(full, nested, total, len(y), constants)


def _less_label_means(columns: FloatArray, labels: NDArray[np.int_]) -> tuple[FloatArray, int]:
    """Subtract from columns (rows, p), in place, their means over each label, and count the labels.

    What repeats in a column exactly becomes zero: the rounding that is left of it would explain whatever it is asked
    to.
    """
    present, numbers = np.unique(labels, return_inverse=True)
    members = np.bincount(numbers)
    for column in columns.T:
        about_mean = column - column.mean()
        column -= (np.bincount(numbers, column) / members)[numbers]
        if _is_rounding(column, about_mean):
            column[:] = 0.0
    return columns, len(present)


def _is_rounding(left: FloatArray, whole: FloatArray) -> bool:
    """Whether what is left of a signal without its repeating part is rounding."""
    return float(np.linalg.norm(left)) <= EXACT * float(np.linalg.norm(whole))


def _p_of_addition(full: LeastSquares, nested: LeastSquares | None, total: float, rows: int, constants: int) -> float:
    """p-value of `addition_p` from the solutions with all columns and with the others alone, if there are any."""
    # the constants take degrees of freedom too
    freedom = rows - full.rank - constants
    without, count = total, full.rank
    if nested is not None:
        # rounding can make it larger than with no columns at all
        without, count = min(float(nested.residual_gram[0, 0]), total), full.rank - nested.rank
    if count < 1 or freedom < 1:
        return float("nan")
    residual = float(full.residual_gram[0, 0])
    if nested is not None and without <= ROUNDING * total:
        # the others explain everything: what is left is rounding, and no test of it means anything
        return 1.0
    explained = max(without - residual, 0.0)
    ratio = explained / count * freedom / max(residual, np.finfo(float).tiny)
    return float(scipy.stats.f.sf(ratio, count, freedom))


def _solution(columns: FloatArray, y: FloatArray) -> LeastSquares:
    """Least squares; of long records without a further copy of all regressors."""
    if len(y) <= BLOCK:
        return solve(columns, y)

    def blocks() -> Iterator[FloatArray]:
        for k in range(0, len(y), BLOCK):
            yield np.hstack((columns[k : k + BLOCK], y[k : k + BLOCK]))

    return solve_blocks(blocks, columns.shape[1])
