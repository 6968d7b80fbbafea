"""Computations on the matrices of a state-space model: balanced truncation and transmission zeros."""

from functools import lru_cache

import numpy as np
import scipy

from sysid.records.arrays import ComplexArray, FloatArray
from sysid.records.errors import SysidError
from sysid.records.singular_values import svd


@lru_cache(maxsize=1)
def schur_form(matrix: bytes, order: int) -> tuple[ComplexArray, ComplexArray]:
    """Complex Schur form T and basis U, A = U T U*, of a matrix (n, n) by its bytes: kept for its next frequencies."""
    triangle, basis = scipy.linalg.schur(np.frombuffer(matrix).reshape(order, order), output="complex")
    return triangle, basis


def balanced_truncation(
    A: FloatArray, B: FloatArray, C: FloatArray, tolerance: float, order: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Keep the states with the largest Hankel singular values [Moore1981].

    The truncated response differs from the whole one by at most twice the sum of the dropped singular values, at any
    frequency. States with a singular value below `tolerance` times the largest, or beyond `order`, are dropped.
    Returned are the reduced A, B, C and all Hankel singular values, largest first.
    """
    if len(A) == 0:
        return A, B, C, np.zeros(0)
    radius = np.abs(np.linalg.eigvals(A)).max()
    if radius >= 1.0:
        raise SysidError(f"balanced truncation needs a stable model, given one with spectral radius {radius:.6g}")
    controllability = _factor(scipy.linalg.solve_discrete_lyapunov(A, B @ B.T))
    observability = _factor(scipy.linalg.solve_discrete_lyapunov(A.T, C.T @ C))
    # from factors: the product of the Gramians would lose half of the digits of small singular values
    left, hankel, right = svd(observability.T @ controllability)
    keep = int((hankel > tolerance * hankel[0]).sum())
    if order is not None:
        keep = min(keep, order)
    scale = 1.0 / np.sqrt(hankel[:keep])
    to_balanced = scale[:, None] * (left[:, :keep].T @ observability.T)
    from_balanced = controllability @ right[:keep].T * scale
    return to_balanced @ A @ from_balanced, to_balanced @ B, C @ from_balanced, hankel


def _factor(gramian: FloatArray) -> FloatArray:
    """Return a factor L of a positive semidefinite matrix, L L' = gramian."""
    values, vectors = np.linalg.eigh(0.5 * (gramian + gramian.T))
    return vectors * np.sqrt(np.maximum(values, 0.0))


Matrices = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def transmission_zeros(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> ComplexArray:
    """Zeros, largest modulus first, by orthogonal reduction to an invertible direct term [EmamiNaeini1982].

    A plain generalised eigenvalue problem scatters zeros at infinity (delays!) over large finite values; the reduction
    removes them first. It works for any numbers of inputs and outputs.
    """
    size = max(float(np.linalg.norm(A)), 1.0) if A.size else 1.0
    # scaling of inputs and outputs does not change the zeros
    into, out = size / _norm(B, D), size / _norm(C, D)
    scaled = (A, B * into, C * out, D * into * out)
    # of a singular value that counts as zero
    floor = 1e-12 * size * max(1, len(A))
    a, b2, c2, d2 = _without_infinite(*scaled, floor)
    # if inputs outnumber outputs, the dual reduction removes the remaining zeros at infinity
    at, ct, bt, dt = _without_infinite(a.T, c2.T, b2.T, d2.T, floor)
    if not len(at):
        return np.zeros(0, dtype=complex)
    # with D invertible the zeros are the eigenvalues of A - B D^-1 C
    core = at.T - bt.T @ np.linalg.solve(dt.T, ct.T) if dt.size else at.T
    zeros = np.linalg.eigvals(core).astype(complex)
    return zeros[np.argsort(-np.abs(zeros), kind="stable")]


def _norm(matrix: FloatArray, D: FloatArray) -> float:
    """Norm of an input or output matrix; where it is zero, the norm of D, at least one."""
    norm = float(np.linalg.norm(matrix)) if matrix.size else 0.0
    return norm if norm > 0.0 else max(float(np.linalg.norm(D)), 1.0)


def _without_infinite(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray, floor: float) -> Matrices:
    """The system reduced to one of the same finite zeros with a D of full row rank [EmamiNaeini1982]."""
    while len(A) and len(C):
        left, values, _ = svd(D)
        rank = int((values > floor).sum())
        if rank == len(D):
            break
        D, C = left.T @ D, left.T @ C
        _, values, right = svd(C[rank:])
        removed = int((values > floor).sum())
        D, C = D[:rank], C[:rank]
        if removed == 0:
            break
        # remove the states observed by outputs without direct term: they become outputs of the rest
        basis = np.vstack((right[removed:], right[:removed])).T
        A, B, C = basis.T @ A @ basis, basis.T @ B, C @ basis
        keep = len(A) - removed
        C = np.vstack((C[:, :keep], A[keep:, :keep]))
        D = np.vstack((D, B[keep:]))
        A, B = A[:keep, :keep], B[:keep]
    return A, B, C, D
