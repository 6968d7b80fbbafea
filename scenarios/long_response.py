"""What an ARX model of high order simulates whose coefficients and past are fitted to the very record."""

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from scenarios.tall_least_squares import least_squares
from sysid.arrays import FloatArray

DIED = 1e-17
"""A free response has died out where it is below this part of its largest value."""

LARGEST = 1e60
"""A response beyond this is that of a model that is not stable; it cannot be fitted."""


def long_response(u: FloatArray, y: FloatArray, order: int) -> FloatArray | None:
    """Fit A(q) y = B(q) u by least squares, then simulate it with the past that fits best.

    The same as the fit and the simulation of a state-space model of as many states; but no matrix of that size is
    needed, because the influence of the past on A(q) y ends after `order` samples.

    Args:
        u: Inputs (N, nu).
        y: Output (N,).
        order: Coefficients of A and of each B; N must exceed twice their number.

    Returns:
        Simulated output (N,); None where the model grows beyond what can be fitted.
    """
    past = np.arange(order, len(y))[:, None] - np.arange(1, order + 1)
    regressors = np.hstack([-y[past], *(signal[past] for signal in u.T)])
    theta = least_squares(regressors, y[order:], cond=1e-15)
    a, *b = np.split(theta, 1 + u.shape[1])
    a = np.concatenate([[1.0], a])
    pulse = np.zeros(len(y))
    pulse[0] = 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        forced = sum(lfilter(np.concatenate([[0.0], bj]), a, signal) for bj, signal in zip(b, u.T, strict=True))
        free = lfilter([1.0], a, pulse)
    if not (np.abs(free) < LARGEST).all() or not (np.abs(forced) < LARGEST).all():
        return None
    alive = int(np.flatnonzero(np.abs(free) > DIED * np.abs(free).max())[-1]) + 1
    rows = min(len(y), alive + order)
    columns = toeplitz(free[:rows], np.zeros(order))
    weights = least_squares(columns, (y - forced)[:rows], cond=1e-15)
    return np.asarray(forced + np.convolve(free, weights)[: len(y)])
