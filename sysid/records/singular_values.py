"""Singular value decomposition that finishes: LAPACK's fast driver gives up now and then, the slow one does not."""

from typing import Any

import numpy as np
import scipy

from sysid.records.arrays import FloatArray


def svd(matrix: Any, *, full_matrices: bool = True) -> tuple[Any, FloatArray, Any]:
    """Left vectors, singular values (largest first) and rows of right vectors of a matrix, as `numpy.linalg.svd`.

    That divides and conquers (gesdd), which fails once in many thousand finite matrices, not always in the same ones:
    parts of its workspace are read before they are written. Then QR iteration (gesvd) takes its place.

    Raises:
        numpy.linalg.LinAlgError: The matrix is not finite.
    """
    try:
        left, values, right = np.linalg.svd(matrix, full_matrices=full_matrices)
    except np.linalg.LinAlgError:
        if matrix.ndim != 2 or not np.isfinite(matrix).all():
            raise
        left, values, right = scipy.linalg.svd(matrix, full_matrices=full_matrices, lapack_driver="gesvd")
    return left, np.asarray(values, dtype=np.float64), right


def singular_values(matrix: Any) -> FloatArray:
    """Singular values alone, largest first, likewise; of a stack of matrices those of each."""
    try:
        return np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)
    except np.linalg.LinAlgError:
        if matrix.ndim != 2 or not np.isfinite(matrix).all():
            raise
        values = scipy.linalg.svd(matrix, compute_uv=False, lapack_driver="gesvd")
        return np.asarray(values, dtype=np.float64)
