"""Weights of the prediction errors in the last parameters of a recursion."""

import numpy as np

from sysid.records.arrays import FloatArray


def error_weights(gains: FloatArray, gradients: FloatArray) -> FloatArray:
    """Weights w (N, p): the error of the last parameters is about the sum over time of w(t) e(t).

    From theta(t) - theta0 = (I - L(t) psi(t)') (theta(t-1) - theta0) + L(t) e(t), whatever the rule of the gain L:
    w(t) = (I - L(N) psi(N)') ... (I - L(t+1) psi(t+1)') L(t).

    Args:
        gains: L of every step (N, p), as the parameters took it.
        gradients: psi (N, p).
    """
    weights = np.empty_like(gains)
    remaining = np.eye(gains.shape[1])
    for t in reversed(range(len(gains))):
        weights[t] = remaining @ gains[t]
        remaining -= np.outer(weights[t], gradients[t])
    return weights
