"""Optimal spectrum: how an input of limited power divides it over frequencies."""

from collections.abc import Sequence

import numpy as np

from sysid.design.information import Information
from sysid.records.arrays import FloatArray

CLOSE = 1e-3
"""Distance from the optimum, relative to the criterion, at which the search ends; the bound accounts for it."""

MOST_STEPS = 5000  # the bound is one wherever the search ends


def optimal_spectrum(models: Sequence[Information], energy: float) -> tuple[FloatArray, float]:
    """Spectrum that minimises the mean criterion of some models, a convex problem [Mehra1974; GoodwinPayne1977].

    It is solved by multiplicative steps, which keep all powers positive and never raise the criterion [Fellman1974].
    Returns the sum of squares at every line (nf,), and a lower bound of the criterion of any input of that energy.
    """
    count = models[0].filters.shape[-1]
    shares = np.full(count, 1.0 / count)
    bound = -np.inf
    for _ in range(MOST_STEPS):
        values, slopes_of_models = zip(*(model.of_shares(shares, energy) for model in models), strict=True)
        value = float(np.mean(values))
        slopes = np.mean(slopes_of_models, axis=0)
        mean = float(shares @ slopes)
        # a convex function lies above its tangent, whose lowest value has all power at the steepest line
        bound = max(bound, value - float(slopes.max()) + mean)
        if value - bound <= CLOSE * mean:
            break
        # the root of the ratio: with its first power the criterion could rise
        shares = shares * (slopes / mean) ** 0.5
        shares /= shares.sum()
    return shares * energy, bound
