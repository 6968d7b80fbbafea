"""Test for feedback: does the output depend on inputs of the future?"""

from collections.abc import Sequence
from dataclasses import dataclass

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
        lines = [f"Feedback at {100 * self.level:g} %: {'yes' if self.feedback.any() else 'none seen'}"]
        for (i, j), p in np.ndenumerate(self.p_values):
            seen = "feedback" if self.feedback[i, j] else "none seen"
            lines.append(f"  from {self.output_names[i]} to {self.input_names[j]}: {seen} (p = {p:.3g})")
        return "\n".join(lines)


def feedback(
    data: IOData | Sequence[IOData], *, lags: int = 20, direct: bool = True, level: float = 0.99
) -> FeedbackTest:
    """Test whether the inputs depend on past outputs [Ljung1999, sec. 13.4; Sims1972].

    Each output is regressed on its own past and on past and future inputs; without feedback, the next innovation of the
    disturbance has no part in any input, and no future input gets a coefficient. An F test of these, exact for a normal
    disturbance that `lags` past outputs make white. What a linear model leaves of a nonlinear system looks like
    feedback too where the input is smooth. Means are removed first.

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
    usable = [(e, max(lags, e.window)) for e in experiments if len(e) > 2 * lags + e.window]
    rows, width = sum(len(e) - t - lags for e, t in usable), lags * (1 + 2 * first.nu) + first.nu
    if rows < 2 * width:
        raise SysidError(
            f"too little data: {width} coefficients of lags = {lags} need {2 * width} rows, {len(experiments)} "
            f"experiment(s) have {rows}; pass smaller lags"
        )
    p_values = np.empty((first.ny, first.nu))
    for i, j in np.ndindex(p_values.shape):
        future = [lagged(e.u[:, j], range(-lags, lowest), t, lags) for e, t in usable]
        past = []
        for e, t in usable:
            inputs = [lagged(u, range(lowest if k == j else 0, lags + 1), t, lags) for k, u in enumerate(e.u.T)]
            past.append(np.hstack((lagged(e.y[:, i], output_lags(lags), t, lags), *inputs)))
        target = np.concatenate([e.y[t : len(e) - lags, i] for e, t in usable])
        p_values[i, j] = addition_p(np.hstack((np.vstack(future), np.vstack(past))), future[0].shape[1], target)
    return FeedbackTest(p_values, level, first.output_names or (), first.input_names or ())


def feedback_p(experiments: Sequence[IOData], lags: int = 20) -> FloatArray:
    """p-values of feedback (ny, nu); NaN where the data are too few to test."""
    try:
        return feedback(experiments, lags=lags).p_values
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
    full = _solution(columns, y)
    rest = float(y[:, 0] @ y[:, 0])
    freedom, count = len(y) - full.rank - 1, full.rank
    if columns.shape[1] > added:
        nested = _solution(columns[:, added:], y)
        rest, count = min(float(nested.residual_gram[0, 0]), rest), full.rank - nested.rank
    if count < 1 or freedom < 1:
        return float("nan")
    residual = float(full.residual_gram[0, 0])
    if columns.shape[1] > added and rest <= ROUNDING * float(y[:, 0] @ y[:, 0]):
        return 1.0
    ratio = max(rest - residual, 0.0) / count * freedom / max(residual, np.finfo(float).tiny)
    return float(scipy.stats.f.sf(ratio, count, freedom))


def _solution(columns: FloatArray, y: FloatArray) -> LeastSquares:
    """Least squares; of long records without a further copy of all regressors."""
    if len(y) <= BLOCK:
        return solve(columns, y)
    starts = range(0, len(y), BLOCK)
    return solve_blocks(
        lambda: (np.hstack((columns[k : k + BLOCK], y[k : k + BLOCK])) for k in starts), columns.shape[1]
    )
