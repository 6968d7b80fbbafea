"""Denominators in s from discrete-time models: starts for resonances that state-variable filters do not reach."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from sysid.polynomial.initial_estimates import check_room_to_start, oe_initial_estimates
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError

FASTEST = 10.0  # modulus of a pole times dt, at most: poles at z = 0 have no counterpart in s


def sampled_denominators(experiments: Sequence[IOData], order: int, delay: float) -> Iterator[FloatArray]:
    """Denominators of rising powers, monic (order + 1,), from initial output-error estimates of the sampled system.

    A held or linear input makes poles z = exp(s dt) of poles s, whatever the numerator is [AstromWittenmark1997, sec.
    2.3]: the principal logarithm leads back. Records too short for such estimates have none.
    """
    dt = experiments[0].dt
    # a fraction of a sample as delay, a direct term or a linear input: at most one coefficient more than poles
    orders = Orders(na=0, nb=(order + 1,), nc=0, nd=0, nf=(order,), nk=(math.floor(delay / dt),))
    try:
        check_room_to_start(experiments, orders)
    except SysidError:
        return
    for start in oe_initial_estimates(experiments, orders):
        *_, (f,) = orders.split(start.theta)
        yield _in_continuous_time(np.roots(f), order, dt)


def _in_continuous_time(poles: np.ndarray, order: int, dt: float) -> FloatArray:
    """Denominator with the poles log(z) / dt."""
    s = np.full(order, -FASTEST, dtype=complex)
    moved = poles[np.abs(poles) > math.exp(-FASTEST)]
    s[: len(moved)] = np.log(moved.astype(complex))
    # a negative real pole is the sample of no real one: a real pole about as fast takes its place
    negative = np.abs(s.imag) > math.pi - 1e-9
    s[negative] = s[negative].real - math.pi
    return np.atleast_1d(np.poly(s / dt).real)[::-1]
