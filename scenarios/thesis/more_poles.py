"""Output-error models with more poles than the thesis takes, with stability kept and without."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import sysid
from scenarios.thesis.estimates import estimate
from sysid import IOData

ORDERS = ((2, 2), (2, 3), (3, 3), (2, 4), (4, 4), (2, 5), (5, 5), (2, 6), (6, 6))
"""nb, nf: the orders of the thesis, more poles with its one zero, as many numerator as denominator coefficients."""

EDGE = 1.0 - 1e-4
"""Stable models with a pole beyond this modulus are limited by the stability bound: the estimator warns there too."""

ROUNDS = 20
"""Rounds of repeated least squares at most."""

SETTLED = 1e-3
"""Change of the denominator, as a part of it, that ends them."""


@dataclass(frozen=True)
class MorePoles:
    """One structure.

    Attributes:
        orders: nb, nf, nk.
        radius: Largest modulus of a pole of the best stable model.
        free_radius: Largest modulus of a pole in the last round of repeated least squares without projection
            [SteiglitzMcBride1965]; a round that is unstable ends them.
        rounds: Rounds taken, the first being plain least squares (ARX).
        settled: Whether they came to rest.
    """

    orders: tuple[int, int, int]
    radius: float
    free_radius: float
    rounds: int
    settled: bool

    @property
    def barred(self) -> bool:
        """Whether the best stable model lies at the edge of stability."""
        return self.radius > EDGE

    @property
    def unstable(self) -> bool:
        """Whether one of the two estimates reaches the edge of stability."""
        return self.barred or self.free_radius >= 1.0


def more_poles(data: IOData, nk: int) -> tuple[MorePoles, ...]:
    """Identify an output-error model of each of `ORDERS` with a delay of nk samples, stable and left free."""
    models = []
    for nb, nf in ORDERS:
        radius = float(np.abs(estimate(data, "oe", (nb, nf, nk)).poles()).max())
        models.append(MorePoles((nb, nf, nk), radius, *_repeated_least_squares(data, nb, nf, nk)))
    return tuple(models)


def _repeated_least_squares(data: IOData, nb: int, nf: int, nk: int) -> tuple[float, int, bool]:
    """Largest modulus of a pole, rounds and whether they settled; F filters the next round as it comes."""
    f = np.ones(1)
    radius = 0.0
    for number in range(1, ROUNDS + 1):
        u, y = (lfilter([1.0], f, channel[:, 0]) for channel in (data.u, data.y))
        polynomials = sysid.arx(IOData(u, y, data.dt), nf, nb, nk).polynomials
        assert polynomials is not None  # noqa: S101 - ARX has them
        before, f = f, polynomials.A
        radius = float(np.abs(np.roots(f)).max())
        if radius >= 1.0:
            return radius, number, False
        if len(before) == len(f) and np.abs(f - before).max() <= SETTLED * np.abs(f).max():
            return radius, number, True
    return radius, ROUNDS, False
