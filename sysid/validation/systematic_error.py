"""Errors of responses over realisations of an excitation: systematic error, noise and nonlinear distortion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation.mean_error import MeanError

FEWEST_REALISATIONS = 4  # fewer leave the scatter unknown


@dataclass(frozen=True)
class Scatter:
    """Scatter of a response over records, root mean squares over its lines in percent of the linear part.

    Attributes:
        noise: Between records of one waveform; NaN where none was repeated.
        noise_interval: Its 95 % interval, as wide as if all lines went together.
        distortion: Between waveforms, beyond the noise.
        distortion_interval: Its 95 % interval.
    """

    noise: float
    noise_interval: tuple[float, float]
    distortion: float
    distortion_interval: tuple[float, float]


def scatter_of(groups: Sequence[ComplexArray], power: float) -> Scatter:
    """Divide the scatter of responses into noise and distortion [Pintelon2012, sec. 4.3].

    Of waveform w and repeat k the response is G + d_w + n_wk: repeats scatter by n alone, first records by both.

    Args:
        groups: Responses by waveform (k, nf), at least `FEWEST_REALISATIONS` of them.
        power: Of the linear part, summed over the lines.
    """
    first = np.array([group[0] for group in groups])
    total = _variance(first)
    without = np.array([_variance(np.delete(first, w, 0)) for w in range(len(first))])
    freedom = sum(len(group) - 1 for group in groups)
    variance, noise, interval = 0.0, np.nan, (np.nan, np.nan)
    if freedom:
        squares = sum(np.sum(np.abs(group - group.mean(axis=0)) ** 2) for group in groups)
        variance = float(squares) / freedom
        low = variance * freedom / scipy.stats.chi2.ppf(0.975, freedom)
        high = variance * freedom / scipy.stats.chi2.ppf(0.025, freedom)
        noise, interval = _percent(variance, power), (_percent(low, power), _percent(high, power))
    # without repeats the noise counts as distortion
    distortion_interval = _jackknife_interval(total - variance, without - variance, power)
    return Scatter(noise, interval, _percent(total - variance, power), distortion_interval)


def systematic_of(errors: ComplexArray, power: float, *, allowed: float, false_alarm: float) -> MeanError:
    """The error that all waveforms share, judged by their scatter: rms over the lines in percent of the linear part.

    W |mean|^2 / s^2, both summed over the lines, is a ratio of two sums of squares in which the noise level cancels. Of
    Gaussian errors that spread alike in q directions it has an F distribution with q and q (W - 1) degrees of freedom;
    of others it is taken as if [Satterthwaite1946]. q is the sample's trace over largest eigenvalue, between 1 and
    W - 1: too few directions rather than too many, which widens the limit. Simulated at 5e-4, directions of equal
    spread, one to a hundred, give false alarms no more often than stated; mixtures in which one stands out of many
    others, whose share the largest eigenvalue does not show, 1.3 to 2.7 times as often. Where an error of size a is
    allowed, |mean| can be larger by a.

    Args:
        errors: Identified less nonparametric response of one record of each waveform (W, nf), W of at least
            `FEWEST_REALISATIONS`.
        power: Of the linear part, summed over the lines.
        allowed: Error that is no fault, percent of the linear part.
        false_alarm: Probability of a larger `size` than `limit`.
    """
    count = len(errors)
    mean, variance = errors.mean(axis=0), _variance(errors)
    squared = _square_of_mean(errors)
    without = np.array([_square_of_mean(np.delete(errors, w, 0)) for w in range(count)])
    directions = _directions(errors - mean)
    critical = float(scipy.stats.f.isf(false_alarm, directions, directions * (count - 1)))
    largest = (allowed / 100.0 * np.sqrt(power) + np.sqrt(critical * variance / count)) ** 2
    # `size` is free of what scatter adds to the square of the mean, so its limit is too
    limit = _percent(largest - variance / count, power)
    return MeanError(_percent(squared, power), _jackknife_interval(squared, without, power), limit)


def _variance(values: ComplexArray) -> float:
    """Variance between rows, summed over the lines."""
    return float(np.sum(np.abs(values - values.mean(axis=0)) ** 2)) / (len(values) - 1)


def _square_of_mean(values: ComplexArray) -> float:
    """Square of the true mean, summed over the lines, free of what scatter adds."""
    return float(np.sum(np.abs(values.mean(axis=0)) ** 2)) - _variance(values) / len(values)


def _directions(deviations: ComplexArray) -> float:
    """Number of directions with the same sum of variances if each had the largest variance; 1 at least."""
    products = (deviations @ deviations.conj().T).real
    largest = float(np.linalg.eigvalsh(products)[-1])
    if largest <= 0.0:
        return 1.0
    return max(1.0, float(np.trace(products)) / largest)


def _jackknife_interval(estimate: float, without: FloatArray, power: float) -> tuple[float, float]:
    """95 % interval by Student's distribution of the jackknife's pseudo-values, percent of the linear part.

    `without` has the estimate from all records but one, for each of them.
    """
    count = len(without)
    pseudo = count * estimate - (count - 1) * without
    half = float(scipy.stats.t.ppf(0.975, count - 1)) * float(np.std(pseudo, ddof=1)) / np.sqrt(count)
    return (_percent(estimate - half, power), _percent(estimate + half, power))


def _percent(squared: float, power: float) -> float:
    """Root of a sum of squares in percent of the linear part; 0 where an estimate of it is negative."""
    return 100.0 * float(np.sqrt(max(squared, 0.0) / power))
