"""Stability as a constraint of the minimisation: roots of C, D and F at the unit circle, and steps along it."""

from collections.abc import Iterator

import numpy as np
import scipy

from sysid.models.polynomials import is_stable
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray

STABILITY_MARGIN = 1e-7  # least distance of the roots of C, D and F from the unit circle
AT_THE_LIMIT = 4.0 * STABILITY_MARGIN  # distance of roots that a step must not move outwards
DOUBLE = 1e-3  # distance of two roots from 1 or -1 below which they count as a double root
REACH = 0.9  # part of the distance to the unit circle that a step may use
INSIDE = 2.0 * STABILITY_MARGIN  # distance at which roots from beyond the limit are placed


def admissible(orders: Orders, theta: FloatArray) -> bool:
    """Whether C, D and every F have their roots inside the unit circle."""
    if not np.isfinite(theta).all():
        return False
    _, _, c, d, f = orders.split(theta)
    return all(is_stable(polynomial, STABILITY_MARGIN) for polynomial in (c, d, *f))


def pulled_in(orders: Orders, theta: FloatArray, origin: FloatArray) -> FloatArray:
    """The same parameters (p,) with roots of C, D and F moved inside, where they leave the region or nearly do.

    A step from `origin` may use up to `REACH` of the distance to the unit circle: roots that arrive there at once stay.
    """
    a, b, c, d, f = orders.split(theta)
    _, _, c0, d0, f0 = orders.split(origin)
    return orders.join(a, b, _inside(c, c0), _inside(d, d0), [_inside(*pair) for pair in zip(f, f0, strict=True)])


def _inside(polynomial: FloatArray, origin: FloatArray) -> FloatArray:
    distance = 1.0 - np.abs(np.roots(origin)).max(initial=0.0)
    limit = 1.0 - max(INSIDE, (1.0 - REACH) * distance)
    if is_stable(polynomial, 1.0 - limit):
        return polynomial
    roots = np.roots(polynomial)
    inner = np.poly(roots * limit / np.maximum(np.abs(roots), limit)).real
    # zeros at the end of a polynomial are no roots
    return np.concatenate((inner, np.zeros(len(polynomial) - len(inner))))


def outward(orders: Orders, theta: FloatArray) -> FloatArray:
    """Directions in the parameters that lead out of the stable region, from the roots at the limit (rows, p).

    A real root leaves where the polynomial changes its sign at 1 or -1, a pair where its product exceeds 1. A double
    real root can leave both ways; derivatives of single roots do not exist there.
    """
    _, _, c, d, f = orders.split(theta)
    rows = []
    begin = orders.na + sum(orders.nb)
    for polynomial in (c, d, *f):
        n = len(polynomial) - 1
        for change in _ways_out(polynomial) if n and not is_stable(polynomial, AT_THE_LIMIT) else ():
            row = np.zeros(orders.count)
            row[begin : begin + n] = change
            rows.append(row)
        begin += n
    return np.array(rows).reshape(-1, orders.count)


def _ways_out(polynomial: FloatArray) -> Iterator[FloatArray]:
    """Derivatives by the coefficients after the first (n,): of the signed values at 1 and -1, and of products."""
    n = len(polynomial) - 1
    roots = np.roots(polynomial)
    near = np.abs(roots) > 1.0 - AT_THE_LIMIT
    pairs = [np.poly([root, root.conjugate()]).real for root in roots[near & (roots.imag > 0.0)]]
    for end in (1.0, -1.0):
        close = np.abs(roots - end) < DOUBLE
        if (close & near).any():
            yield -(end ** np.arange(n, dtype=float)[::-1]) * end**n
            if close.sum() > 1 and not (roots.imag[close & near] > 0.0).any():
                pairs.append(np.poly(roots[close][np.argsort(-np.abs(roots[close]))[:2]]).real)
    for pair in np.array(pairs, dtype=np.float64):
        rest = np.polydiv(polynomial, pair)[0]
        # p + dp = (rest + ...)(pair + s z + t): dp = rest (s z + t) modulo the pair
        images = [
            _remainder(np.asarray(np.convolve(rest, unit), dtype=np.float64), pair) for unit in ([1.0, 0.0], [1.0])
        ]
        changes = np.column_stack([_remainder(unit, pair) for unit in np.eye(n)])
        yield np.linalg.lstsq(np.column_stack(images), changes, rcond=None)[0][1]


def _remainder(polynomial: FloatArray, divisor: FloatArray) -> FloatArray:
    """Remainder by a divisor of degree 2, two coefficients (2,)."""
    out = np.polydiv(polynomial, divisor)[1]
    return np.concatenate((np.zeros(2), out))[-2:]


def constrained_step(values: FloatArray, g: FloatArray, rows: FloatArray) -> FloatArray:
    """Minimise s' diag(values) s / 2 - g' s subject to rows @ s <= 0."""
    free = g / values
    if not (rows @ free > 0.0).any():
        return free
    # the dual problem: forces f >= 0 of the constraints, s = free - diag(values)^-1 rows' f
    root = np.sqrt(values)
    sides = (rows / root).T
    lengths = np.linalg.norm(sides, axis=0)
    kept = lengths > 0.0
    try:
        forces, _ = scipy.optimize.nnls(sides[:, kept] / lengths[kept], root * free)
    except RuntimeError:
        # not converged: the caller moves poles beyond the limit back
        return free
    return np.asarray(free - (sides[:, kept] / lengths[kept]) @ forces / root)
