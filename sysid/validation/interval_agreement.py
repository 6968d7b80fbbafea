"""Whether a measured response is that of a model, line by line and over all lines."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from sysid import BestLinearApproximation
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError


@dataclass(frozen=True, eq=False)
class Agreement:
    """A best linear approximation beside the response of a model at the same lines.

    Attributes:
        frequencies: Hz (nf,).
        expected: Response of the model (nf, ny, nu).
        ratio: The approximation over it (nf, ny, nu).
        p: p-value of each line, uniform where model and approximation agree (nf, ny, nu).
        p_all: p-value over all lines (ny, nu).
    """

    frequencies: FloatArray
    expected: ComplexArray
    ratio: ComplexArray
    p: FloatArray
    p_all: FloatArray

    @property
    def gain_db(self) -> FloatArray:
        """Departure of the gain (nf, ny, nu), dB."""
        return np.asarray(20.0 * np.log10(np.abs(self.ratio)))

    @property
    def phase_deg(self) -> FloatArray:
        """Departure of the phase (nf, ny, nu), degrees."""
        return np.degrees(np.angle(self.ratio))


def agreement(approximation: BestLinearApproximation, expected: ComplexArray) -> Agreement:
    """Test a best linear approximation against a response that is known without error.

    At a line whose mean response G over R realisations has the estimated variance v, |G - G0|^2 / v has the F
    distribution with 2 and 2 (R - 1) degrees of freedom [Pintelon2012, sec. 4.3]: v is that of noise and distortion
    together, and G is normal. The lines are independent, so that -2 sum log p has the chi-square distribution with two
    degrees of freedom per line.

    Args:
        approximation: With several realisations.
        expected: The response at its lines (nf, ny, nu).

    Returns:
        Departures and p-values.

    Raises:
        SysidError: Shapes differ, or there is a single realisation.
    """
    found = approximation.response.response
    if expected.shape != found.shape:
        raise SysidError(f"a response of shape {expected.shape} given, expected {found.shape}")
    if approximation.realisations < 2:
        raise SysidError("one realisation given, expected two or more: they tell the variance of the response")
    statistic = np.abs(found - expected) ** 2 / approximation.total_variance
    p = f_distribution.sf(statistic, 2, 2 * (approximation.realisations - 1))
    over_all = chi2.sf(-2.0 * np.log(np.maximum(p, np.finfo(float).tiny)).sum(axis=0), 2 * len(p))
    return Agreement(approximation.response.frequencies, expected, found / expected, p, over_all)
