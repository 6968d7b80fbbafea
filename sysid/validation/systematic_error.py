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
    total, jackknife = _variance(first), np.array([_variance(np.delete(first, w, 0)) for w in range(len(first))])
    freedom = sum(len(group) - 1 for group in groups)
    less, noise, ends = 0.0, np.nan, (np.nan, np.nan)
    if freedom:
        less = float(sum(np.sum(np.abs(group - group.mean(axis=0)) ** 2) for group in groups)) / freedom
        low, high = (less * freedom / scipy.stats.chi2.ppf(tail, freedom) for tail in (0.975, 0.025))
        noise, ends = _percent(less, power), (_percent(low, power), _percent(high, power))
    distortion = _jackknife_interval(total - less, jackknife - less, power)
    return Scatter(noise, ends, _percent(total - less, power), distortion)


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
    most = (allowed / 100.0 * np.sqrt(power) + np.sqrt(critical * variance / count)) ** 2
    return MeanError(
        _percent(squared, power), _jackknife_interval(squared, without, power), _percent(most - variance / count, power)
    )


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
    return max(1.0, float(np.trace(products)) / largest) if largest > 0.0 else 1.0


def _jackknife_interval(whole: float, without: FloatArray, power: float) -> tuple[float, float]:
    """95 % interval by Student's distribution of the jackknife's pseudo-values, percent of the linear part."""
    count = len(without)
    pseudo = count * whole - (count - 1) * without
    half = float(scipy.stats.t.ppf(0.975, count - 1)) * float(np.std(pseudo, ddof=1)) / np.sqrt(count)
    return (_percent(whole - half, power), _percent(whole + half, power))


def _percent(squared: float, power: float) -> float:
    return 100.0 * float(np.sqrt(max(squared, 0.0) / power))
