"""Stability as a constraint of the minimisation: roots of C, D and F at the unit circle, and steps along it."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import scipy

from sysid.models.polynomials import is_stable
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray

STABILITY_MARGIN = 1e-7  # least distance of the roots of D and F from the unit circle, and of C on long records
SHORT = 1e-3  # distance of a root of C, in 1 / (length of the record), that no record resolves
AT_THE_LIMIT, INSIDE = 4.0, 2.0  # times the least distance: roots that must not move outwards, and those moved inside
DOUBLE = 1e-3  # distance of two roots from 1 or -1 below which they count as a double root
REACH = 0.9  # part of the distance to the unit circle that a step may use


def noise_margin(samples: float) -> float:
    """Least distance of the roots of C from the unit circle: samples cannot tell a longer memory of the errors."""
    return max(STABILITY_MARGIN, SHORT / samples)


def admissible(orders: Orders, theta: FloatArray, samples: float = np.inf, factor: float = 1.0) -> bool:
    """Whether C, D and every F have their roots inside the unit circle, by a factor times their least distances.

    That of C depends on the samples of the longest experiment.
    """
    if not np.isfinite(theta).all():
        return False
    _, _, c, d, f = orders.split(theta)
    if not is_stable(c, factor * noise_margin(samples)):
        return False
    return all(is_stable(polynomial, factor * STABILITY_MARGIN) for polynomial in (d, *f))


def move_roots_inside(orders: Orders, theta: FloatArray, origin: FloatArray, samples: float = np.inf) -> FloatArray:
    """Move the roots of C, D and F inside that leave the stable region; the parameters with them (p,).

    A step from `origin` may use up to `REACH` of the distance to the unit circle: roots that arrive there at once stay.
    """
    if admissible(orders, theta, samples):
        return theta
    a, b, c, d, f = orders.split(theta)
    _, _, origin_c, origin_d, origin_f = orders.split(origin)
    inner_c = _with_roots_inside(c, origin_c, noise_margin(samples))
    inner_d = _with_roots_inside(d, origin_d, STABILITY_MARGIN)
    inner_f = [_with_roots_inside(fj, origin_fj, STABILITY_MARGIN) for fj, origin_fj in zip(f, origin_f, strict=True)]
    return orders.join(a, b, inner_c, inner_d, inner_f)


def _with_roots_inside(polynomial: FloatArray, origin: FloatArray, margin: float) -> FloatArray:
    """Polynomial with the roots moved inside that leave the region, after a step from `origin`."""
    origin_distance = 1.0 - np.abs(np.roots(origin)).max(initial=0.0)
    distance = max(INSIDE * margin, (1.0 - REACH) * origin_distance)
    if is_stable(polynomial, distance):
        return polynomial
    roots = np.roots(polynomial)
    while True:
        moved = np.poly(roots * (1.0 - distance) / np.maximum(np.abs(roots), 1.0 - distance)).real
        # zeros at the end of a polynomial are no roots
        inner = np.concatenate((moved, np.zeros(len(polynomial) - len(moved))))
        if is_stable(inner, margin):
            return inner
        # several roots that meet need more distance: rounding moves them
        distance = min(2.0 * distance, 0.999)


def outward(orders: Orders, theta: FloatArray, samples: float = np.inf) -> tuple[FloatArray, FloatArray]:
    """Directions in the parameters that lead out of the stable region (rows, p), and how far it reaches (rows,).

    A real root leaves where the polynomial changes its sign at 1 or -1, a pair where its product exceeds 1. A double
    real root can leave both ways; derivatives of single roots do not exist there. To first order, a step stays inside
    where its product with no row exceeds the reach.
    """
    _, _, c, d, f = orders.split(theta)
    _, _, of_c, of_d, of_f = orders.ranges
    rows, reach = [], []
    for polynomial, positions in zip((c, d, *f), (of_c, of_d, *of_f), strict=True):
        if len(polynomial) == 1:
            continue
        margin = noise_margin(samples) if polynomial is c else STABILITY_MARGIN
        for change, distance in _outward_derivatives(polynomial, margin):
            row = np.zeros(orders.count)
            row[positions] = change
            rows.append(row)
            reach.append(REACH * max(distance, 0.0))
    # no row where there are no parameters: -1 would leave their number undetermined
    return np.array(rows).reshape(len(rows), orders.count), np.array(reach)


def _outward_derivatives(polynomial: FloatArray, margin: float) -> Iterator[tuple[FloatArray, float]]:
    """Quantities that must stay below a limit: derivatives by the coefficients after the first (n,), and distances.

    These quantities are the signed values near 1 and -1, and the products of pairs.
    """
    n = len(polynomial) - 1
    limit = 1.0 - INSIDE * margin
    roots = _roots(polynomial)
    near = np.abs(roots) > 1.0 - AT_THE_LIMIT * margin
    pairs = [(1.0, -2.0 * root.real, abs(root) ** 2) for root in roots[roots.imag > 0.0].tolist()]
    some_near = bool(near.any())
    for end in (1.0, -1.0):
        powers = _powers_at_limit(n, end, limit)
        yield -powers[1:], float(powers @ polynomial)
        # nearly always every root is far from the circle, and nothing below applies
        if not some_near:
            continue
        close = np.abs(roots - end) < DOUBLE
        if (close & near).any() and close.sum() > 1 and not (roots.imag[close & near] > 0.0).any():
            outermost = roots[close][np.argsort(-np.abs(roots[close]))[:2]]
            pairs.append(tuple(np.poly(outermost).real.tolist()))
    for pair in pairs:
        yield _pair_product_slope(polynomial, pair), limit**2 - pair[2]


def _roots(polynomial: FloatArray) -> np.ndarray:
    """Roots (n,) of a monic polynomial: `numpy.roots` without its search for zeros at the ends, in half of its time."""
    companion = np.eye(len(polynomial) - 1, k=-1)
    companion[0] = -polynomial[1:]
    return np.asarray(np.linalg.eigvals(companion))


@lru_cache(maxsize=256)
def _powers_at_limit(n: int, end: float, limit: float) -> FloatArray:
    """Weights of a polynomial's coefficients (n + 1,) in its value at the limit beside 1 or -1, signed.

    A real root crosses the limit where that value changes its sign; end^n makes it positive inside.
    """
    powers: FloatArray = (end * limit) ** np.arange(n + 1, dtype=float)[::-1] * end**n
    powers.setflags(write=False)
    return powers


def _pair_product_slope(polynomial: FloatArray, pair: tuple[float, float, float]) -> FloatArray:
    """Derivative of the product of a pair of roots, factor z^2 + s z + t, by the coefficients after the first (n,)."""
    n = len(polynomial) - 1
    # remainders of z^(n-1), ..., z, 1 by the pair: coefficients of z and 1 (2, n)
    remainders = [(0.0, 1.0)]
    for _ in range(n - 1):
        s, t = remainders[-1]
        remainders.append((t - pair[1] * s, -pair[2] * s))
    changes = np.array(remainders[::-1]).T
    # p + dp = (rest + ...)(pair + s z + t): dp = rest (s z + t) modulo the pair; rest is the quotient of p by the pair
    rest: list[float] = []
    before, last = 0.0, 0.0
    for coefficient in polynomial[: n - 1].tolist():
        before, last = last, coefficient + (-pair[2] * before - pair[1] * last)
        rest.append(last)
    images = np.column_stack((changes[:, : n - 1] @ rest, changes[:, 1:] @ rest))
    slope: FloatArray = np.linalg.lstsq(images, changes, rcond=None)[0][1]
    return slope


def constrained_step(
    values: FloatArray, g: FloatArray, rows: FloatArray, reach: FloatArray | float = 0.0
) -> FloatArray:
    """Minimise s' diag(values) s / 2 - g' s subject to rows @ s <= reach, by least distance [LawsonHanson1974]."""
    free = g / values
    excess = rows @ free - reach
    if not (excess > 0.0).any():
        return free
    # in coordinates in which the criterion is a distance from the free step, limits of unit length
    root = np.sqrt(values)
    normals = rows / root
    lengths = np.linalg.norm(normals, axis=1)
    kept = lengths > 0.0
    normals, excess = -normals[kept] / lengths[kept, None], excess[kept] / lengths[kept]
    size = excess.max()
    dual_columns = np.vstack((normals.T, excess / size))
    dual_target = np.append(np.zeros(len(values)), 1.0)
    if not np.isfinite(dual_columns).all():
        # division by a pair overflows at orders of hundreds: the caller moves poles beyond the limit back
        return free
    try:
        forces, _ = scipy.optimize.nnls(dual_columns, dual_target)
    except RuntimeError:
        # not converged: the caller moves poles beyond the limit back
        return free
    remainder = 1.0 - excess / size @ forces
    if not remainder > 0.0:
        # limits that contradict each other within rounding: the caller moves poles beyond the limit back
        return free
    return np.asarray(free + size * (normals.T @ forces) / remainder / root)
