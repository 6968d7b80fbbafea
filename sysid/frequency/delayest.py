"""The delay of every input-output pair, by two methods with different weaknesses."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.frequency.delay_profile import DelayProfile, delay_profile
from sysid.frequency.far_delay import far_delay
from sysid.models.repeated_errors import mean_period, repeated_errors
from sysid.polynomial.correlation import covariance_function, prewhitened
from sysid.polynomial.data_checks import check_excitation
from sysid.polynomial.least_squares import scaled_triangle, triangle_of_blocks
from sysid.polynomial.regressors import BLOCK, arx_regressors, equation_blocks, first_row
from sysid.records.arguments import confidence_level, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.records.repetition import repetitions
from sysid.validation.feedback import feedback_p, interchanged

IntArray = NDArray[np.int_]
INTERVAL = 0.95  # level of the intervals of delays
AMBIGUOUS = 3  # samples between the ends of an interval from which on a warning says what would tell
SPARE = 1.5  # samples of a period for each parameter of the ARX model that is fitted to it, at least
EXACT = 1e-20  # sum of squared errors of the ARX model, relative to that of the output, that is rounding
TINY = np.finfo(float).tiny
FEEDBACK = 1e-4  # p-value below which feedback is certain enough for a warning


@dataclass(frozen=True, eq=False, repr=False)
class DelayEstimate(Locked):
    """Delays nk in samples: the first lag of u that y depends on.

    Attributes:
        arx: By models (ny, nu), see `delayest`; -1 if no lag up to the largest is significant.
        correlation: First significant lag of the correlation with the prewhitened input (ny, nu); -1 if there is none.
        p_values: Of the hypothesis that the ARX model does not need the lags 0..k-1, k = 1..largest + 1
            (largest + 1, ny, nu).
        correlations: Normalised correlations with the prewhitened input at lags 0..largest (largest + 1, ny, nu).
        bound: Significance bound on the correlations (ny, nu), corrected for the number of lags.
        interval: Least and largest delay that the likelihood allows at 95 % (2, ny, nu), from models of low order at
            every delay; where these are not fitted, or the ARX model is far better, 0 and `arx`, the largest delay that
            the scan of ARX models does not reject; -1 where no lag is significant.
    """

    arx: IntArray
    correlation: IntArray
    p_values: FloatArray
    correlations: FloatArray
    bound: FloatArray
    interval: IntArray


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

    With one input, models B(q)/F(q) with 0 to 5 poles are fitted at every delay, beside white or autoregressive noise:
    the delay is that of least BIC, and `interval` is that of the likelihood, unless an ARX model shows that the system
    has more poles. Slow inputs make lag look like delay: a warning says so, with the experiment that would tell. With
    several inputs, feedback, little data or data without noise there is an ARX model with the lags 0..largest + nb - 1
    of every input, and the leading lags of one of them are dropped, one after the other, as long as N log(V/V0) stays
    below the chi-square quantile; it holds for any input of sufficient excitation.

    Errors that repeat with the input count once: where those of the ARX model do, both are fitted to the mean period.

    The correlation method whitens each input by an autoregressive model, filters the outputs alike and takes the first
    lag outside the bound; it needs no model, but uncorrelated inputs. Means are removed first.

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
        SysidWarning: A delay that cannot be told from a lag, or that is beyond the largest tested; dependent inputs;
            feedback, beside which the correlation method means nothing, and the ARX method holds only if the feedback
            has a delay.
    """
    experiments = tuple(e.detrend() for e in as_experiments(data))
    nu = experiments[0].nu
    largest, na = whole_number("largest", largest, 0), whole_number("na", na, 0)
    nb = whole_number("nb", nb, 1)
    level = confidence_level(level)
    warn_each(check_excitation(experiments, [0] * nu))
    # first: of few samples it says what is missing, where the limit of the whitening would name another option
    scan = _scan_by_arx(experiments, na, nb, largest)
    whitening = whole_number("whitening", whitening, 0, max(map(len, experiments)))
    feedback_messages = _feedback_messages(experiments, largest + nb, level)
    for message in feedback_messages:
        warnings.warn(message, SysidWarning, stacklevel=2)
    correlations, bound = whitened_correlations(experiments, whitening, largest, level)
    once = _periods_once(experiments, na, largest + nb)
    if once is not None:
        # what a nonlinear system answers to a sequence is the same in every period, and tells no more by repetition
        experiments, scan = once, _scan_by_arx(once, na, nb, largest)
    rejected = scan.p_values < 1.0 - level
    by_arx = _first_lags(rejected)
    intervals = np.stack((np.minimum(by_arx, 0), by_arx))
    if nu == 1 and not feedback_messages:
        # in a loop the noise reaches the input too, which these models take as independent of it
        by_arx, intervals, ambiguities = _by_profiles(experiments, largest, by_arx, scan)
        warn_each(_beyond(experiments, largest) or ambiguities)
    return DelayEstimate(
        arx=by_arx,
        interval=intervals,
        correlation=_first_lags(np.abs(correlations) > bound),
        p_values=scan.p_values,
        correlations=correlations,
        bound=bound,
    )


def _periods_once(experiments: Sequence[IOData], na: int, lags: int) -> tuple[IOData, ...] | None:
    """Mean periods of records whose inputs repeat, each after samples of the period before, as its past.

    None where nothing repeats, where the errors of an ARX model do not repeat with the inputs, and where a period is
    too short for the model.
    """
    groups = repetitions(experiments)
    played = {k for group in groups for k, _ in group.starts}
    parameters = na + lags * experiments[0].nu
    if not groups or len(played) < len(experiments) or any(group.period < SPARE * parameters for group in groups):
        return None
    found = repeated_errors(experiments, [_arx_errors(experiment, na, lags) for experiment in experiments])
    if found is None or not found.is_significant:
        return None
    past = max(na, lags)
    records = []
    for group in groups:
        u = mean_period(group, [e.u for e in experiments])
        y = mean_period(group, [e.y for e in experiments])
        rows = np.arange(-past, group.period) % group.period
        records.append(replace(experiments[0], u=u[rows], y=y[rows], window=past))
    return tuple(records)


def _arx_errors(experiment: IOData, na: int, lags: int) -> FloatArray:
    """Errors of an ARX model with all lags (N, ny), NaN where its regressors reach back beyond the record."""
    all_lags, no_delay = (lags,) * experiment.nu, (0,) * experiment.nu
    start = first_row(na, all_lags, no_delay, experiment.window)
    errors = np.full_like(experiment.y, np.nan)
    for i in range(experiment.ny):
        regressors = arx_regressors(experiment.y[:, i], experiment.u, na, all_lags, no_delay, start)
        target = experiment.y[start:, i]
        errors[start:, i] = target - regressors @ np.linalg.lstsq(regressors, target, rcond=None)[0]
    return errors


def _by_profiles(
    experiments: Sequence[IOData], largest: int, by_arx: IntArray, scan: "_ArxScan"
) -> tuple[IntArray, IntArray, list[str]]:
    """Delays (ny, 1), their intervals (2, ny, 1) and warnings, by models of low order where these can be fitted.

    Where the ARX model of the scan is far better than all of them, the system has more poles than they have: any of
    their delays would stand for the poles that they lack.
    """
    delays = by_arx.copy()
    intervals = np.stack((np.minimum(by_arx, 0), by_arx))
    messages: list[str] = []
    for i in range(experiments[0].ny):
        if scan.exact[i] and by_arx[i, 0] >= 0:
            # without noise every lag that counts is significant
            intervals[:, i, 0] = by_arx[i, 0]
            continue
        try:
            profile = delay_profile([e.select(outputs=[i]) for e in experiments], largest, INTERVAL)
        except SysidError:
            # too little data: the scan stands alone
            continue
        if by_arx[i, 0] >= 0 and scan.is_far_better(i, profile):
            continue
        delays[i, 0] = profile.delay
        intervals[:, i, 0] = profile.interval
        messages += _ambiguity(experiments, i, profile)
    return delays, intervals, messages


def _beyond(experiments: Sequence[IOData], largest: int) -> list[str]:
    """Warnings of delays of one input beyond the largest tested one, an output each; none where nothing shows any."""
    messages = []
    for i, name in enumerate(experiments[0].output_names or ()):
        far = far_delay([e.select(outputs=[i]) for e in experiments], largest)
        if far is not None and far > largest:
            messages.append(
                f"a delay of about {far} samples explains {name} far better than those up to largest = {largest}: a "
                "larger one would test it"
            )
    return messages


def _ambiguity(experiments: Sequence[IOData], i: int, profile: DelayProfile) -> list[str]:
    """Warning of a delay that cannot be told from a lag, with the experiment that would tell; none if it can."""
    (shortest, longest), (most, fewest) = profile.interval, profile.poles
    if longest - shortest < AMBIGUOUS:
        return []
    dt = experiments[0].dt
    of_output = ""
    if experiments[0].ny > 1:
        of_output = f" of output {(experiments[0].output_names or ())[i]}"
    return [
        f"the delay{of_output} is between {shortest} and {longest} samples ({shortest * dt:.4g} to {longest * dt:.4g} "
        f"s): lag and delay cannot be told apart, a shorter delay goes with more lag (models with up "
        f"to {most} poles fit at {shortest}, up to {fewest} at {longest} samples). An input that "
        f"changes within {longest - shortest} samples, or a longer record, would tell"
    ]


def _first_lags(significant: NDArray[np.bool_]) -> IntArray:
    """First significant lag of each pair (ny, nu), from a mask by lag; -1 if there is none."""
    return np.where(significant.any(axis=0), significant.argmax(axis=0), -1)


@dataclass(frozen=True, eq=False)
class _ArxScan:
    """What ARX models with the leading lags of one input left out tell of the delays.

    Attributes:
        p_values: Those of `DelayEstimate` (largest + 1, ny, nu).
        exact: Whether the model with all lags fits but for rounding (ny,).
        variances: Mean square of its errors (ny,).
        width: Number of its parameters.
    """

    p_values: FloatArray
    exact: NDArray[np.bool_]
    variances: FloatArray
    width: int

    def is_far_better(self, i: int, profile: DelayProfile) -> bool:
        """Whether BIC prefers its model of an output, with all its lags, to the best one of low order."""
        ratio = profile.variance / max(float(self.variances[i]), TINY)
        return profile.samples * np.log(max(ratio, TINY)) > self.width * np.log(profile.samples)


def _scan_by_arx(experiments: Sequence[IOData], na: int, nb: int, largest: int) -> _ArxScan:
    """Fit ARX models with all lags, and drop the leading ones of one input after the other."""
    nu, ny = experiments[0].nu, experiments[0].ny
    lags, no_delay = (largest + nb,) * nu, (0,) * nu
    starts = [first_row(na, lags, no_delay, e.window) for e in experiments]
    counts = [len(e) - start for e, start in zip(experiments, starts, strict=True)]
    rows = sum(max(count, 0) for count in counts)
    width = na + sum(lags)
    if rows <= width or min(counts) <= 0:
        raise SysidError(
            f"too little data: {max(rows, 0)} equations in {len(experiments)} experiment(s) for {width} lags of the "
            f"ARX model, which has delays up to largest = {largest} with na = {na} and nb = {nb}; expected longer "
            "experiments, or a smaller largest, na or nb"
        )
    p_values, variances = np.empty((largest + 1, ny, nu)), np.empty(ny)
    exact = np.zeros(ny, dtype=bool)
    for i in range(ny):
        if rows > BLOCK:
            y, u = [e.y[:, i] for e in experiments], [e.u for e in experiments]
            triangle, lengths, _ = triangle_of_blocks(partial(equation_blocks, y, u, na, lags, no_delay, starts))
        else:
            regressors, targets = [], []
            for e, start in zip(experiments, starts, strict=True):
                regressors.append(arx_regressors(e.y[:, i], e.u, na, lags, no_delay, start))
                targets.append(e.y[start:, i])
            triangle, lengths = scaled_triangle(np.column_stack((np.vstack(regressors), np.concatenate(targets))))
        exact[i] = triangle[-1, -1] ** 2 <= EXACT * np.sum(triangle[:, -1] ** 2)
        variances[i] = (triangle[-1, -1] * lengths[-1]) ** 2 / rows
        for j in range(nu):
            first_column = na + j * (largest + nb)
            p_values[:, i, j] = _leading_lags(triangle, first_column, largest + 1, rows - width)
    return _ArxScan(p_values, exact, variances, width)


def _feedback_messages(experiments: Sequence[IOData], lags: int, level: float) -> list[str]:
    """Warnings of feedback, and of input and output that seem interchanged."""
    nu, ny = experiments[0].nu, experiments[0].ny
    messages: list[str] = []
    for i, j in np.argwhere(feedback_p(experiments, lags) < FEEDBACK):
        output, input = (experiments[0].output_names or ())[i], (experiments[0].input_names or ())[j]
        message = (
            f"input {input} depends on past values of output {output} (feedback): the delay by correlation"
            " means nothing, that by ARX holds only if the feedback has a delay"
        )
        if nu == ny == 1 and feedback_p(interchanged(experiments), lags)[0, 0] > 1.0 - level:
            message += f"; nothing shows that {input} acts on {output}: are input and output interchanged?"
        messages.append(message)
    return messages


def whitened_correlations(
    experiments: Sequence[IOData], whitening: int, largest: int, level: float
) -> tuple[FloatArray, FloatArray]:
    """Normalised correlations with the prewhitened inputs (largest + 1, ny, nu), and their bound (ny, nu)."""
    nu, ny = experiments[0].nu, experiments[0].ny
    correlations, bound = np.empty((largest + 1, ny, nu)), np.empty((ny, nu))
    # Bonferroni's correction: the level is that of all lags together
    z = float(scipy.stats.norm.ppf(1.0 - 0.5 * (1.0 - level) / (largest + 1)))
    starts = [max(whitening, e.window) for e in experiments]
    for j in range(nu):
        u, y = [], []
        for (inputs, outputs), start in zip(prewhitened(experiments, j, whitening), starts, strict=True):
            u.append(inputs[start:, [j]])
            y.append(outputs[start:])
        n = sum(len(whitened) for whitened in u)
        # below the delay u is white and independent of y: the variance is 1/N whatever the output's colour
        powers = covariance_function(u, u, 0)[0, 0, 0] * np.diag(covariance_function(y, y, 0)[0])
        sizes = np.maximum(np.sqrt(powers), 1e-300)
        correlations[:, :, j] = covariance_function(y, u, largest)[largest:, :, 0] / sizes
        bound[:, j] = z / np.sqrt(n)
    return correlations, bound


def _leading_lags(triangle: FloatArray, first: int, count: int, freedom: int) -> FloatArray:
    """p-values of dropping 1, 2, ..., `count` columns from `first` on (count,)."""
    target = triangle.shape[1] - 1
    staying = [*range(first), *range(first + count, target)]
    # columns in reverse order of removal come last: every nested fit is then a tail of the last column
    sequence = [*staying, *range(first + count - 1, first - 1, -1), target]
    squares = np.asarray(np.linalg.qr(triangle[:, sequence], mode="r"))[:, -1] ** 2
    # without noise the residual is rounding, relative to the output
    residual = max(squares[-1], 1e-24 * float(np.sum(squares)), np.finfo(float).tiny)
    added = np.cumsum(squares[-2 : -2 - count : -1])
    # log1p keeps small ratios exact; without noise the ratio of any significant lag is infinite
    with np.errstate(divide="ignore"):
        statistic = freedom * np.log1p(added / residual)
    return np.asarray(scipy.stats.chi2.sf(statistic, np.arange(1, count + 1)), dtype=np.float64)
