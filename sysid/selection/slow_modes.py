"""Slow modes of a candidate: does the input drive them, or are they a disturbance that its free initial state follows?

A ramp, a slow sine or a random walk in the output is fitted by poles on the unit circle with zeros beside them. Such a
model is no worse one step ahead, and says nothing true of gain or bandwidth. An integrator, an undamped resonance and
an unstable plant have poles there too, but their numerator does not vanish at them.
"""

from collections.abc import Sequence

import numpy as np

from sysid.polynomial.correlation import colour, relative_spectrum
from sysid.polynomial.orders import Orders
from sysid.polynomial.polynomial_estimate import directions
from sysid.polynomial.prediction_error import Linearisation
from sysid.records.arrays import FloatArray

TIME_CONSTANTS = 3.0
"""Time constants that a record must hold of a mode: of a slower one it hardly tells more than of an integrator."""


def slow_radius(samples: int) -> float:
    """Modulus from which on a pole is slow, its time constant above a third of a record of so many samples."""
    return 1.0 - TIME_CONSTANTS / max(samples, 2 * TIME_CONSTANTS)


def slow_poles(orders: Orders, theta: FloatArray, radius: float) -> list[tuple[int | None, complex]]:
    """Poles from input to output beyond a radius, one of each pair, with the number of their input; None for all."""
    a, _, _, _, f = orders.split(theta)
    found: list[tuple[int | None, complex]] = []
    for j, denominator in [(None, a), *enumerate(f)]:
        for pole in np.roots(denominator).tolist():
            if abs(pole) > radius and complex(pole).imag >= 0.0:
                found.append((j, complex(pole)))
    return found


def least_drive(at: Linearisation, orders: Orders, errors: Sequence[FloatArray], radius: float) -> float:
    """Least evidence, over the slow poles of a candidate, that the input drives them: a Wald statistic, chi-squared.

    The hypothesis is that the numerator vanishes at the pole, for a common denominator the numerators of all inputs.
    The errors may be coloured: what counts for a slow mode is their spectrum at its frequency. The statistic is
    infinite where there is no slow pole, and divided by its degrees of freedom [Wald1943].

    Args:
        at: The candidate's minimum.
        orders: Its orders.
        errors: Its one-step errors, NaN where the output is missing, of each experiment (N_i, 1).
        radius: Modulus beyond which a pole is slow.
    """
    poles = slow_poles(orders, at.theta, radius)
    if not poles:
        return np.inf
    free = at.errors - orders.count - at.transients
    if free < 1 or not at.cost > 0.0:
        return np.inf
    covariance = _numerator_covariance(at, orders) * (at.sum_of_squares / free)
    whitener, correlations = colour(np.concatenate(errors)[:, 0])
    _, of_b, _, _, _ = orders.ranges
    first_numerator = of_b[0].start
    least = np.inf
    for j, pole in poles:
        inputs = range(len(of_b)) if j is None else [j]
        rows = []
        for k in inputs:
            powers = np.zeros(len(covariance), dtype=complex)
            positions = slice(of_b[k].start - first_numerator, of_b[k].stop - first_numerator)
            powers[positions] = pole ** -(orders.nk[k] + np.arange(orders.nb[k], dtype=float))
            rows.append(powers.real)
            if pole.imag:
                rows.append(powers.imag)
        values = np.array(rows)
        numerators = np.concatenate([at.theta[positions] for positions in of_b])
        value = values @ numerators
        spread = values @ covariance @ values.T * relative_spectrum(whitener, correlations, float(np.angle(pole)))
        statistic = float(value @ np.linalg.pinv(spread, hermitian=True) @ value) / len(value)
        least = min(least, statistic)
    return least


def _numerator_covariance(at: Linearisation, orders: Orders) -> FloatArray:
    """Covariance of all coefficients of B for errors of unit variance."""
    _, of_b, _, _, _ = orders.ranges
    half, _ = directions(at)
    numerators = np.concatenate([half[positions] for positions in of_b])
    return np.asarray(numerators @ numerators.T)
