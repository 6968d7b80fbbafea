"""What recursive estimators regress on: lags of outputs, inputs, and of what the model itself makes."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

Denominator = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Channel:
    """A signal whose lags stand among the regressors.

    Attributes:
        place: Where its lags stand.
        sign: With which they enter the prediction.
        denominator: Where the coefficients of the filter stand that makes gradients of it; an empty range for none.
        signal: Its samples (N,); None when the model makes them.
        delay: Samples by which it enters late.
        paths: Places whose sum is the simulated output; none for the errors.
    """

    place: slice
    sign: float
    denominator: Denominator
    signal: FloatArray | None
    delay: int = 0
    paths: tuple[slice, ...] = ()


def regressed_channels(data: IOData, orders: Orders) -> list[Channel]:
    """Layout of the regressors of an ARX, ARMAX or OE model.

    Args:
        data: One record with one output.
        orders: The structure.
    """
    sizes = [orders.na, *orders.nb, orders.nc, *orders.nf]
    edges = [0, *np.cumsum(sizes).tolist()]
    places = [slice(a, b) for a, b in pairwise(edges)]
    ranges = list(pairwise(edges))
    nu = len(orders.nb)
    inputs, noise, dynamics = places[1 : 1 + nu], places[1 + nu], places[2 + nu :]
    colour = ranges[1 + nu]
    out = [Channel(places[0], -1.0, colour, data.y[:, 0], 1)]
    for j, (b, f) in enumerate(zip(inputs, dynamics, strict=True)):
        own = ranges[2 + nu + j]
        out.append(Channel(b, 1.0, own if orders.nf[j] else colour, data.u[:, j], orders.nk[j]))
        out.append(Channel(f, -1.0, own, None, 0, (b, f)))
    out.append(Channel(noise, 1.0, colour, None))
    return [c for c in out if c.place.stop > c.place.start]


def stable(theta: FloatArray, denominators: Iterable[Denominator]) -> bool:
    """Whether all reflection coefficients of every denominator are below one (the step-down recursion of Schur)."""
    for begin, end in denominators:
        row = theta[begin:end].tolist()
        while row:
            k = row.pop()
            if not abs(k) < 1.0:
                return False
            row = [(x - k * z) / (1.0 - k * k) for x, z in zip(row, reversed(row), strict=True)]
    return True
