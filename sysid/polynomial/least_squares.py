"""Linear least squares with rank, condition and covariance."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd

SQUARE_SAFE = 1e5  # condition up to which normal equations, which square it, keep six digits


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solution of min |Y - Phi X|.

    Attributes:
        solution: X (p, m), of least norm (in scaled columns) if Phi is rank deficient.
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

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Diagnostics of an estimate that needs no search."""
        return {"condition": self.condition, "rank": self.rank, "iterations": 0, "converged": True}

    def rank_message(self, columns: str = "regressors") -> list[str]:
        """Message on a rank deficiency, if there is one."""
        p = len(self.solution)
        if self.rank >= p:
            return []
        return [f"the {columns} have rank {self.rank} for {p} parameters: this is the least-norm solution"]


def solve(phi: FloatArray, target: FloatArray) -> LeastSquares:
    """Solve for regressors (rows, p), rows >= p, and right-hand sides (rows, m), by the SVD of the triangle of [Phi Y].

    This is faster than the SVD of Phi, and as accurate.
    """
    p = phi.shape[1]
    columns = np.hstack((phi, target))
    lengths = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    lengths[lengths == 0.0] = 1.0
    columns /= lengths
    return solve_triangle(triangular_factor(columns), lengths, p, len(phi))


def solve_blocks(blocks: Callable[[], Iterable[FloatArray]], p: int) -> LeastSquares:
    """Solve as `solve` does, in the memory of one block of rows and of the triangle.

    Args:
        blocks: Computes the blocks [Phi Y] (rows, p + m) anew for each pass: for normal equations, and for QR updates
            where these would cost too many digits.
        p: Columns of Phi; all blocks together have at least as many rows.
    """
    triangle, lengths, rows = triangle_of_blocks(blocks)
    return solve_triangle(triangle, lengths, p, rows)


def triangle_of_blocks(blocks: Callable[[], Iterable[FloatArray]]) -> tuple[FloatArray, FloatArray, int]:
    """`scaled_triangle` of columns that come as blocks of rows, computed anew for each pass, and the number of rows."""
    gram, rows = np.zeros((0, 0)), 0
    for block in blocks():
        gram = gram + block.T @ block if rows else block.T @ block
        rows += len(block)
    lengths = np.sqrt(np.diag(gram))
    lengths[lengths == 0.0] = 1.0
    triangle = _triangle_of_gram(gram / np.outer(lengths, lengths), None)
    if triangle is None:
        triangle = np.zeros((0, len(lengths)))
        for block in blocks():
            triangle = np.asarray(np.linalg.qr(np.vstack((triangle, block / lengths)), mode="r"))
    return triangle, lengths, rows


def refuse_overflow(products: FloatArray) -> None:
    """Refuse products of regressors that are not finite.

    Rounding moves the roots of a polynomial of hundreds of coefficients out of the unit circle: signals that are
    filtered by its inverse then grow beyond any number.
    """
    if not np.isfinite(products).all():
        raise SysidError("the regressors overflow: rounding makes filters of so many coefficients unstable; use fewer")


def solve_triangle(triangle: FloatArray, lengths: FloatArray, p: int, rows: int) -> LeastSquares:
    """Solve from the triangle of [Phi Y], its columns divided by their lengths, as many as Phi has p."""
    refuse_overflow(triangle)
    if len(triangle) < p:
        # fewer equations than unknowns have the solution of least norm, as those that lack rank
        triangle = np.pad(triangle, ((0, p - len(triangle)), (0, 0)))
    triangle[:, p:] *= lengths[p:]
    left, values, right = svd(triangle[:p, :p])
    largest = float(values[0]) if p else 0.0
    smallest = float(values[-1]) if p else 0.0
    condition = largest / smallest if smallest > 0.0 else np.inf
    # the usual cut-off of a numerical rank, for the rows of Phi and not those of the triangle
    kept = values > max(rows, p) * np.finfo(float).eps * largest
    inverse = np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0)
    backward = (right.T * inverse) / lengths[:p, None]
    # what remains of Y: below the triangle of Phi, and along the directions that the rank lacks
    remainder = np.vstack((triangle[p:, p:], left.T[~kept] @ triangle[:p, p:]))
    return LeastSquares(
        solution=backward @ (left.T @ triangle[:p, p:]),
        inverse_gram=backward @ backward.T,
        residual_gram=remainder.T @ remainder,
        rank=int(kept.sum()),
        condition=condition,
    )


def triangular_factor(columns: FloatArray, guarded: int | None = None) -> FloatArray:
    """R of the QR factorisation, (min(rows, columns), columns), of columns of about equal length, without forming Q.

    Normal equations give the same triangle several times faster; QR takes over where the squared condition number would
    cost too many digits: that of the `guarded` leading columns, or of all.
    """
    triangle = _triangle_of_gram(columns.T @ columns, guarded)
    return np.asarray(np.linalg.qr(columns, mode="r")) if triangle is None else triangle


def _triangle_of_gram(gram: FloatArray, guarded: int | None) -> FloatArray | None:
    """The triangle of columns of about unit length from their products; None if that would cost too many digits."""
    try:
        triangle = np.linalg.cholesky(gram).T
    except np.linalg.LinAlgError:
        return None
    diagonal = np.abs(np.diag(triangle))[:guarded]
    return None if diagonal.min(initial=1.0) * SQUARE_SAFE < 1.0 else np.asarray(triangle)


def scaled_triangle(columns: FloatArray, guarded: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Triangular factor of columns (rows, k) divided by their lengths, and these lengths (k,), 1 for a zero column."""
    gram = columns.T @ columns
    lengths = np.sqrt(np.diag(gram))
    lengths[lengths == 0.0] = 1.0
    triangle = _triangle_of_gram(gram / np.outer(lengths, lengths), guarded)
    if triangle is None:
        triangle = np.asarray(np.linalg.qr(columns / lengths, mode="r"))
    return triangle, lengths


INDEPENDENT = 1e-9  # ratio of extreme diagonal entries of a triangle above which its columns count as independent

REFINED = 1e-5
"""Largest refinement of coefficients, relative to the largest, after which the next one would be rounding."""


def tall_least_squares(columns: FloatArray, target: FloatArray, *, cond: float) -> FloatArray:
    """Least squares with many columns (N, n), N > n: by normal equations, refined once; where that changes much, by QR.

    They cost less than half of a QR, and are as accurate after the refinement [Bjorck1987]. Returned are the
    coefficients (n,), of least norm if columns are dependent by the relative cut-off `cond`.
    """
    n = columns.shape[1]
    table = np.column_stack([columns, target])
    # Squares of an unstable model's response would overflow; a power of two rounds nothing.
    table = table * 2.0 ** -np.frexp(max(table.max(), -table.min()))[1]
    triangle, lengths = scaled_triangle(table, guarded=n)
    if _independent(triangle, n):
        scaled = scipy.linalg.solve_triangular(triangle[:n, :n], triangle[:n, n]) * lengths[n]
        errors = table[:, n] - table[:, :n] @ (scaled / lengths[:n])
        gradient = errors @ table[:, :n] / lengths[:n]
        halfway = scipy.linalg.solve_triangular(triangle[:n, :n], gradient, trans="T")
        step = scipy.linalg.solve_triangular(triangle[:n, :n], halfway)
        if np.abs(step).max(initial=0.0) <= REFINED * np.abs(scaled).max(initial=0.0):
            return np.asarray((scaled + step) / lengths[:n])
        triangle = np.asarray(np.linalg.qr(table / lengths, mode="r"))
        if _independent(triangle, n):
            scaled = scipy.linalg.solve_triangular(triangle[:n, :n], triangle[:n, n]) * lengths[n]
            return np.asarray(scaled / lengths[:n])
    return np.asarray(scipy.linalg.lstsq(columns, target, cond=cond, lapack_driver="gelsy")[0])


def _independent(triangle: FloatArray, n: int) -> bool:
    """Whether the leading n columns are independent, by the diagonal of their triangle."""
    diagonal = np.abs(np.diag(triangle)[:n])
    return bool(diagonal.min(initial=np.inf) > INDEPENDENT * diagonal.max(initial=0.0))
