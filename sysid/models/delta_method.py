"""First-order propagation of parameter covariance through any function of the parameters."""

from collections.abc import Callable

import numpy as np

from sysid.records.arrays import FloatArray

STEP = 0.01  # in standard deviations: small against the curvature of the function, large against rounding


def standard_directions(covariance: FloatArray) -> FloatArray:
    """Columns L with L L' = covariance: independent steps of one standard deviation each.

    Stepping along them instead of along single parameters keeps a badly conditioned model (whose parameters are known
    only jointly) inside its own confidence region.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))


def spread(function: Callable[[FloatArray], FloatArray], parameters: FloatArray, covariance: FloatArray) -> FloatArray:
    """Change of a function of parameters (p,) per standard direction, by central differences, (p, *shape of its value).

    The sum over the first axis of the products of two entries is their covariance [Ljung1999, ch. 9]. Without a known
    covariance of the parameters, NaN, the result is NaN too.
    """
    if not np.isfinite(covariance).all():
        # without a covariance of the parameters there is none of the function
        return np.full((1, *np.shape(function(parameters))), np.nan)
    changes = []
    for direction in standard_directions(covariance).T:
        ahead = function(parameters + STEP * direction)
        behind = function(parameters - STEP * direction)
        changes.append((ahead - behind) / (2.0 * STEP))
    return np.array(changes)
