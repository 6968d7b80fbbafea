"""The edge of stability as a constraint: predictors that lie beyond it, and directions that lead there."""

import numpy as np
from scipy.optimize import nnls

from sysid.records.arrays import FloatArray
from sysid.subspace.predictor import STABILITY_MARGIN, Predictor

SHORT = 1e-3  # distance of a pole from the circle, in ones over the record's length, that no record can tell from none


def stability_limit(samples: int) -> float:
    """Largest modulus of a pole: so near to 1 that a longer memory would not show in so many samples."""
    return 1.0 - max(STABILITY_MARGIN, SHORT / samples)


def pulled_in(predictor: Predictor, limit: float) -> Predictor:
    """The predictor with the poles beyond the limit moved on to it, along their radius.

    Args:
        predictor: Finite entries.
        limit: Largest modulus of a pole.
    """
    poles, vectors = np.linalg.eig(predictor.A)
    modulus = np.abs(poles)
    if modulus.max(initial=0.0) <= limit:
        return predictor
    moved = poles * np.where(modulus > limit, limit / np.maximum(modulus, limit), 1.0)
    try:
        A = (vectors * moved @ np.linalg.inv(vectors)).real
    except np.linalg.LinAlgError:
        A = predictor.A
    radius = np.abs(np.linalg.eigvals(A)).max() if np.isfinite(A).all() else np.inf
    # where eigenvectors are nearly dependent, all poles together
    if not radius < limit + 0.1 * (1.0 - limit):
        A = predictor.A * (limit / modulus.max())
    return Predictor(A, predictor.M, predictor.C, predictor.D)


def outward(predictor: Predictor, basis: FloatArray, limit: float) -> FloatArray:
    """Derivatives of the moduli of the poles at the limit, by coordinate; a pair of conjugate poles counts once.

    Args:
        predictor: Where.
        basis: Directions (all entries of A, M, C, D, q).
        limit: Largest modulus of a pole.

    Returns:
        Rows (poles at the limit, q).
    """
    n = len(predictor.A)
    poles, right = np.linalg.eig(predictor.A)
    at = np.flatnonzero((1.0 - np.abs(poles) < 2.0 * (1.0 - limit)) & (poles.imag >= 0.0))
    if not len(at):
        return np.zeros((0, basis.shape[1]))
    try:
        left = np.linalg.inv(right)
    except np.linalg.LinAlgError:
        return np.zeros((0, basis.shape[1]))
    changes = basis[: n * n].T.reshape(-1, n, n)
    slopes = np.einsum("pi,qij,jp->pq", left[at], changes, right[:, at])
    return np.asarray((slopes * (poles[at].conj() / np.abs(poles[at]))[:, None]).real, dtype=np.float64)


def constrained_step(values: FloatArray, g: FloatArray, rows: FloatArray) -> FloatArray:
    """Minimise s' diag(values) s / 2 - g' s where no row grows: rows @ s <= 0.

    Args:
        values: Above 0 (q,).
        g: Right-hand side (q,).
        rows: Constraints (m, q).
    """
    free = g / values
    if not (rows @ free > 0.0).any():
        return free
    # the dual problem: forces f >= 0 of the constraints, s = free - diag(values)^-1 rows' f
    root = np.sqrt(values)
    sides = (rows / root).T
    lengths = np.linalg.norm(sides, axis=0)
    kept = lengths > 0.0
    try:
        forces, _ = nnls(sides[:, kept] / lengths[kept], root * free)
    except RuntimeError:
        # no answer within its iterations: whoever asks pulls poles back that have come too far
        return free
    return np.asarray(free - (sides[:, kept] / lengths[kept]) @ forces / root)
