"""Optimal spectrum: how an input of limited power divides it over frequencies."""

from collections.abc import Sequence

import numpy as np

from sysid.design.information import Information
from sysid.records.arrays import FloatArray

CLOSE = 1e-3
"""Distance from the optimum, relative to the criterion, at which the search ends; the bound accounts for it."""

MOST_STEPS = 5000


def optimal_spectrum(models: Sequence[Information], energy: float) -> tuple[FloatArray, float]:
    """Spectrum that minimises the mean criterion of some models, a convex problem [Mehra1974; GoodwinPayne1977].

    It is solved by multiplicative steps, which keep all powers positive and never raise the criterion [Fellman1974].
    Returns the sum of squares at every line (nf,), and a lower bound of the criterion of any input of that energy.
    """
    shares = np.full(models[0].filters.shape[-1], 1.0 / models[0].filters.shape[-1])
    bound = -np.inf
    for _ in range(MOST_STEPS):
        parts = [model.of_shares(shares, energy) for model in models]
        value = float(np.mean([part[0] for part in parts]))
        slopes = np.mean([part[1] for part in parts], axis=0)
        mean = float(shares @ slopes)
        # a convex function lies above its tangent, whose lowest value has all power at the steepest line
        bound = max(bound, value - float(slopes.max()) + mean)
        if value - bound <= CLOSE * mean:
            break
        shares = shares * (slopes / mean) ** 0.5
        shares /= shares.sum()
    return shares * energy, bound
