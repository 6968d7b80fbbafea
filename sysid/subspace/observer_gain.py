"""Innovation gains of a stable predictor, and deadbeat gains."""

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.singular_values import svd

RANK = 1e-10  # singular value, relative to the norms of A and C, below which a direction is unobservable


def stable_gain(A: FloatArray, C: FloatArray, K: FloatArray, covariance: FloatArray) -> FloatArray:
    """Keep K if A - K C is stable, else replace it by the stable gain of the same disturbance spectrum.

    The Riccati equation with noise K e in the state and e in the output gives the minimum-phase spectral factor; K
    itself is returned if there is no such factor.
    """
    if spectral_radius(A - K @ C) < 1.0:
        return K
    # only the ratios of the innovation variances matter
    r = covariance / max(float(np.trace(covariance)), np.finfo(float).tiny)
    try:
        # the solver casts a scale that is NaN to integers where the pencil has no finite one, and refuses later
        with np.errstate(invalid="ignore"):
            P = scipy.linalg.solve_discrete_are(A.T, C.T, K @ r @ K.T, r, s=K @ r)
        innovation = C @ P @ C.T + r
        factor = np.linalg.solve(innovation.T, (A @ P @ C.T + K @ r).T).T
    except (np.linalg.LinAlgError, ValueError):
        return K
    if not np.isfinite(factor).all() or spectral_radius(A - factor @ C) >= 1.0:
        return K
    return factor


def spectral_radius(matrix: FloatArray) -> float:
    """Largest modulus of an eigenvalue."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def deadbeat_gain(A: FloatArray, C: FloatArray) -> FloatArray:
    """Gain with (A - K C)^k = 0 for the smallest possible k [Juang1993]; unobservable modes keep their poles.

    For the transposed pair: the states that some input leads to zero in one step, in two, ... form growing subspaces;
    K' is the least input that leads from each subspace to the one before.
    """
    n, ny = len(A), len(C)
    if n == 0:
        return np.zeros((0, ny))
    feedback = np.zeros((ny, n))
    basis = np.zeros((n, 0))
    tolerance = RANK * max(float(np.linalg.norm(A, 2)), float(np.linalg.norm(C, 2)), np.finfo(float).tiny)
    while basis.shape[1] < n:
        outside = scipy.linalg.null_space(basis.T) if basis.shape[1] else np.eye(n)
        into = outside.T @ C.T
        left, values, _ = svd(into)
        unreached = left[:, int((values > tolerance).sum()) :].T
        # columns of `outside` that one step takes into the subspace, up to what the input can add
        _, values, right = svd(unreached @ outside.T @ A.T @ outside)
        added = outside @ right[int((values > tolerance).sum()) :].T
        if not added.shape[1]:
            break
        feedback -= np.linalg.lstsq(into, outside.T @ A.T @ added, rcond=RANK)[0] @ added.T
        basis = np.hstack((basis, added))
    return -feedback.T
