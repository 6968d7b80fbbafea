"""Model reduction by balanced truncation."""

import numpy as np
import scipy.linalg

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError


def balanced_truncation(
    A: FloatArray, B: FloatArray, C: FloatArray, tolerance: float, order: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Keep the states with the largest Hankel singular values [Moore1981].

    The truncated response differs from the whole one by at most twice the sum of the dropped singular values, at any
    frequency.

    Args:
        A: State matrix (n, n), stable.
        B: Input matrix (n, nu).
        C: Output matrix (ny, n).
        tolerance: States with a Hankel singular value below `tolerance` times the largest are dropped.
        order: Number of states to keep at most; None keeps all that the tolerance allows.

    Returns:
        The reduced A, B, C and all Hankel singular values, largest first.

    Raises:
        SysidError: The model is not stable, so that it has no Gramians.
    """
    if len(A) == 0:
        return A, B, C, np.zeros(0)
    radius = np.abs(np.linalg.eigvals(A)).max()
    if radius >= 1.0:
        raise SysidError(f"balanced truncation needs a stable model, given one with spectral radius {radius:.6g}")
    controllability = _factor(scipy.linalg.solve_discrete_lyapunov(A, B @ B.T))
    observability = _factor(scipy.linalg.solve_discrete_lyapunov(A.T, C.T @ C))
    left, hankel, right = np.linalg.svd(observability.T @ controllability)
    keep = int((hankel > tolerance * hankel[0]).sum())
    keep = keep if order is None else min(keep, order)
    scale = 1.0 / np.sqrt(hankel[:keep])
    to_balanced = scale[:, None] * (left[:, :keep].T @ observability.T)
    from_balanced = controllability @ right[:keep].T * scale
    return to_balanced @ A @ from_balanced, to_balanced @ B, C @ from_balanced, hankel


def _factor(gramian: FloatArray) -> FloatArray:
    """Return a factor L of a positive semidefinite matrix, L L' = gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))
