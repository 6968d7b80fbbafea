"""Observer gains: stable, or deadbeat."""

import numpy as np
import scipy

from sysid.records.arrays import FloatArray

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
        P = scipy.linalg.solve_discrete_are(A.T, C.T, K @ r @ K.T, r, s=K @ r)
        factor = np.linalg.solve((C @ P @ C.T + r).T, (A @ P @ C.T + K @ r).T).T
    except (np.linalg.LinAlgError, ValueError):
        return K
    return factor if np.isfinite(factor).all() and spectral_radius(A - factor @ C) < 1.0 else K


def spectral_radius(matrix: FloatArray) -> float:
    """Largest modulus of an eigenvalue."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def deadbeat_gain(A: FloatArray, C: FloatArray) -> FloatArray:
    """Gain with (A - K C)^k = 0 for the smallest possible k [Juang1993]; unobservable modes keep their poles.

    For the transposed pair: the states that some input leads to zero in one step, in two, ... form growing subspaces;
    K' is the least input that leads from each subspace to the one before.
    """
    n, ny = len(A), len(C)
    out = np.zeros((ny, n))
    basis = np.zeros((n, 0))
    size = max(float(np.linalg.norm(A, 2)), float(np.linalg.norm(C, 2)), np.finfo(float).tiny) if n else 1.0
    while basis.shape[1] < n:
        outside = scipy.linalg.null_space(basis.T) if basis.shape[1] else np.eye(n)
        left, values, _ = np.linalg.svd(outside.T @ C.T)
        unreached = left[:, int((values > RANK * size).sum()) :].T
        # columns of `outside` that one step takes into the subspace, up to what the input can add
        _, values, right = np.linalg.svd(unreached @ outside.T @ A.T @ outside)
        new = outside @ right[int((values > RANK * size).sum()) :].T
        if not new.shape[1]:
            break
        out -= np.linalg.lstsq(outside.T @ C.T, outside.T @ A.T @ new, rcond=RANK)[0] @ new.T
        basis = np.hstack((basis, new))
    return -out.T
