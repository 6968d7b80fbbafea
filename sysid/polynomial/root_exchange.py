"""Further starts of a search over A and F: a root of A changes places with a root of F."""

from collections.abc import Iterator, Sequence

import numpy as np

from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray


def exchanged_roots(orders: Orders, theta: FloatArray) -> Iterator[FloatArray]:
    """Parameters (p,) with a root of A exchanged for one of F, from parameters (p,).

    B/(A F), the path from the input, hardly tells which root is A's; C/(A D) does, but a search does not carry a root
    from one to the other. The path stays the same with one input, and where all inputs share the root.
    """
    a, b, c, d, f = orders.split(theta)
    f_roots = [np.roots(fj) for fj in f]
    for of_a in _above_axis(np.roots(a)):
        for of_f in _above_axis(np.concatenate(f_roots)):
            # only pairs of complex roots can take the place of pairs; else a pair counts as its real part twice
            whole = of_a.imag > 0.0 and of_f.imag > 0.0
            into_f, into_a = (of_a, of_f) if whole else (of_a.real, of_f.real)
            new_f = [_polynomial(_replaced(roots, of_f, into_f)) for roots in f_roots]
            yield orders.join(_polynomial(_replaced(np.roots(a), of_a, into_a)), b, c, d, new_f)


def _above_axis(roots: np.ndarray) -> list[complex]:
    """Real roots, and of every complex pair the one above the real axis."""
    return [complex(root) for root in roots if root.imag >= 0.0]


def _replaced(roots: np.ndarray, old: complex, new: complex) -> list[complex]:
    """Roots with the nearest one to `old` replaced; of a pair that loses one to a real root, the real part stays."""
    if not len(roots):
        return []
    nearest = complex(roots[np.argmin(np.abs(roots - old))])
    remaining = [complex(root) for root in roots]
    remaining.remove(nearest)
    if not nearest.imag:
        return [*remaining, complex(new.real)]
    remaining.remove(nearest.conjugate())
    if new.imag:
        return [*remaining, new, new.conjugate()]
    return [*remaining, complex(nearest.real), new]


def _polynomial(roots: Sequence[complex]) -> FloatArray:
    return np.atleast_1d(np.asarray(np.poly(np.array(roots)).real, dtype=np.float64))
