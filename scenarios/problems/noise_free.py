"""Random stable systems without noise, by order and delay: any error is the estimator's own."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.estimators.task import Task
from scenarios.problems.embedding import Embedding, embedding, underfit
from scenarios.problems.problem import Bound, comparison_frequencies, generator_of
from sysid import IOData, Polynomials, StateSpace
from sysid.models import hankel_singular_values, innovations_form
from sysid.records.arrays import FloatArray, Locked

ORDERS = (1, 2, 3, 4, 5, 6)
DELAYS = (1, 2, 3)
SAMPLES = 1000
BURN_IN = 300
MORE_ORDERS = 3

WEAKEST = 3e-3
"""Least Hankel singular value that a system has, as a part of its largest, the delay left out: below, a system of lower
order would do, and digits are lost to the condition instead of to the estimator."""


@dataclass(frozen=True, eq=False)
class NoiseFreeProblem(Locked):
    """A y = B u under white noise as the input, another one in each record.

    Attributes:
        name: By which the registry finds it.
        polynomials: The truth.
        samples: Of a record.
    """

    name: str
    polynomials: Polynomials
    samples: int

    @cached_property
    def truth(self) -> StateSpace:
        """Without a model of the noise: there is none."""
        return innovations_form(self.polynomials, SAMPLE_TIME).input_path()

    @cached_property
    def frequencies(self) -> FloatArray:
        """See `comparison_frequencies` (nf,), Hz."""
        return comparison_frequencies(self.truth)

    def draw(self, seed: int) -> IOData:
        """One record from the middle of a longer one, since records do not start at rest; the seed draws the input."""
        u = np.random.default_rng(seed).standard_normal(self.samples + BURN_IN)
        y = lfilter(self.polynomials.B, self.polynomials.A, u)
        return IOData(u[BURN_IN:], y[BURN_IN:], SAMPLE_TIME)

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """See `Problem.task`; None becomes `oe`.

        Polynomials of the noise have orders too, of which the record says nothing: C of ARMAX that of A, C and D of
        Box-Jenkins 1.
        """
        embedded = embedding(self.polynomials, structure or "oe")
        if embedded is None:
            return None
        free = {"armax": {"nc": embedded.orders.get("na", 0)}, "bj": {"nc": 1, "nd": 1}}.get(embedded.structure, {})
        embedded = Embedding(embedded.structure, {**embedded.orders, **free}, None)
        orders = {"fit": dict(embedded.orders), "underfit": underfit(embedded), "select": {}}[ask]
        if orders is None:
            return None
        return Task(embedded.structure, orders, self.truth.order + MORE_ORDERS, self.frequencies)

    def bound(self, structure: str | None) -> Bound | None:
        """None: there is no noise."""
        del structure
        return None


def noise_free(order: int, delay: int, name: str, samples: int | None) -> NoiseFreeProblem:
    """The system of an order and a delay.

    Poles are real or in pairs, of modulus up to 0.95; B is random.
    """
    rng = generator_of(f"quiet-{order}-{delay}")
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
        values = hankel_singular_values(bare)
        if len(values) == order and values[-1] >= WEAKEST * values[0]:
            return NoiseFreeProblem(name, Polynomials(a, np.concatenate((np.zeros(delay), b))), samples or SAMPLES)
