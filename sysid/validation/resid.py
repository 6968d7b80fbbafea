"""Residual tests: are the prediction errors white, and independent of the input?"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from sysid.models.model_forms import AnyModel, as_model, check_no_data
from sysid.models.predict import aligned, channels_in, residuals
from sysid.models.recursion import kalman_filter
from sysid.models.state_space import StateSpace
from sysid.polynomial.correlation import autoregression, covariance_function
from sysid.polynomial.regressors import lagged
from sysid.records.arguments import confidence_level, whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.repetition import phase_labels
from sysid.records.trends import ROUNDING
from sysid.validation.compare import OWN_DATA, is_training
from sysid.validation.feedback import addition_p
from sysid.validation.own_line import line_left

NEGLIGIBLE = 1e-14  # residuals, relative to the outputs or to those of another output, that are rounding


def whiteness_p(correlations: FloatArray, counts: NDArray[np.int_]) -> FloatArray:
    """p-values of Q = N (N + 2) sum_k (r(k) - E r(k))^2 / (N - k), k = 1..h [LjungBox1978].

    Q has mean h and, on short records, a variance well above the 2 h of the chi-square distribution, which would reject
    white residuals of 250 samples twice as often as stated. The variance for Gaussian white noise follows from the
    traces of the quadratic forms r(k); Q is compared with the F distribution of that mean and variance.

    Args:
        correlations: r(k) at lags 1..h, one column per signal (h, m).
        counts: N and the numbers of products at lags 1..h (h + 1,).

    Returns:
        One p-value per signal (m,).
    """
    h, n = len(correlations), float(counts[0])
    k = n - counts[1:].astype(float)
    # removal of the mean gives correlations of about -1/N
    centred = correlations + ((n - k) / (n * (n - 1.0)))[:, None]
    statistic = n * (n + 2.0) * np.sum(centred**2 / (n - k)[:, None], axis=0)
    a, b = np.meshgrid(k, k)
    # E c(k)^2 c(l)^2 of the covariances of unit white noise; the power of c(0)^4 is that of a chi-square variable
    fourth = (n - a) * (n - b) + 12.0 * (n - a - b) + 4.0 * np.minimum(a, b)
    np.fill_diagonal(fourth, 3.0 * (n - k) ** 2 + 18.0 * n - 30.0 * k)
    fourth /= n * (n + 2.0) * (n + 4.0) * (n + 6.0)
    mean_square = (n * (n + 2.0)) ** 2 * float(np.sum(fourth / ((n - a) * (n - b))))
    variance = mean_square - h**2
    excess = variance / h - 2.0
    if excess <= 0.0:
        return np.asarray(scipy.stats.chi2.sf(statistic, h), dtype=np.float64)
    second = (2.0 * h - 4.0 + 4.0 * variance / h) / excess
    return np.asarray(scipy.stats.f.sf(statistic / h * second / (second - 2.0), h, second), dtype=np.float64)


def independence_p(
    e: Sequence[FloatArray],
    u: Sequence[FloatArray],
    lags: int,
    *,
    first: int = 0,
    future: bool = False,
    labels: Sequence[NDArray[np.int_]] | None = None,
) -> float:
    """p-value of "e does not depend on u(t - first), ..., u(t - lags)", or with `future` on later inputs beside those.

    Both are filtered by the whitener of e; then an F test of the regression of e on the lags of u, which is exact for
    white Gaussian e, however short the record and whatever the input. Directions without power are dropped.

    Args:
        e: Residuals per experiment (N_i,), zero mean.
        u: Input per experiment (N_i,), zero mean.
        lags: Largest lag, on both sides; less than half of the shortest experiment.
        first: First lag at which a model may depend on the input.
        future: Whether to test for feedback.
        labels: Phase labels of the samples per experiment (N_i,): what repeats with them is left out.
    """
    samples = sum(len(errors) for errors in e)
    order = max(1, min(lags, samples // 20, min(len(errors) for errors in e) // 8))
    whitener, _ = autoregression(np.concatenate(e), order)
    # the first samples of a filtered signal are those of a filter from rest
    start = order + lags
    ahead = lags if future else 0
    phases = labels or [np.zeros(len(errors), dtype=int) for errors in e]
    usable = [one for one in zip(e, u, phases, strict=True) if len(one[0]) > start + ahead]
    rows = sum(len(errors) - start - ahead for errors, _, _ in usable)
    # at least half of the samples must remain as degrees of freedom
    rows_per_lag = 4 if future else 2
    reach = min(lags, rows // rows_per_lag - 1)
    if reach < first:
        return float("nan")
    # lags below `first` come first among the columns: those are the tested ones of the future
    lowest = -reach if future else first
    tested = reach + first if future else reach + 1 - first
    regressors, target, rows_labels = [], [], []
    for errors, inputs, of_samples in usable:
        filtered = scipy.signal.lfilter(whitener, [1.0], inputs)
        white = scipy.signal.lfilter(whitener, [1.0], errors)
        regressors.append(lagged(filtered, range(lowest, reach + 1), start, ahead))
        target.append(white[start : len(white) - ahead])
        rows_labels.append(of_samples[start : len(white) - ahead])
    # no copy of the regressors of a single experiment
    columns = np.vstack(regressors) if len(regressors) > 1 else regressors[0]
    return addition_p(columns, tested, np.concatenate(target), np.concatenate(rows_labels) if labels else None)


BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, repr=False)
class ResidualTest(Locked):
    """Correlations of the residuals, with bounds and tests.

    Attributes:
        residuals: One-step prediction errors after the initialisation window (N, ny), experiments one after the
            other.
        lags: 0, 1, ..., (lags + 1,).
        autocorrelation: Normalised R_e (lags + 1, ny, ny).
        cross_lags: -lags, ..., lags (2 lags + 1,).
        cross_correlation: Normalised R_eu (2 lags + 1, ny, nu): e(t + tau) with u(t); correlation at tau > 0 means
            unmodelled dynamics, at tau < 0 feedback.
        level: Confidence level of bounds and tests.
        whiteness_bound: Bound on the autocorrelation at every lag but zero: 2.58/sqrt(N) at 99 %.
        independence_bound: Bound on the cross-correlation per pair (ny, nu), from the correlations of input and
            residual.
        whiteness_p: p-value per output (ny,) of N sum r(tau)^2, tau = 1..lags (Ljung and Box's form, with its exact
            variance).
        independence_p: p-value per pair (ny, nu) of the regression of the whitened residual on the input's lags
            first..lags; the first is 1 on a path without direct term (nk >= 1), otherwise 0.
        outside_whiteness: Number of lags 1..lags outside the bound, per output (ny,).
        outside_independence: Number of lags first..lags outside the bound, per pair (ny, nu).
        first_lags: First tested lag of the input, per pair (ny, nu).
        feedback_p: p-value per pair (ny, nu) of the lags -lags..first - 1 added to that regression: the test for
            feedback, or for a direct term that the model lacks.
        output_names: One name per output.
        input_names: One name per input.
        is_training: Whether the model was estimated from one of the records, or from its beginning: the tests are then
            conservative, since the parameters take degrees of freedom, and no validation.
    """

    residuals: FloatArray
    lags: NDArray[np.int_]
    autocorrelation: FloatArray
    cross_lags: NDArray[np.int_]
    cross_correlation: FloatArray
    level: float
    whiteness_bound: float
    independence_bound: FloatArray
    whiteness_p: FloatArray
    independence_p: FloatArray
    outside_whiteness: NDArray[np.int_]
    outside_independence: NDArray[np.int_]
    first_lags: NDArray[np.int_]
    feedback_p: FloatArray
    output_names: tuple[str, ...]
    input_names: tuple[str, ...]
    is_training: bool = False

    def __str__(self) -> str:
        """A line per output for whiteness, a line per pair for independence of past inputs."""
        verdict = "passed" if self.passed else "not passed"
        lines = [f"Residual tests at {100 * self.level:g} %: {verdict}"]
        if self.is_training:
            lines[0] += f" (on data of the fit: {OWN_DATA})"
        lines += [self._whiteness_line(i) for i in range(len(self.white))]
        lines += [self._independence_line(i, j) for i, j in np.ndindex(self.independent.shape)]
        for i, j in np.argwhere(self.feedback):
            p = self.feedback_p[i, j]
            lines.append(f"  {self.output_names[i]} to {self.input_names[j]}: feedback (p = {p:.3g})")
        return "\n".join(lines)

    def _whiteness_line(self, i: int) -> str:
        """Verdict on the whiteness of an output."""
        verdict = "white" if self.white[i] else "not white"
        return (
            f"  {self.output_names[i]}: {verdict} (p = {self.whiteness_p[i]:.3g} of all lags together; "
            f"{self.outside_whiteness[i]} of {self.lags[-1]} outside their own bound)"
        )

    def _independence_line(self, i: int, j: int) -> str:
        """Verdict on the independence of an output's residuals of an input."""
        verdict = "independent" if self.independent[i, j] else "not independent"
        tested = self.lags[-1] + 1 - self.first_lags[i, j]
        return (
            f"  {self.output_names[i]} and {self.input_names[j]}: {verdict} "
            f"(p = {self.independence_p[i, j]:.3g} of all lags together; {self.outside_independence[i, j]} of "
            f"{tested} outside their own bound)"
        )

    @property
    def white(self) -> BoolArray:
        """Whether whiteness is not rejected at the level, per output (ny,)."""
        return np.asarray(self.whiteness_p >= 1.0 - self.level)

    @property
    def independent(self) -> BoolArray:
        """Whether independence of past inputs is not rejected at the level, per pair (ny, nu)."""
        return np.asarray(self.independence_p >= 1.0 - self.level)

    @property
    def feedback(self) -> BoolArray:
        """Whether the residual shows in later inputs at the level, per pair (ny, nu); no part of `passed`."""
        return np.asarray(self.feedback_p < 1.0 - self.level)

    @property
    def passed(self) -> bool:
        """Whether every output is white and every pair independent."""
        return bool(self.white.all() and self.independent.all())


def resid(estimate: AnyModel, data: IOData | Sequence[IOData], *, lags: int = 25, level: float = 0.99) -> ResidualTest:
    """Test the one-step prediction errors of a model on data [Ljung1999, sec. 16.6; LjungBox1978].

    Under the null hypothesis r_e(tau) ~ N(0, 1/N), and r_eu(tau) is normal with variance sum_k r_e(k) r_u(k) / N
    [Ljung1999, sec. 16.6]. Means are removed first. On the data of the fit the tests are conservative, since the
    parameters take degrees of freedom. Missing residuals count as zero, and those after a gap by their variance.

    The residuals of an unstable predictor (A - K C has an eigenvalue beyond 1) grow without bound, whatever the data:
    they fail every test. Without K, the tests are of the simulation.

    Args:
        estimate: The estimate, or the model itself, in any form that `compare` takes.
        data: Inputs and outputs, of the fit or others; one experiment or several. Of a time series whiteness is tested.
        lags: Largest lag.
        level: Confidence level, between 0 and 1.

    Returns:
        Correlations, bounds, p-values and flags.

    Raises:
        SysidError: Channels that do not fit the model in number or name, lags or level out of range, residuals that are
            zero.

    Warns:
        SysidWarning: The model was identified beside a line in the output, and the data have one too.
    """
    level = confidence_level(level)
    check_no_data(estimate)
    experiments = as_experiments(data, missing=True, series=True)
    if left := line_left(estimate, experiments):
        warnings.warn(f"the model {left}", SysidWarning, stacklevel=2)
    first = experiments[0]
    model = as_model(estimate, first)
    errors = [residuals(estimate, experiment)[experiment.window :] for experiment in experiments]
    shortest, lags = min(len(of_experiment) for of_experiment in errors), whole_number("lags", lags, 1)
    if shortest < 4:
        raise SysidError(f"{shortest} residuals in the shortest record; expected 4 or more")
    if lags > (most := shortest // 2 - 1):
        needed = 2 * lags + 2
        raise SysidError(
            f"{lags} lags need {needed} residuals, the shortest record has {shortest}; expected lags from 1 to {most}"
        )
    signals = _signals(model, experiments, errors)
    auto = covariance_function(signals.e, signals.e, lags)[lags:] / (signals.e_size[:, None] * signals.e_size)
    cross = covariance_function(signals.e, signals.u, lags) / (signals.e_size[:, None] * signals.u_size)
    single = np.einsum("kii->ki", auto)[1:]
    counts = _known_products(experiments, lags)
    z = float(scipy.stats.norm.ppf(0.5 + 0.5 * level))
    whiteness_bound = z / np.sqrt(float(counts[0].min()))
    inputs, outputs = channels_in(model, first)
    first_lags = (model.D[np.ix_(outputs, inputs)] == 0.0).astype(int)
    labels = [of_samples[e.window :] for e, of_samples in zip(experiments, phase_labels(experiments), strict=True)]
    bound, p_cross, p_feedback = _pair_tests(signals, first_lags, lags, shortest, z, labels)
    outside = np.abs(cross[lags:]) > bound
    # a model without direct term claims nothing of lag 0
    outside[0] &= first_lags == 0
    return ResidualTest(
        residuals=np.concatenate(errors),
        lags=np.arange(lags + 1),
        autocorrelation=auto,
        cross_lags=np.arange(-lags, lags + 1),
        cross_correlation=cross,
        level=level,
        whiteness_bound=float(whiteness_bound),
        independence_bound=bound,
        whiteness_p=np.concatenate([whiteness_p(single[:, [i]], counts[:, i]) for i in range(first.ny)]),
        independence_p=p_cross,
        outside_whiteness=(np.abs(single) > whiteness_bound).sum(axis=0),
        outside_independence=outside.sum(axis=0),
        first_lags=first_lags,
        feedback_p=p_feedback,
        output_names=first.output_names or (),
        input_names=first.input_names or (),
        is_training=is_training(estimate, experiments),
    )


@dataclass(frozen=True, eq=False)
class _Signals:
    """Residuals and inputs after the windows, without means.

    Attributes:
        e: Residuals of each experiment over the largest of all, of equal variance (N_i, ny).
        u: Inputs of each experiment (N_i, nu).
        e_size: Root mean square of the residuals, over all experiments (ny,).
        u_size: Root mean square of the inputs (nu,).
    """

    e: list[FloatArray]
    u: list[FloatArray]
    e_size: FloatArray
    u_size: FloatArray


def _signals(model: StateSpace, experiments: Sequence[IOData], errors: Sequence[FloatArray]) -> _Signals:
    """Check residuals and inputs, and scale and centre them."""
    measured = np.concatenate([x.known[x.window :] for x in experiments])
    stacked = np.concatenate(errors)
    if not np.isfinite(stacked[measured]).all():
        raise SysidError("the residuals overflow, as those of an unstable predictor do (A - K C has poles beyond 1)")
    largest = float(np.abs(stacked[measured]).max(initial=0.0))
    if largest <= NEGLIGIBLE * max(np.nanmax(np.abs(x.y)) for x in experiments):
        raise SysidError("the residuals are zero: there is nothing to test")
    # residuals of an unstable predictor may overflow when squared
    e, u = [], []
    for experiment, of_experiment in zip(experiments, errors, strict=True):
        e.append(_weighted(model, experiment, of_experiment / largest))
        inputs = experiment.u[experiment.window :]
        u.append(inputs - inputs.mean(axis=0))
    e_size, u_size = _root_mean_square(e), _root_mean_square(u)
    if (e_size <= NEGLIGIBLE).any():
        raise SysidError(
            "the residuals of one output are negligible against those of another: there is nothing to test"
        )
    if (u_size <= ROUNDING * max(np.abs(x.u).max(initial=0.0) for x in experiments)).any():
        raise SysidError("an input is constant: independence of it cannot be tested")
    return _Signals(e, u, e_size, u_size)


def _root_mean_square(signals: Sequence[FloatArray]) -> FloatArray:
    """Root mean square over all experiments (n,)."""
    return np.asarray(np.sqrt(np.mean(np.concatenate(signals) ** 2, axis=0)))


def _known_products(experiments: Sequence[IOData], lags: int) -> NDArray[np.int_]:
    """Number of products of two known residuals at each lag, per output (lags + 1, ny)."""
    masks = [x.known[x.window :] for x in experiments]
    counts = []
    for k in range(lags + 1):
        counts.append(sum((mask[k:] & mask[: len(mask) - k]).sum(axis=0) for mask in masks))
    return np.array(counts)


def _pair_tests(
    signals: _Signals,
    first_lags: NDArray[np.int_],
    lags: int,
    shortest: int,
    z: float,
    labels: Sequence[NDArray[np.int_]],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bounds of the cross-correlations at z deviations, p-values of independence and of feedback, each (ny, nu)."""
    ny, nu = first_lags.shape
    n = sum(len(errors) for errors in signals.e)
    bound, p_cross, p_feedback = np.empty((ny, nu)), np.empty((ny, nu)), np.empty((ny, nu))
    for i in range(ny):
        e = [errors[:, i] for errors in signals.e]
        # correlations of a model decay smoothly; sample correlations would add noise to the variance
        _, r_e = autoregression(np.concatenate(e), lags)
        reach = min(len(r_e), shortest) - 1
        for j in range(nu):
            columns = [inputs[:, [j]] for inputs in signals.u]
            r_u = covariance_function(columns, columns, reach)[reach:, 0, 0] / signals.u_size[j] ** 2
            variance = r_u[0] * r_e[0] + 2.0 * float(r_u[1:] @ r_e[1 : reach + 1])
            # the exact sum is positive, as the integral of a spectrum; with sample correlations it may not be
            bound[i, j] = z * np.sqrt(max(variance, 1.0 / n) / n)
            u, first = [column[:, 0] for column in columns], int(first_lags[i, j])
            p_cross[i, j] = independence_p(e, u, int(lags), first=first)
            p_feedback[i, j] = independence_p(e, u, int(lags), first=first, future=True, labels=labels)
    return bound, p_cross, p_feedback


def _weighted(model: StateSpace, experiment: IOData, errors: FloatArray) -> FloatArray:
    """Errors of equal variance and zero mean after the window, zero where an output is missing."""
    if experiment.complete:
        return np.asarray(errors - errors.mean(axis=0))
    if model.order and model.gain.any():
        # after a gap the prediction has a larger variance
        _, weights = kalman_filter(aligned(model, experiment), experiment, np.zeros(model.order))
        errors = errors * (weights / weights.max(axis=0))[experiment.window :]
    return np.nan_to_num(errors - np.nanmean(errors, axis=0), nan=0.0)
