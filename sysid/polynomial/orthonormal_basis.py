"""Orthonormal rational functions with given poles, and linear systems written in them."""

from dataclasses import dataclass

import numpy as np

from sysid.records.arrays import ComplexArray, FloatArray

NEGLIGIBLE = 1e-18  # last increment, relative to the sum
DOUBLINGS = 64  # sums of 2^64 terms: enough for poles that round to the unit circle


@dataclass(frozen=True, eq=False)
class AllPass:
    """States of a cascade of all-pass filters: [F b; c d] is orthogonal [Ninness1997].

    The functions (zI - F)^-1 b are orthonormal, and span every strictly proper function with the poles of F.

    Attributes:
        F: State matrix (n, n), lower block triangular.
        b: Input vector (n,).
        c: Output vector (n,).
        d: Direct term.
    """

    F: FloatArray
    b: FloatArray
    c: FloatArray
    d: float

    def then(self, other: "AllPass") -> "AllPass":
        """Cascade of this filter and another one after it."""
        upper = np.zeros((len(self.F), len(other.F)))
        F = np.block([[self.F, upper], [np.outer(other.b, self.c), other.F]])
        b = np.concatenate((self.b, other.b * self.d))
        c = np.concatenate((other.d * self.c, other.c))
        return AllPass(F, b, c, self.d * other.d)


def all_pass(poles: ComplexArray) -> AllPass:
    """All-pass filter with these poles (n,), inside the unit circle and complex ones in pairs."""
    out = AllPass(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0)
    # eigenvalues of a real matrix: a pair is exactly conjugate
    for pole in poles[poles.imag >= 0.0]:
        section = _pair(pole) if pole.imag else _single(float(pole.real))
        out = out.then(section)
    return out


def _single(pole: float) -> AllPass:
    # sqrt(1 - pole^2) without cancellation near the unit circle
    side = np.sqrt((1.0 - pole) * (1.0 + pole))
    return AllPass(np.array([[pole]]), np.array([side]), np.array([side]), -pole)


def _pair(pole: complex) -> AllPass:
    """Two states whose Gramian is the identity, by the Cholesky factor of the companion form's."""
    a1, a2 = -2.0 * pole.real, abs(pole) ** 2
    ratio = -a1 / (1.0 + a2)
    power = (1.0 + a2) / ((1.0 - a2) * abs(1.0 - pole) ** 2 * abs(1.0 + pole) ** 2)
    lower = np.sqrt(power) * np.array([[1.0, 0.0], [ratio, np.sqrt(1.0 - ratio**2)]])
    F = np.linalg.solve(lower, np.array([[-a1, -a2], [1.0, 0.0]]) @ lower)
    b = np.linalg.solve(lower, np.array([1.0, 0.0]))
    # the last row of the orthogonal matrix is orthogonal to the others
    last = np.cross(*np.column_stack((F, b)))
    last /= np.linalg.norm(last)
    return AllPass(F, b, last[:2], float(last[2]))


def stein(A: FloatArray, F: FloatArray, Q: FloatArray) -> FloatArray:
    """Solve S = A S F' + Q (n, ..., k) along the first and last axis by doubling [Smith1968]; A and F stable.

    S is the sum of A^i Q F'^i; each round doubles the number of its terms.
    """
    n, k = Q.shape[0], Q.shape[-1]
    shape = Q.shape
    out = Q
    left, right = A, F.T
    for _ in range(DOUBLINGS):
        term = (left @ out.reshape(n, -1)).reshape(-1, k) @ right
        out = out + term.reshape(shape)
        if np.abs(term).max(initial=0.0) <= NEGLIGIBLE * np.abs(out).max(initial=0.0):
            break
        left, right = left @ left, right @ right
    return out


def gramian(F: FloatArray, Q: FloatArray) -> FloatArray:
    """Solve P = F P F' + Q for a stack of right-hand sides Q (..., k, k), as `stein`; F stable."""
    return np.moveaxis(stein(F, F, np.moveaxis(Q, -2, 0)), 0, -2)
