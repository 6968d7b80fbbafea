"""Random stable systems without noise, by order and delay: any error is the estimator's own."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.estimators.seeds import generator_of
from scenarios.problems.linear_problem import PolynomialProblem
from sysid import IOData, Polynomials, StateSpace
from sysid.models import hankel_singular_values, innovations_form
from sysid.polynomial.structures import Embedding

ORDERS = (1, 2, 3, 4, 5, 6)
DELAYS = (1, 2, 3)
SAMPLES = 1000
BURN_IN = 300
"""Samples before each record, so that it does not start at rest."""

WEAKEST = 3e-3
"""Least Hankel singular value that a system has, as a part of its largest, the delay left out: below, a system of lower
order would do, and digits are lost to the condition instead of to the estimator."""


@dataclass(frozen=True, eq=False)
class NoiseFreeProblem(PolynomialProblem):
    """A y = B u under white noise as the input, another one in each record. It has no bound.

    Attributes:
        samples: Of a record.
    """

    samples: int
    structure = "oe"

    @cached_property
    def truth(self) -> StateSpace:
        """The truth in state space, without a noise model, since there is no noise."""
        return innovations_form(self.polynomials, SAMPLE_TIME).input_path()

    def draw(self, seed: int) -> IOData:
        """One record from the middle of a longer one, since records do not start at rest; the seed draws the input."""
        u = np.random.default_rng(seed).standard_normal(self.samples + BURN_IN)
        y = lfilter(self.polynomials.B, self.polynomials.A, u)
        return IOData(u[BURN_IN:], y[BURN_IN:], SAMPLE_TIME)

    def embedded(self, structure: str | None) -> Embedding | None:
        """The truth in a structure; None becomes `oe`.

        Polynomials of the noise have orders too, of which the record says nothing: C of ARMAX that of A, C and D of
        Box-Jenkins 1.
        """
        embedded = super().embedded(structure)
        if embedded is None:
            return None
        noise_orders = {"armax": {"nc": embedded.orders.get("na", 0)}, "bj": {"nc": 1, "nd": 1}}
        orders = {**embedded.orders, **noise_orders.get(embedded.structure, {})}
        # Without polynomials of the noise there is no truth, and so no bound, in the structure.
        return replace(embedded, orders=orders, polynomials=None)


def noise_free(order: int, delay: int, name: str, samples: int | None) -> NoiseFreeProblem:
    """Make the problem of an order and a delay: its system is random, the same for the same name.

    Poles are real or in pairs, of modulus up to 0.95; B is random.
    """
    rng = generator_of(f"quiet-{order}-{delay}")
    # Drawn until no state is nearly superfluous; the sequence of draws says which system it is.
    while True:
        poles: list[complex] = []
        while len(poles) < order:
            if order - len(poles) >= 2 and rng.random() < 0.6:
                pole = rng.uniform(0.3, 0.95) * np.exp(1j * rng.uniform(0.1, 2.5))
                poles += [pole, pole.conjugate()]
            else:
                poles.append(rng.uniform(-0.5, 0.95))
        a = np.atleast_1d(np.poly(poles).real)
        b = rng.standard_normal(order)
        bare = innovations_form(Polynomials(a, np.concatenate(([0.0], b))), SAMPLE_TIME).input_path()
        singular_values = hankel_singular_values(bare)
        if len(singular_values) == order and singular_values[-1] >= WEAKEST * singular_values[0]:
            polynomials = Polynomials(a, np.concatenate((np.zeros(delay), b)))
            return NoiseFreeProblem(name, polynomials, samples or SAMPLES)
