"""Whether polynomials of an estimate nearly share a root, in standard deviations of what holds the roots apart."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sysid.records.arrays import ComplexArray, FloatArray

SHARED_ROOT = 20.0
"""Squared distance from a common root, in standard deviations, up to which intervals are known to be too short.

A coefficient near a common root follows from a ratio with this distance below the line. Fieller's interval of such a
ratio is 1 / (1 - 1.96^2 / strength) times as wide as the linear one: by a quarter at 20, without limit at 4.
Measured: of 200 records of 80, 200 and 800 samples
each, 95 % intervals of oe(2, 2) held in 95, 91 and 94 % above it and in 81, 76 and 81 % below; where all roots of a
system of armax(2, 2, 2) but one nearly cancel, in 60, 71 and 83 %, all of them below.
"""


@dataclass(frozen=True)
class EstimatedPolynomial:
    """A polynomial and where its coefficients lie among the parameters.

    Attributes:
        coefficients: Of falling powers of z (n + 1,).
        places: Positions of the estimated ones, which are the last, among the parameters.
    """

    coefficients: FloatArray
    places: slice

    @property
    def known(self) -> int:
        """Number of leading coefficients that are no parameters."""
        return len(self.coefficients) - (self.places.stop - self.places.start)

    def gradient(self, z: complex, parameters: int) -> ComplexArray:
        """Derivatives of the value at z with respect to all parameters (p,)."""
        powers = np.zeros(parameters, complex)
        powers[self.places] = np.vander([z], len(self.coefficients))[0, self.known :]
        return powers


SEPARATED = 2.0
"""Standard deviations between a root and its neighbours in the same polynomial up to which its covariance is none."""


def shared_root_strength(polynomials: Sequence[EstimatedPolynomial], covariance: FloatArray) -> float:
    """Wald statistic against one root that all polynomials share; infinite if one of them has no root.

    At each root of one polynomial the values of the others are compared with their covariance, propagated from that of
    the parameters (p, p); the least counts. Two roots that are nearly the same move with the square root of the
    coefficients: linear propagation does not hold for them, and the roots of the others tell.

    Args:
        polynomials: Two or more.
        covariance: Of all parameters.
    """
    if any(len(polynomial.coefficients) == 1 for polynomial in polynomials):
        return np.inf
    places = range(len(polynomials))
    compared = [one for source in places for one in _at_roots(source, polynomials, covariance)]
    separated = [strength for strength, is_separated in compared if is_separated]
    return min(separated, default=np.inf)


def _at_roots(
    source: int, polynomials: Sequence[EstimatedPolynomial], covariance: FloatArray
) -> Iterator[tuple[float, bool]]:
    """Statistic at each root of one of the polynomials, and whether the root is separated from its neighbours."""
    own = polynomials[source]
    others = [polynomial for k, polynomial in enumerate(polynomials) if k != source]
    slope = np.polyder(own.coefficients)
    roots = np.roots(own.coefficients)
    for k, root in enumerate(roots):
        # one of each conjugate pair
        if root.imag < 0.0:
            continue
        with np.errstate(all="ignore"):
            moves = -own.gradient(root, len(covariance)) / np.polyval(slope, root)
        if not np.isfinite(moves).all():
            # a double root has no derivative, and is separated from nothing
            continue
        # rounding may leave the variance of a well-known root below zero
        deviation = np.sqrt(max(float(np.real(moves @ covariance @ moves.conj())), 0.0))
        nearest = np.abs(np.delete(roots, k) - root).min(initial=np.inf)
        is_separated = nearest > SEPARATED * deviation
        values, gradients = [], []
        for other in others:
            values.append(np.polyval(other.coefficients, root))
            of_root = np.polyval(np.polyder(other.coefficients), root)
            gradients.append(other.gradient(root, len(covariance)) + of_root * moves)
        strength = _wald(np.array(values), np.array(gradients), covariance, is_real=root.imag == 0.0)
        yield strength, is_separated


def _wald(values: ComplexArray, gradients: ComplexArray, covariance: FloatArray, *, is_real: bool) -> float:
    """Statistic of values (m,) against zero; real and imaginary parts count unless the values are real."""
    distance, slopes = values.real, gradients.real
    if not is_real:
        distance = np.concatenate((distance, values.imag))
        slopes = np.concatenate((slopes, gradients.imag))
    spread = slopes @ covariance @ slopes.T
    if not np.isfinite(spread).all():
        return np.inf
    variances = np.diag(spread)
    # known exactly, but for rounding
    if not (variances > 0.0).all():
        return np.inf
    scale = np.sqrt(variances)
    relative = distance / scale
    statistic = float(relative @ np.linalg.pinv(spread / np.outer(scale, scale), hermitian=True) @ relative)
    return max(statistic, 0.0)
