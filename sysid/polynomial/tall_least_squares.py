"""Least squares with many columns, at half the cost where these are independent."""

import numpy as np
from scipy.linalg import lstsq, qr, solve_triangular

from sysid.records.arrays import FloatArray

INDEPENDENT = 1e-9
"""Smallest over largest diagonal entry of a triangle whose columns count as independent without a closer look."""


def least_squares(columns: FloatArray, target: FloatArray, *, cond: float) -> FloatArray:
    """Coefficients that combine columns to a target best.

    By a triangle without pivots; where that shows columns near to dependent, by one with pivots.

    Args:
        columns: (N, n), N above n.
        target: (N,).
        cond: Parts of columns below this part of the largest count as dependent on the others.

    Returns:
        Coefficients (n,), of least norm where the columns are dependent.
    """
    n = columns.shape[1]
    triangle = qr(np.column_stack([columns, target]), mode="r", overwrite_a=True, check_finite=False)[0]
    diagonal = np.abs(np.diag(triangle)[:n])
    if diagonal.min(initial=np.inf) > INDEPENDENT * diagonal.max(initial=0.0):
        return np.asarray(solve_triangular(triangle[:n, :n], triangle[:n, n]))
    return np.asarray(lstsq(columns, target, cond=cond, lapack_driver="gelsy")[0])
