"""Test for feedback: does the output depend on inputs of the future?"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import LeastSquares, solve, solve_blocks
from sysid.polynomial.regressors import lagged, output_lags
from sysid.records.arguments import confidence_level, truth_value, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.records.trends import ROUNDING

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
    outputs make white. What a linear model leaves of a nonlinear system looks like feedback too where the input is
    smooth. Means are removed first.

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
    usable = [e for e in experiments if len(e) > 2 * lags + e.window]
    rows = sum(len(e) - max(lags, e.window) - lags for e in usable)
    width = lags * (1 + 2 * first.nu) + first.nu
    # as many degrees of freedom as coefficients at least
    if rows < 2 * width:
        raise SysidError(
            f"too little data: {width} coefficients of lags = {lags} need {2 * width} rows, {len(experiments)} "
            f"experiment(s) have {rows}; pass smaller lags"
        )
    p_values = np.empty((first.ny, first.nu))
    test = _long_feedback_p if rows > BLOCK else _feedback_p
    for i, j in np.ndindex(p_values.shape):
        p_values[i, j] = test(usable, i, j, lags, lowest)
    return FeedbackTest(p_values, level, first.output_names or (), first.input_names or ())


def _feedback_p(experiments: Sequence[IOData], i: int, j: int, lags: int, lowest: int) -> float:
    """p-value of the future inputs j in a regression of output i on its past and on all inputs.

    `lowest` is the first lag of input j at which the output may depend on it: from there on it is no future one.
    """
    future, past, target = [], [], []
    for experiment in experiments:
        start = max(lags, experiment.window)
        future.append(lagged(experiment.u[:, j], range(-lags, lowest), start, lags))
        blocks = [lagged(experiment.y[:, i], output_lags(lags), start, lags)]
        for k, u in enumerate(experiment.u.T):
            # only the tested input may be restricted: the output may depend on the others at once
            first_lag = lowest if k == j else 0
            blocks.append(lagged(u, range(first_lag, lags + 1), start, lags))
        past.append(np.hstack(blocks))
        target.append(experiment.y[start : len(experiment) - lags, i])
    columns = np.hstack((np.vstack(future), np.vstack(past)))
    return addition_p(columns, lags + lowest, np.concatenate(target))


def _long_feedback_p(experiments: Sequence[IOData], i: int, j: int, lags: int, lowest: int) -> float:
    """`_feedback_p` of long records, in blocks of rows."""
    nu = experiments[0].nu
    spans = [(e, max(lags, e.window), len(e) - lags) for e in experiments]
    rows = sum(end - start for _, start, end in spans)
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
    means = []
    for source, lag in signals:
        means.append(sum(float(column(e, source, lag, start, end).sum()) for e, start, end in spans) / rows)

    def blocks(first: int) -> Iterator[FloatArray]:
        for e, start, end in spans:
            for begin in range(start, end, BLOCK):
                last = min(begin + BLOCK, end)
                yield np.column_stack([column(e, k, lag, begin, last) for k, lag in signals[first:]]) - means[first:]

    added, count = lags + lowest, len(signals) - 1
    total = sum(float(np.sum(block[:, -1] ** 2)) for block in blocks(count))
    full, nested = solve_blocks(partial(blocks, 0), count), solve_blocks(partial(blocks, added), count - added)
    return _p_of_addition(full, nested, total, rows)


def feedback_p(experiments: Sequence[IOData], lags: int = 20, *, direct: bool = True) -> FloatArray:
    """p-values of feedback (ny, nu), see `feedback`; NaN where the data are too few to test."""
    try:
        return feedback(experiments, lags=lags, direct=direct).p_values
    except SysidError:
        return np.full((experiments[0].ny, experiments[0].nu), np.nan)


def interchanged(experiments: Sequence[IOData]) -> tuple[IOData, ...]:
    """The same records with outputs as inputs, and inputs as outputs."""
    return tuple(IOData(e.y, e.u, e.dt, window=e.window) for e in experiments)


def addition_p(columns: FloatArray, added: int, target: FloatArray) -> float:
    """p-value of the F test that the first `added` columns explain nothing that the others and a constant do not.

    NaN if they cannot. The means of the columns (rows, p) are subtracted in place.
    """
    y = (target - target.mean())[:, None]
    columns -= columns.mean(axis=0)
    total = float(y[:, 0] @ y[:, 0])
    full = _solution(columns, y)
    nested = _solution(columns[:, added:], y) if columns.shape[1] > added else None
    return _p_of_addition(full, nested, total, len(y))


def _p_of_addition(full: LeastSquares, nested: LeastSquares | None, total: float, rows: int) -> float:
    """p-value of `addition_p` from the solutions with all columns and with the others alone, if there are any."""
    # the constant takes a degree of freedom too
    freedom = rows - full.rank - 1
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
