"""Covariance of estimates from records whose input repeats: errors that repeat with it count once.

A nonlinearity answers the same sequence in the same way, period after period, and a model of too low an order misses
the same part of it each time. Formulas for errors that are independent of the input take every period for another
experiment, and their intervals are too narrow by up to the root of the number of periods.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import scipy

from sysid.models.delta_method import STEP, standard_directions
from sysid.models.estimate import Estimate
from sysid.models.frequency_response import NORMAL_95
from sysid.models.predict import residuals
from sysid.models.state_space import StateSpace
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidWarning
from sysid.records.repetition import Repetition, repetitions

AnyEstimate = TypeVar("AnyEstimate", bound=Estimate)

LEVEL = 0.01  # p-value of "the errors do not repeat" below which they count once
FEWEST_LINES = 4  # of a period whose power is averaged: fewer leave the covariance unknown
LINES_OF_SPECTRUM = 8  # samples of a period for each line that may be averaged
UPPER_95 = 0.975  # probability at the upper end of a 95 % interval
LARGEST_COLUMN = 200_000  # errors up to which products of their derivatives are formed
STEPS = (STEP, 1e-3 * STEP, 1e-6 * STEP)  # in standard deviations, the first whose errors stay within bounds
FARTHEST = 10.0  # of a parameter, beside its size and one, that a step may move it: delays so far off fill the memory
LARGEST_SLOPE = 1e6  # standard deviations of an error for one of a parameter, beyond which the predictor is unstable
SINGULAR = 1e-12  # variance of a combination of outputs, relative to the largest, that is rounding


@dataclass(frozen=True)
class RepeatedErrors:
    """Prediction errors that repeat with the sequence of the input.

    Attributes:
        groups: The sequences and where they are played.
        share: Part of the errors' power that repeats, 0 to 1.
        p_value: Of the hypothesis that nothing of them repeats.
    """

    groups: tuple[Repetition, ...]
    share: float
    p_value: float

    @property
    def is_significant(self) -> bool:
        """Whether errors repeat more than chance makes them, so that they count once."""
        return self.p_value < LEVEL

    @property
    def diagnostics(self) -> dict[str, float | int]:
        """Entries of an estimate's diagnostics."""
        return {
            "sequences": len(self.groups),
            "periods": sum(group.count for group in self.groups),
            "period": self.groups[0].period,
            "repeated_share": self.share,
        }


def repeated_errors(experiments: Sequence[IOData], errors: Sequence[FloatArray]) -> RepeatedErrors | None:
    """Test whether prediction errors of each experiment (N_i, ny) repeat with the input; None where the input does not.

    Errors that are NaN are left out.

    The variance of the means over the periods, times their number, is that of the errors within them if the periods
    are independent, whatever the colour of the errors: an F test, with as many degrees of freedom as the spectrum of
    the errors has independent values [Satterthwaite1946].
    """
    groups = repetitions(experiments)
    return _errors_of_groups(groups, errors) if groups else None


def _errors_of_groups(groups: tuple[Repetition, ...], errors: Sequence[FloatArray]) -> RepeatedErrors | None:
    """`repeated_errors` of sequences that are known; None of errors that are all zero, or hardly known."""
    between, within = 0.0, 0.0
    freedom_between, freedom_within = 0.0, 0.0
    largest = max(float(np.nanmax(np.abs(e), initial=0.0)) for e in errors)
    if not 0.0 < largest < np.inf:
        # no errors at all, or none that could be compared
        return None
    for group in groups:
        folded = group.folded([e / largest for e in errors])
        known = np.isfinite(folded)
        folded = np.where(known, folded, 0.0)
        counts = known.sum(axis=0)
        mean = folded.sum(axis=0) / np.maximum(counts, 1)
        deviations = np.where(known, folded - mean, 0.0)
        values = _independent_values(deviations)
        between += float(np.sum(counts * mean**2)) / group.period * values
        within += float(np.sum(deviations**2)) / group.period * values
        # where outputs are missing, fewer values than samples of the period are known, and fewer deviations from them
        freedom_between += float(np.mean(counts > 0)) * values
        freedom_within += float(np.mean(np.maximum(counts - 1, 0))) * values
    if not (freedom_between > 0.0 and freedom_within > 0.0):
        return None
    of_mean, of_noise = between / freedom_between, within / freedom_within
    if of_mean <= 0.0:
        return None
    p_value = 0.0
    if of_noise > 0.0:
        p_value = float(scipy.stats.f.sf(of_mean / of_noise, freedom_between, freedom_within))
    # the noise of the mean over the periods is that of one, divided by their number
    periods = sum(group.count for group in groups) / len(groups)
    repeating = max(of_mean - of_noise, 0.0) / periods
    return RepeatedErrors(groups, repeating / (repeating + of_noise), p_value)


def _independent_values(deviations: FloatArray) -> float:
    """Number of independent values in a period of coloured errors, from deviations of periods (count, period, ny)."""
    count, period, ny = deviations.shape
    power = np.mean(np.abs(scipy.fft.rfft(deviations, axis=1)) ** 2, axis=0)
    squares = float(np.sum(power**2))
    if squares <= 0.0:
        return float(period * ny)
    # a mean over few periods scatters, which adds to the sum of the squares
    unbiased = squares * (count - 1) / count
    return min(2.0 * float(power.sum()) ** 2 / unbiased, float(period * ny))


def sum_over_periods(group: Repetition, slopes: FloatArray, errors: FloatArray) -> FloatArray:
    """Covariance (q, q) of the sum over all periods of slopes times errors that are the same in each of them.

    Two estimates, each of which sees what the other misses, the larger one in every direction. Over lines: the sum is
    that of Psi_k^H E_k, of lines that are taken as independent with the power that each of them shows [White1982]; a
    model of too low an order leaves power there that its sum does not show. In time: see `_spectrum_at_zero`; a
    nonlinearity makes large errors where the slopes are large, which lines do not show. What is the same in all periods
    adds up with their number, not with its root.

    Args:
        group: The sequence.
        slopes: Derivatives of the errors in the mean period (period, ny, q).
        errors: The errors there (period, ny).
    """
    over_lines = (
        np.einsum("kiq,ki->kq", scipy.fft.fft(slopes, axis=0).conj(), scipy.fft.fft(errors, axis=0)) / group.period
    )
    of_lines = (over_lines.conj().T @ over_lines).real
    in_time = _spectrum_at_zero(np.einsum("tiq,ti->tq", slopes, errors))
    return group.count**2 * _larger(of_lines, in_time)


def _spectrum_at_zero(terms: FloatArray) -> FloatArray:
    """Covariance (q, q) of the sum over a period of a stationary signal (period, q): its spectrum at 0 Hz.

    The mean of the periodogram over the lowest lines, as many as a first-order autoregression with the correlation of
    the signal has nearly the same power at [BrockwellDavis2002, sec. 4.2]. Intervals have Student's distribution with
    two degrees of freedom a line, for which the covariance is enlarged.
    """
    period, q = terms.shape
    energy = float(np.sum(terms**2))
    if energy <= 0.0:
        return np.zeros((q, q))
    correlation = float(np.sum(terms * np.roll(terms, 1, axis=0))) / energy
    flat = period * (1.0 - correlation) / (2.0 * np.pi)
    most = max(period // LINES_OF_SPECTRUM, 1)
    lines = int(np.clip(flat, min(FEWEST_LINES, most), most))
    transform = scipy.fft.rfft(terms, axis=0)[1 : lines + 1]
    student = float(scipy.stats.t.ppf(UPPER_95, 2 * lines)) / NORMAL_95
    return np.asarray(student**2 * (transform.conj().T @ transform).real / lines)


def _larger(first: FloatArray, second: FloatArray) -> FloatArray:
    """Covariance that is no smaller than either of two in any direction, and than both by no more than it must."""
    values, vectors = _axes_above_rounding(first + second)
    root = vectors * np.sqrt(values)
    whitener = vectors / np.sqrt(values)
    # in these coordinates the two add up to the identity: they have the same axes
    shares, axes = np.linalg.eigh(whitener.T @ first @ whitener)
    half = root @ axes
    return np.asarray((half * np.maximum(shares, 1.0 - shares)) @ half.T)


def _axes_above_rounding(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues of a covariance (n, n) that are larger than rounding (r,), and their eigenvectors (n, r)."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > np.finfo(float).eps * len(values) * max(values.max(initial=0.0), np.finfo(float).tiny)
    return values[kept], vectors[:, kept]


def mean_period(group: Repetition, signals: Sequence[FloatArray]) -> FloatArray:
    """Mean over the periods of a sequence (period, ...), from signals of the experiments (N_i, ...), NaN as zero."""
    total = np.zeros((group.period, *signals[0].shape[1:]))
    for k, start in group.starts:
        total += np.nan_to_num(signals[k][start : start + group.period])
    return total / group.count


def beyond_independent(of_mean_periods: FloatArray, independent: FloatArray) -> FloatArray:
    """What the mean periods add to a covariance (q, q) that has the independent errors of their weights already.

    The sum of weights times errors over all periods is that over the mean period, weights and errors averaged, times
    the number of periods: its covariance takes the place of that for independent errors. It is no smaller: few lines
    may miss what the noise alone makes.
    """
    return _larger(of_mean_periods, independent) - independent


def periodic_share(whole: FloatArray, periodic: FloatArray) -> FloatArray:
    """Share (q, q) of weights that is the same in all periods, between zero and the identity in every direction.

    Args:
        whole: Sum over time of the products of the weights.
        periodic: The same of their means over the periods, times the number of periods.
    """
    values, vectors = _axes_above_rounding(whole)
    inverse_root = (vectors / np.sqrt(values)) @ vectors.T
    shares, axes = np.linalg.eigh(inverse_root @ periodic @ inverse_root)
    return np.asarray((axes * np.clip(shares, 0.0, 1.0)) @ axes.T)


def repeated_in_weighted_sum(
    experiments: Sequence[IOData],
    weights: Sequence[FloatArray],
    errors: Sequence[FloatArray],
    covariance: FloatArray,
) -> tuple[FloatArray, RepeatedErrors] | None:
    """What repeated errors add to the covariance of an estimate whose error is a weighted sum of errors.

    Args:
        experiments: The records.
        weights: Weights w of each experiment (N_i, p), zero where the estimate has no equation: the error of the
            parameters is the sum over time of w(t) e(t).
        errors: The errors e (N_i,), zero likewise.
        covariance: Of the parameters, for errors that are independent of the input (p, p).

    Returns:
        The covariance (p, p), and what repeats; None where nothing does.
    """
    columns = [error[:, None] for error in errors]
    repeated = repeated_errors(experiments, columns)
    if repeated is None or not repeated.is_significant:
        return None
    directions = standard_directions(covariance)
    directions = directions[:, np.abs(directions).max(axis=0) > 0.0]
    # coordinates in which the covariance is the identity
    along = np.linalg.pinv(directions)
    scaled = [of_record @ along.T for of_record in weights]
    middle, periodic = np.zeros((2, len(along), len(along)))
    for group in repeated.groups:
        mean = mean_period(group, scaled)
        middle += sum_over_periods(group, mean[:, None], mean_period(group, columns))
        periodic += group.count * mean.T @ mean
    whole = np.sum([of_record.T @ of_record for of_record in scaled], axis=0)
    added = beyond_independent(middle, periodic_share(whole, periodic))
    return directions @ added @ directions.T, repeated


def count_repetition_once(estimate: AnyEstimate, experiments: Sequence[IOData]) -> AnyEstimate:
    """Widen the covariance of an estimate whose errors repeat with the input, and say so in its diagnostics.

    The covariance gets what the errors of the mean period contribute beyond independent ones. Without a repetition of
    the input, or of the errors with it, the estimate is returned as it is.

    Args:
        estimate: The estimate.
        experiments: The records of its fit, about its operating point, trends removed.
    """
    is_known = np.isfinite(estimate.covariance).all() and np.isfinite(estimate.noise_variance).all()
    if not is_known or not estimate.covariance.any():
        return estimate
    groups = repetitions(experiments)
    if not groups:
        return estimate
    whitening = inverse_root(estimate.noise_variance)
    errors = whitened_errors(estimate.model, experiments, whitening)
    repeated = _errors_of_groups(groups, errors)
    if repeated is None or not repeated.is_significant:
        return estimate
    directions = standard_directions(estimate.covariance)
    directions = directions[:, np.abs(directions).max(axis=0) > 0.0]
    slopes = _Slopes(repeated.groups)
    for direction in directions.T:
        of_direction = _slopes_along(direction, estimate, experiments, whitening)
        if of_direction is None:
            return estimate
        slopes.add(of_direction)
    middle, periodic = np.zeros((2, directions.shape[1], directions.shape[1]))
    for group, slope in zip(repeated.groups, slopes.of_mean_periods(), strict=True):
        middle += sum_over_periods(group, slope, mean_period(group, errors))
        periodic += group.count * np.einsum("tiq,tir->qr", slope, slope)
    curvature, inverse = slopes.curvature()
    if not (np.isfinite(inverse).all() and np.isfinite(middle).all() and np.isfinite(periodic).all()):
        # a predictor that is not stable where the parameters are moved
        return estimate
    share = periodic_share(curvature, periodic)
    added = directions @ beyond_independent(inverse @ middle @ inverse, share) @ directions.T
    if not np.isfinite(added).all():
        return estimate
    covariance = estimate.covariance + added
    before = {"covariance_of_independent_errors": estimate.covariance}
    return replace(
        estimate,
        covariance=0.5 * (covariance + covariance.T),
        diagnostics={**estimate.diagnostics, **repeated.diagnostics, **before},
    )


def _slopes_along(
    direction: FloatArray, estimate: AnyEstimate, experiments: Sequence[IOData], whitening: FloatArray
) -> list[FloatArray] | None:
    """Derivatives of the whitened errors of each experiment (N_i, r) along a direction of one standard deviation (q,).

    Of a pole at the stability limit a step as usual may make a predictor whose errors grow without end, and of a time
    constant that the data leave open one of another scale: a smaller one does not. None where every step does.
    """
    for step in STEPS:
        if np.any(np.abs(step * direction) > FARTHEST * (1.0 + np.abs(estimate.parameters))):
            continue
        # a continuous model that grows fast may overflow from one sample to the next
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                ahead, behind = (
                    whitened_errors(estimate.realise(estimate.parameters + change), experiments, whitening)
                    for change in (step * direction, -step * direction)
                )
            except ValueError:
                # SciPy refuses matrices that are not finite; so do our models
                continue
            slopes = [(later - earlier) / (2.0 * step) for later, earlier in zip(ahead, behind, strict=True)]
        # not so of NaN either
        if all(np.abs(slope).max(initial=0.0) < LARGEST_SLOPE for slope in slopes):
            return slopes
    return None


class _Slopes:
    """Derivatives of the errors along directions of the parameters, taken in one after the other."""

    def __init__(self, groups: Sequence[Repetition]) -> None:
        self._groups = groups
        self._columns: list[FloatArray] = []
        self._means: list[list[FloatArray]] = [[] for _ in groups]

    def add(self, slopes: Sequence[FloatArray]) -> None:
        """Take in the derivatives of the errors of each experiment (N_i, ny) along a further direction."""
        for of_group, group in zip(self._means, self._groups, strict=True):
            of_group.append(mean_period(group, slopes))
        column = np.concatenate([slope.ravel() for slope in slopes])
        if len(column) <= LARGEST_COLUMN:
            self._columns.append(column)

    def of_mean_periods(self) -> list[FloatArray]:
        """Derivatives in the mean period of every sequence (period, ny, q)."""
        return [np.stack(of_group, axis=2) for of_group in self._means]

    def curvature(self) -> tuple[FloatArray, FloatArray]:
        """Their products (q, q), the identity for steps of one deviation of a true model, and the inverse.

        A direction that a prior or a realisation decides has less effect on the errors than its deviation says. Of long
        records the products are not formed.
        """
        if not self._columns:
            return np.eye(len(self._means[0])), np.eye(len(self._means[0]))
        table = np.column_stack(self._columns)
        curvature = table.T @ table
        if not np.isfinite(curvature).all():
            return curvature, np.full_like(curvature, np.nan)
        values, vectors = np.linalg.eigh(curvature)
        # both from the eigenvalues: in a record without noise these span more than the digits of an inverse
        values = np.maximum(values, 1.0)
        return np.asarray((vectors * values) @ vectors.T), np.asarray((vectors / values) @ vectors.T)


def inverse_root(covariance: FloatArray) -> FloatArray:
    """Matrix W (n, r) for which errors e' W of this covariance (n, n) are white, of unit variance."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    deviations[deviations == 0.0] = 1.0
    values, vectors = np.linalg.eigh(covariance / np.outer(deviations, deviations))
    kept = values > SINGULAR * max(values.max(initial=0.0), np.finfo(float).tiny)
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]) / deviations[:, None])


def whitened_errors(model: StateSpace, experiments: Sequence[IOData], whitening: FloatArray) -> list[FloatArray]:
    """Prediction errors (N_i, r) of each experiment, its initial state fitted; zero where an output is missing."""
    errors = []
    # the estimator has reported an unstable predictor
    with warnings.catch_warnings(), np.errstate(over="ignore", invalid="ignore"):
        warnings.simplefilter("ignore", SysidWarning)
        for experiment in experiments:
            of_record = residuals(model, experiment)
            of_record[~np.isfinite(experiment.y)] = 0.0
            errors.append(of_record @ whitening)
    return errors
