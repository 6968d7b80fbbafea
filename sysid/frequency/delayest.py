"""The delay of every input-output pair, by two methods with different weaknesses."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.polynomial.correlation import covariance_function, prewhitened
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import scaled_triangle
from sysid.polynomial.regressors import arx_regressors, first_row
from sysid.records.arguments import confidence_level, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.validation.feedback import feedback_p, interchanged

IntArray = NDArray[np.int_]
FEEDBACK = 1e-4  # p-value below which feedback is certain enough for a warning


@dataclass(frozen=True, eq=False, repr=False)
class DelayEstimate(Locked):
    """Delays nk in samples: the first lag of u that y depends on.

    Attributes:
        arx: By a scan of high-order ARX models (ny, nu); -1 if no lag up to the largest is significant.
        correlation: First significant lag of the correlation with the prewhitened input (ny, nu); -1 if there is none.
        p_values: Of the hypothesis that the ARX model does not need the lags 0..k-1, k = 1..largest + 1
            (largest + 1, ny, nu).
        correlations: Normalised correlations with the prewhitened input at lags 0..largest (largest + 1, ny, nu).
        bound: Significance bound on the correlations (ny, nu), corrected for the number of lags.
    """

    arx: IntArray
    correlation: IntArray
    p_values: FloatArray
    correlations: FloatArray
    bound: FloatArray


def delayest(
    data: IOData | Sequence[IOData],
    *,
    largest: int = 20,
    na: int = 10,
    nb: int = 10,
    whitening: int = 10,
    level: float = 0.99,
) -> DelayEstimate:
    """Estimate the delay of every pair of input and output [Ljung1999, secs. 16.5 and 6.1].

    The ARX method starts from a model with the lags 0..largest + nb - 1 of every input and drops the leading lags of
    one of them, one after the other, as long as N log(V/V0) stays below the chi-square quantile; it holds for any input
    of sufficient excitation. The correlation method whitens each input by an autoregressive model, filters the outputs
    alike and takes the first lag outside the bound; it needs no model, but uncorrelated inputs. Means are removed
    first.

    Args:
        data: One experiment, or several that share the delays.
        largest: Largest delay tested.
        na: Output lags of the ARX model.
        nb: Input lags beyond the largest delay.
        whitening: Order of the input's autoregressive model.
        level: Confidence level of both tests, between 0 and 1.

    Returns:
        Both estimates, with p-values and correlations.

    Raises:
        SysidError: Constant input, orders or level out of range, too little data.

    Warns:
        SysidWarning: Dependent inputs; feedback, beside which the correlation method means nothing, and the ARX method
            holds only if the feedback has a delay.
    """
    experiments = tuple(e.detrend() for e in as_experiments(data))
    nu, ny = experiments[0].nu, experiments[0].ny
    largest, na = whole_number("largest", largest, 0), whole_number("na", na, 0)
    nb, whitening = whole_number("nb", nb, 1), whole_number("whitening", whitening, 0)
    level = confidence_level(level)
    warn_each(check_excitation(experiments, [0] * nu))
    lags = (largest + nb,) * nu
    parts = [(e, first_row(na, lags, (0,) * nu, e.window)) for e in experiments]
    rows = sum(max(len(e) - s, 0) for e, s in parts)
    width = na + sum(lags)
    if rows <= width or any(len(e) <= s for e, s in parts):
        raise SysidError(
            f"too little data: {width} lags in the ARX model (na = {na}, largest = {largest}, nb = {nb}) "
            f"and {rows} usable samples in {len(experiments)} experiment(s)"
        )
    p_values = np.empty((largest + 1, ny, nu))
    by_arx = np.empty((ny, nu), dtype=int)
    for i in range(ny):
        phi = np.vstack([arx_regressors(e.y[:, i], e.u, na, lags, (0,) * nu, s) for e, s in parts])
        target = np.concatenate([e.y[s:, i] for e, s in parts])
        triangle, _ = scaled_triangle(np.column_stack((phi, target)))
        for j in range(nu):
            p_values[:, i, j] = _leading_lags(triangle, na + j * (largest + nb), largest + 1, rows - width)
            rejected = np.flatnonzero(p_values[:, i, j] < 1.0 - level)
            by_arx[i, j] = rejected[0] if len(rejected) else -1

    for i, j in np.argwhere(feedback_p(experiments, largest + nb) < FEEDBACK):
        names = (experiments[0].output_names or ())[i], (experiments[0].input_names or ())[j]
        text = f"input {names[1]} depends on past values of output {names[0]} (feedback): the delay by correlation"
        text += " means nothing, that by ARX holds only if the feedback has a delay"
        if nu == ny == 1 and feedback_p(interchanged(experiments), largest + nb)[0, 0] > 1.0 - level:
            text += f"; nothing shows that {names[1]} acts on {names[0]}: are input and output interchanged?"
        warnings.warn(text, SysidWarning, stacklevel=2)
    correlations, bound = np.empty((largest + 1, ny, nu)), np.empty((ny, nu))
    z = float(scipy.stats.norm.ppf(1.0 - 0.5 * (1.0 - level) / (largest + 1)))
    for j in range(nu):
        filtered = prewhitened(experiments, j, whitening)
        starts = [max(whitening, e.window) for e in experiments]
        u = [w[start:, [j]] for (w, _), start in zip(filtered, starts, strict=True)]
        y = [v[start:] for (_, v), start in zip(filtered, starts, strict=True)]
        n = sum(len(w) for w in u)
        # below the delay u is white and independent of y: the variance is 1/N whatever the output's colour
        sizes = np.sqrt(covariance_function(u, u, 0)[0, 0, 0] * np.diag(covariance_function(y, y, 0)[0]))
        correlations[:, :, j] = covariance_function(y, u, largest)[largest:, :, 0] / np.maximum(sizes, 1e-300)
        bound[:, j] = z / np.sqrt(n)
    outside = np.abs(correlations) > bound
    return DelayEstimate(
        arx=by_arx,
        correlation=np.where(outside.any(axis=0), outside.argmax(axis=0), -1),
        p_values=p_values,
        correlations=correlations,
        bound=bound,
    )


def _leading_lags(triangle: FloatArray, first: int, count: int, freedom: int) -> FloatArray:
    """p-values of dropping 1, 2, ..., `count` columns from `first` on (count,)."""
    others = [k for k in range(triangle.shape[1] - 1) if not first <= k < first + count]
    # columns in reverse order of removal come last: every nested fit is then a tail of the last column
    sequence = [*others, *range(first + count - 1, first - 1, -1), triangle.shape[1] - 1]
    tail = np.asarray(np.linalg.qr(triangle[:, sequence], mode="r"))[:, -1] ** 2
    full = tail[-1]
    added = np.cumsum(tail[-2 : -2 - count : -1])
    # log1p keeps small ratios exact; without noise the ratio of any significant lag is infinite
    with np.errstate(divide="ignore"):
        statistic = freedom * np.log1p(added / max(full, 1e-24 * float(np.sum(tail)), np.finfo(float).tiny))
    return np.asarray(scipy.stats.chi2.sf(statistic, np.arange(1, count + 1)), dtype=np.float64)
