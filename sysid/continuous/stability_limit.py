"""Stability as a constraint of the search: poles beside the imaginary axis, and steps along it."""

import numpy as np

from sysid.records.arrays import FloatArray

MARGIN = 1e-9  # least distance of poles from the imaginary axis, times dt
INSIDE = 2.0  # times the margin: distance of poles that are moved inside
REACH = 0.9  # part of the distance to the axis that a step may use
DOUBLE = 1e-6  # |A'(s)| relative to the sum of its terms, below which poles coincide and have no derivative


def distance_to_axis(a: FloatArray) -> float:
    """Least distance of the poles from the imaginary axis in rad/s, negative if unstable; `a` of rising powers."""
    return -float(np.roots(a[::-1]).real.max(initial=-np.inf))


def moved_inside(a: FloatArray, origin: FloatArray, dt: float) -> FloatArray:
    """Monic denominator of rising powers, poles beyond the limit moved back to it.

    A step from `origin` may use up to `REACH` of the distance to the axis: poles that arrive there at once stay.
    """
    least = max(INSIDE * MARGIN / dt, (1.0 - REACH) * distance_to_axis(origin))
    poles = np.roots(a[::-1])
    if (poles.real <= -least).all():
        return a
    inner = np.minimum(poles.real, -least) + 1j * poles.imag
    return np.atleast_1d(np.poly(inner).real)[::-1]


def outward(a: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
    """Derivatives of real parts of poles by the coefficients of a monic `a` (k, n), and how far they reach (k,).

    A pole s moves by ds = -s^i / A'(s) da_i. To first order a step stays stable where its product with no row exceeds
    the reach.
    """
    n = len(a) - 1
    slopes_of_a = a[1:] * np.arange(1, n + 1)
    rows, reach = [], []
    for pole in np.roots(a[::-1]):
        if pole.imag < 0.0:
            continue
        powers = pole ** np.arange(n)
        slope = slopes_of_a @ powers
        if abs(slope) <= DOUBLE * (np.abs(slopes_of_a) @ np.abs(powers)):
            continue
        rows.append(-(powers / slope).real)
        reach.append(REACH * max(-pole.real - INSIDE * MARGIN / dt, 0.0))
    return np.reshape(rows, (len(rows), n)), np.array(reach)
