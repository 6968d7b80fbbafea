"""Linear least squares with the diagnostics an identification needs."""

from dataclasses import dataclass

import numpy as np

from sysid.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution of min |Y - Phi X|.

    Attributes:
        solution: X (p, m), of least norm (in scaled columns) where Phi lacks rank.
        inverse_gram: Pseudo-inverse of Phi' Phi (p, p).
        residual_gram: (Y - Phi X)' (Y - Phi X) (m, m).
        rank: Numerical rank of Phi.
        condition: Ratio of the extreme singular values of Phi with columns scaled to unit length.
    """

    solution: FloatArray
    inverse_gram: FloatArray
    residual_gram: FloatArray
    rank: int
    condition: float


def solve(phi: FloatArray, target: FloatArray) -> LeastSquares:
    """Solve by QR of [Phi Y] and SVD of the small triangle: as accurate as the SVD of Phi, at the cost of one QR.

    Args:
        phi: Regressors (rows, p), rows >= p.
        target: Right-hand sides (rows, m).
    """
    p = phi.shape[1]
    triangle = triangular_factor(np.hstack((phi, target)))
    scale = np.linalg.norm(triangle[:, :p], axis=0)
    scale[scale == 0.0] = 1.0
    left, values, right = np.linalg.svd(triangle[:p, :p] / scale)
    largest = float(values[0]) if p else 0.0
    kept = values > max(phi.shape) * np.finfo(float).eps * largest
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    backward = (right.T * inverse) / scale[:, None]
    solution = backward @ (left.T @ triangle[:p, p:])
    lost = left.T[~kept] @ triangle[:p, p:]
    tail = np.vstack((triangle[p:, p:], lost))
    smallest = float(values[-1]) if p else 0.0
    return LeastSquares(
        solution=solution,
        inverse_gram=backward @ backward.T,
        residual_gram=tail.T @ tail,
        rank=int(kept.sum()),
        condition=largest / smallest if smallest > 0.0 else np.inf,
    )


def triangular_factor(matrix: FloatArray) -> FloatArray:
    """R of the QR factorisation, (min(rows, columns), columns), without forming Q."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))
