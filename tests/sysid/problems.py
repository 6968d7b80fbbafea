"""Problems with a known answer: systems, their excitation, records of them and the Cramer-Rao bound.

They are P1 to P5 of the test bench (`scenarios/problems/textbook.py`), stated again because these tests run where
`sysid` is installed alone; `tests/scenarios/problems/test_textbook.py` holds the two equal, bit for bit.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from sysid import IOData, Polynomials, StateSpace
from sysid.design import maximum_length_sequence
from sysid.models import innovations_form
from sysid.polynomial.structures import embedding, layout, own_structure
from sysid.validation.cramer_rao import CramerRaoBound, cramer_rao_bound, signals_from_rest

DT = 0.02
"""Sampling interval, s."""

BURN_IN = 500
"""Samples before each record, so that it does not start at rest."""

REGISTER = 12
"""Stages of the shift register: its sequence is longer than a third of the longest record."""

FREQUENCIES = np.array([0.5, 5.0])
"""Where the bound of the response is computed, which no test of these asks for, Hz."""

DECIBELS = 20.0
"""Power of the output without noise over that of the noise, where no variance is stated, dB."""


@dataclass(frozen=True, eq=False)
class KnownSystem:
    """A y = B/F u + C/D e, driven by a maximum-length sequence of +-1.

    Attributes:
        polynomials: The truth.
        hold: Samples for which every bit is held.
        samples: Of a record.
        stated_variance: Of the innovation e; None: as `DECIBELS` wants it.
    """

    polynomials: Polynomials
    hold: int
    samples: int
    stated_variance: float | None = None

    @cached_property
    def reference(self) -> np.ndarray:
        """Input with its burn-in in front (BURN_IN + N, 1)."""
        return maximum_length_sequence(self.samples + BURN_IN, REGISTER, clock=self.hold)[:, None]

    @cached_property
    def variance(self) -> float:
        """Variance of the innovation."""
        if self.stated_variance is not None:
            return self.stated_variance
        output = signals_from_rest(self.polynomials, self.reference, np.zeros(len(self.reference))).y[BURN_IN:]
        pulse = np.zeros(5000)
        pulse[0] = 1.0
        response = lfilter(self.polynomials.C, np.convolve(self.polynomials.A, self.polynomials.D), pulse)
        return float(np.var(output)) / 10.0 ** (DECIBELS / 10.0) / float(np.sum(response**2))

    @cached_property
    def truth(self) -> StateSpace:
        """Innovation form."""
        return innovations_form(self.polynomials, DT, self.variance)

    def draw(self, seed: int) -> IOData:
        """One record: the noise depends on the seed, the input does not."""
        noise = np.random.default_rng(seed).standard_normal(len(self.reference)) * np.sqrt(self.variance)
        signals = signals_from_rest(self.polynomials, self.reference, noise, 0.0)
        return IOData(signals.u[BURN_IN:], signals.y[BURN_IN:], DT)

    @cached_property
    def bound(self) -> CramerRaoBound:
        """The Cramer-Rao bound in the structure of fewest parameters that holds the truth."""
        embedded = embedding(self.polynomials, own_structure(self.polynomials))
        return cramer_rao_bound(
            embedded.polynomials,
            layout(embedded.structure, embedded.orders, self.polynomials.nu),
            self.reference,
            dt=DT,
            variance=self.variance,
            frequencies=FREQUENCIES,
            system=self.polynomials,
            burn_in=BURN_IN,
        )


def _system(**rows: list[float]) -> Polynomials:
    return Polynomials(**{name: np.asarray(row, dtype=np.float64) for name, row in rows.items()})


_PLANT = {"B": [0.0, 0.03459, 0.07584], "F": [1.0, -0.9776, 0.07922]}

SYSTEMS = {
    # The published yaw ARMAX model: badly conditioned, single coefficients are hardly known, the response is.
    "p1": KnownSystem(
        _system(
            A=[1, -2.542, 2.367, -0.8523, -0.08044, 0.1103],
            B=[0, 0, 0.003804, 0.003504, -0.004285],
            C=np.poly([0.5, 0.3 + 0.4j, 0.3 - 0.4j, -0.2, 0.1]).real.tolist(),
        ),
        hold=5,
        samples=12_000,
    ),
    # The published shoulder-pitch OE model.
    "p2": KnownSystem(_system(**_PLANT), hold=5, samples=12_000),
    # An ARMAX system of second order with much noise.
    "p3": KnownSystem(
        _system(A=[1, -1.5, 0.7], B=[0, 1.0, 0.5], C=[1, -1.0, 0.2]), hold=1, samples=2000, stated_variance=1.0
    ),
    # The plant of p2 under a resonant disturbance: a Box-Jenkins system.
    "p4": KnownSystem(_system(C=[1, -0.8, 0.2], D=[1, -1.5, 0.7], **_PLANT), hold=5, samples=3000),
    # An ARX system of third order with a delay of two.
    "p5": KnownSystem(
        _system(A=np.poly([0.9 * np.exp(0.4j), 0.9 * np.exp(-0.4j), 0.6]).real.tolist(), B=[0, 0, 0.5, -0.2, 0.1]),
        hold=2,
        samples=2000,
    ),
}
"""Systems by name."""
