"""Analysis of variance of responses: systematic error, noise and nonlinear distortion apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution
from scipy.stats import t as student

from sysid.records.arrays import ComplexArray, FloatArray

NAN = float("nan")

FEWEST = 4
"""Waveforms without which nothing is told."""


@dataclass(frozen=True, eq=False)
class Repeats:
    """Records of one waveform.

    Attributes:
        estimated: Responses that were identified (k, nf).
        measured: Responses that the same records show without a model (k, nf).
    """

    estimated: ComplexArray
    measured: ComplexArray


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


@dataclass(frozen=True)
class Systematic:
    """The error that is the same in all waveforms, in percent of the linear part.

    Attributes:
        percent: Root mean square over the lines, free of the part that scatter has in a mean; 0 where that is larger.
        interval: Its 95 % interval.
        limit: What `percent` exceeds with at most the given probability where the true error is what is allowed.
        waveforms: How many it rests on.
    """

    percent: float
    interval: tuple[float, float]
    limit: float
    waveforms: int


def scatter_of(groups: Sequence[ComplexArray], power: float) -> Scatter:
    """Part the scatter of responses into noise and distortion [Pintelon2012, sec. 4.3].

    Of waveform w and repeat k the response is G + d_w + n_wk: repeats scatter by n alone, first records by both.

    Args:
        groups: Responses by waveform (k, nf), at least `FEWEST` of them.
        power: Of the linear part, summed over the lines.
    """
    first = np.array([group[0] for group in groups])
    total, jackknife = _variance(first), np.array([_variance(np.delete(first, w, 0)) for w in range(len(first))])
    freedom = sum(len(group) - 1 for group in groups)
    noise = NAN
    ends = (NAN, NAN)
    if freedom:
        noise = float(sum(np.sum(np.abs(group - group.mean(axis=0)) ** 2) for group in groups)) / freedom
        ends = (noise * freedom / chi2.ppf(0.975, freedom), noise * freedom / chi2.ppf(0.025, freedom))
    less = noise if freedom else 0.0
    distortion = _jackknifed(total - less, jackknife - less)
    return Scatter(
        _percent(noise, power),
        (_percent(ends[0], power), _percent(ends[1], power)),
        _percent(total - less, power),
        (_percent(distortion[0], power), _percent(distortion[1], power)),
    )


def systematic_of(errors: ComplexArray, power: float, *, allowed: float, false_alarm: float) -> Systematic:
    """The mean of errors, judged by their own scatter.

    W |mean|^2 / s^2, both summed over the lines, is a ratio of two sums of squares in which the noise level cancels. Of
    Gaussian errors that spread alike in q directions it has an F distribution with q and q (W - 1) degrees of freedom;
    of others it is taken as if [Satterthwaite1946]. q is the sample's trace over largest eigenvalue, between 1 and
    W - 1: too few directions rather than too many, which widens the limit. Simulated at 5e-4, directions of equal
    spread, one to a hundred, give false alarms no more often than stated; mixtures in which one stands out of many
    others, whose share the largest eigenvalue does not tell, 1.3 to 2.7 times as often. Where an error of size a is
    allowed, |mean| can be larger by a.

    Args:
        errors: Identified less nonparametric response of one record of each waveform (W, nf), W of at least `FEWEST`.
        power: Of the linear part, summed over the lines.
        allowed: Error that is no fault, percent of the linear part.
        false_alarm: Probability of a larger `percent` than `limit`.
    """
    count = len(errors)
    mean, variance = errors.mean(axis=0), _variance(errors)
    squared = float(np.sum(np.abs(mean) ** 2))
    ends = _jackknifed(
        squared - variance / count,
        np.array([_square_of_mean(np.delete(errors, w, 0)) for w in range(count)]),
    )
    directions = _directions(errors - mean)
    critical = float(f_distribution.isf(false_alarm, directions, directions * (count - 1)))
    most = (allowed / 100.0 * np.sqrt(power) + np.sqrt(critical * variance / count)) ** 2
    return Systematic(
        _percent(squared - variance / count, power),
        (_percent(ends[0], power), _percent(ends[1], power)),
        _percent(most - variance / count, power),
        count,
    )


def linear_power(measured: ComplexArray) -> float:
    """Power of the linear part over the lines: of the mean over waveforms of nonparametric responses (W, nf)."""
    return float(np.sum(np.abs(measured.mean(axis=0)) ** 2))


def _variance(values: ComplexArray) -> float:
    """Between rows, summed over the lines."""
    return float(np.sum(np.abs(values - values.mean(axis=0)) ** 2)) / (len(values) - 1)


def _square_of_mean(values: ComplexArray) -> float:
    """Square of the true mean, summed over the lines, free of what scatter adds."""
    return float(np.sum(np.abs(values.mean(axis=0)) ** 2)) - _variance(values) / len(values)


def _directions(deviations: ComplexArray) -> float:
    """Directions that would have the same sum of variances if each had the largest; 1 at least."""
    products = (deviations @ deviations.conj().T).real
    largest = float(np.linalg.eigvalsh(products)[-1])
    return max(1.0, float(np.trace(products)) / largest) if largest > 0.0 else 1.0


def _jackknifed(whole: float, without: FloatArray) -> tuple[float, float]:
    """95 % interval by Student's distribution of the jackknife's pseudo-values."""
    count = len(without)
    pseudo = count * whole - (count - 1) * without
    half = float(student.ppf(0.975, count - 1)) * float(np.std(pseudo, ddof=1)) / np.sqrt(count)
    return (whole - half, whole + half)


def _percent(squared: float, power: float) -> float:
    return 100.0 * float(np.sqrt(max(squared, 0.0) / power)) if np.isfinite(squared) else NAN
