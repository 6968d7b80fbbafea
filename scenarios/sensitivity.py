"""How much a recovered bandwidth owes to the order that was chosen."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import sysid
from sysid import IOData, SysidWarning

ORDERS = ((2, 2), (3, 3), (3, 4), (4, 3), (5, 3), (4, 4), (5, 4))
"""nb, nf of the output-error models laid side by side, whichever of them is called sufficient."""


@dataclass(frozen=True)
class OrderEffect:
    """One order on the estimation data.

    Attributes:
        orders: nb, nf, nk.
        bandwidth_hz: Recovered bandwidth, Hz.
        ci95: Its 95 % interval, Hz.
        residual: Standard deviation of the residuals, output units.
    """

    orders: tuple[int, int, int]
    bandwidth_hz: float
    ci95: tuple[float, float]
    residual: float


def order_effects(data: IOData, nk: int) -> tuple[OrderEffect, ...]:
    """Identify output-error models of every order in `ORDERS`.

    Args:
        data: The estimation data, prepared.
        nk: Delay, samples.

    Returns:
        One record for each order.
    """
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        for nb, nf in ORDERS:
            estimate = sysid.oe(data, nb, nf, nk)
            band = estimate.bandwidth()
            ci95 = (float(band.ci95[0][0, 0]), float(band.ci95[1][0, 0]))
            found.append(OrderEffect((nb, nf, nk), float(band.hz[0, 0]), ci95, float(np.std(estimate.residuals))))
    return tuple(found)


def spread(effects: Sequence[OrderEffect]) -> tuple[float, float]:
    """Smallest and largest bandwidth over the orders, Hz."""
    values = [entry.bandwidth_hz for entry in effects]
    return min(values), max(values)
