"""Gain of every path over a band, with its interval and a test of no response."""

from dataclasses import dataclass

import numpy as np
import scipy

from sysid.frequency.bla import BestLinearApproximation, agreement_p
from sysid.records.arguments import confidence_level
from sysid.records.arrays import FloatArray, Locked


@dataclass(frozen=True, eq=False)
class BandGain(Locked):
    """Root mean square of the gain of every path over the lines of an approximation.

    Attributes:
        gain: Gain, without what noise and distortion add to it (ny, nu); 0 where they explain all of it.
        low: Lower end of its interval (ny, nu), not below 0.
        high: Upper end (ny, nu).
        p: p-value of "no response at any line" (ny, nu), uniform where there is none.
    """

    gain: FloatArray
    low: FloatArray
    high: FloatArray
    p: FloatArray


def band_gain(approximation: BestLinearApproximation, *, level: float = 0.95) -> BandGain:
    """Estimate the gain of every path over the band of an approximation, and test whether there is any.

    With v the variance of the response G at a line by noise and distortion together, |G|^2 - v is an unbiased estimate
    of the squared gain, with the variance 2 |G0|^2 v + v^2; the mean over many lines is about normal. The test is that
    of `response_agreement` against a response of zero [Pintelon2012, sec. 4.3]: its variance is the scatter over
    realisations, so that nonlinear distortion by one input is not taken for the response to another.

    Args:
        approximation: Approximation from several realisations.
        level: Confidence level of the intervals.

    Returns:
        Gains with intervals and p-values.

    Raises:
        SysidError: There is a single realisation, or the level is no probability.
    """
    level = confidence_level(level)
    response, variance = approximation.response.response, approximation.total_variance
    _, p = agreement_p(approximation, np.zeros_like(response))
    power = np.abs(response) ** 2 - variance
    variance_of_power = 2.0 * np.maximum(power, 0.0) * variance + variance**2
    deviation = np.sqrt(np.sum(variance_of_power, axis=0)) / len(power)
    reach = float(scipy.stats.norm.ppf(0.5 + 0.5 * level)) * deviation
    mean = power.mean(axis=0)
    # by chance the mean may be negative, where noise and distortion explain more than all
    low = np.sqrt(np.maximum(mean - reach, 0.0))
    gain = np.sqrt(np.maximum(mean, 0.0))
    high = np.sqrt(np.maximum(mean + reach, 0.0))
    return BandGain(gain, low, high, p)
