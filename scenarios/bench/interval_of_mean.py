"""How sure a measured mean over records is: 95 % intervals that lie where the mean can, and have a width."""

import numpy as np
from scipy.stats import beta, chi2, norm, t

from sysid.records.arrays import FloatArray

TAIL = 0.025
"""Probability beyond either end."""

FEWEST = 3
"""Positive values of which a mean's interval is told: two allow a factor of 1e30."""

EQUAL = 1e-9
"""Deviation below which shares are all the same."""


def interval_of_positive_mean(values: FloatArray) -> tuple[float, float]:
    """Of positive values, such as squares, ratios and distances.

    The mean is taken as chi-square with as many degrees of freedom as its own mean and variance say
    [Satterthwaite1946]; since the variance is that of the n values, the quantiles are those at Student's tails of n - 1
    degrees of freedom instead of the normal ones. It holds the mean in 93 to 96 % of sets of 4, 10, 20 or 200 values
    that are each chi-square with 1 to 20 degrees of freedom, over them; Student's own interval does in 82 to 95 %, and
    goes below 0.

    Args:
        values: At least 0 (n,).

    Returns:
        Both ends, at least 0; NaN of fewer than three values, and where not all are finite.
    """
    if len(values) < FEWEST or not np.isfinite(values).all():
        return (float("nan"), float("nan"))
    size = float(np.max(values))
    if size == 0.0:
        return (0.0, 0.0)
    # their squares may be beyond all floats
    scaled = values / size
    n, mean, deviation = len(values), float(np.mean(scaled)), float(np.std(scaled, ddof=1))
    freedom = 2.0 * n * (mean / deviation) ** 2 if deviation > 0.0 else np.inf
    if not np.isfinite(freedom):
        return (size * mean, size * mean)
    tail = float(norm.sf(t.isf(TAIL, n - 1)))
    return (
        size * mean * (freedom / float(chi2.isf(tail, freedom))),
        size * mean * (freedom / float(chi2.ppf(tail, freedom))),
    )


def interval_of_mean_share(values: FloatArray) -> tuple[float, float]:
    """Of shares, one per record, of things within the record that may depend on each other.

    The exact binomial interval, with the number of independent draws that have the variance of these shares, less for
    how little few records tell of it [KornGraubard1998]; no fewer draws than records, as many as where all of a record
    go together, and just as many where all shares are equal, which tells nothing of their variance. So it has a width
    at 0 and at 1.

    Args:
        values: From 0 to 1 (n,).

    Returns:
        Both ends, from 0 to 1; NaN of no values, and where not all are finite.
    """
    n = len(values)
    if n == 0 or not np.isfinite(values).all():
        return (float("nan"), float("nan"))
    mean = float(np.mean(values))
    draws = float(n)
    if n > 1 and (deviation := float(np.std(values, ddof=1))) > EQUAL:
        little = float(norm.isf(TAIL) / t.isf(TAIL, n - 1)) ** 2
        draws = max(draws, n * mean * (1.0 - mean) / deviation**2 * little)
    return exact_interval_of_share(draws * mean, draws)


def exact_interval_of_share(found: float, total: float) -> tuple[float, float]:
    """After Clopper and Pearson; NaN of nothing.

    Args:
        found: How many of them are, from 0 to `total`; not necessarily a whole number.
        total: How many there are.
    """
    if total <= 0.0:
        return (float("nan"), float("nan"))
    low = float(beta.ppf(TAIL, found, total - found + 1.0)) if found > 0.0 else 0.0
    high = float(beta.isf(TAIL, found + 1.0, total - found)) if found < total else 1.0
    return (low, high)
