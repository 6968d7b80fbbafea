"""Problems with one output whose truth is a polynomial model, in open or closed loop."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyadd
from scipy.signal import lfilter

from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from scenarios.problems.bound import BURN_IN, Signals, polynomial_bound, regressors
from scenarios.problems.embedding import Embedding, embedding, layout, own_structure, underfit
from scenarios.problems.problem import Bound, comparison_frequencies
from sysid import IOData, Polynomials, StateSpace
from sysid.models import innovations_form
from sysid.records.arrays import FloatArray, Locked

MORE_ORDERS = 3
"""Most orders beyond the true one for an estimator that chooses."""

DIED_OUT = 1e-14
LONGEST_PULSE = 60_000


@dataclass(frozen=True, eq=False)
class LinearProblem(Locked):
    """A y = B/F u + C/D e with a reference that is the same in each record, and noise that is not.

    Attributes:
        name: By which the registry finds it.
        polynomials: The truth.
        reference: Inputs, or the reference of the loop; the burn-in in front (BURN_IN + N, nu).
        variance: Of the innovation.
        dt: Sampling interval, s.
        feedback: Gain of a proportional controller, u = r - gain y; 0: open loop.
    """

    name: str
    polynomials: Polynomials
    reference: FloatArray
    variance: float
    dt: float
    feedback: float = 0.0
    _bounds: dict[str, Bound] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def truth(self) -> StateSpace:
        """Innovation form."""
        return innovations_form(self.polynomials, self.dt, self.variance)

    @cached_property
    def frequencies(self) -> FloatArray:
        """See `comparison_frequencies` (nf,), Hz."""
        return comparison_frequencies(self.truth)

    def draw(self, seed: int) -> IOData:
        """One record: the noise depends on the seed."""
        signals = self.respond(self.reference, self._noise(seed))
        return IOData(signals.u[BURN_IN:], signals.y[BURN_IN:], self.dt)

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """See `Problem.task`."""
        embedded = self.embedded(structure)
        if embedded is None:
            return None
        orders = {"fit": dict(embedded.orders), "underfit": underfit(embedded), "select": {}}[ask]
        if orders is None:
            return None
        return Task(embedded.structure, orders, self.order + MORE_ORDERS, self.frequencies)

    def bound(self, structure: str | None) -> Bound | None:
        """See `Problem.bound`."""
        embedded = self.embedded(structure)
        if embedded is None or embedded.polynomials is None:
            return None
        if embedded.structure not in self._bounds:
            self._bounds[embedded.structure] = self._bound(embedded, embedded.polynomials)
        return self._bounds[embedded.structure]

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """Parameters (p,) of a perfect estimate from a record: its error is the bound times the record's score.

        That is the first-order error of every efficient estimator: its covariance is the bound, it is normal but for
        what a sum over the record is not, and what it leaves in the residuals is what a fit leaves there.

        Args:
            structure: One that has a bound.
            seed: Of the record.
        """
        bound, embedded = self.bound(structure), self.embedded(structure)
        if bound is None or embedded is None or embedded.polynomials is None:
            raise ScenarioError(f"{self.name} is no {structure} model: nothing is efficient there")
        e = self._noise(seed)
        orders = layout(structure, embedded.orders, self.polynomials.nu)
        rows = regressors(embedded.polynomials, orders, self.respond(self.reference, e))[BURN_IN:]
        return bound.parameters + bound.covariance @ (rows.T @ e[BURN_IN:]) / self.variance

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, Polynomials]:
        """The model with the parameters of a structure's bound (p,), and its polynomials."""
        embedded = self.embedded(structure)
        if embedded is None:
            raise ScenarioError(f"{self.name} has no model of structure {structure!r}")
        polynomials = layout(structure, embedded.orders, self.polynomials.nu).polynomials(theta)
        return innovations_form(polynomials, self.dt, self.variance), polynomials

    @cached_property
    def structure(self) -> str:
        """Its own: the one of fewest parameters."""
        return own_structure(self.polynomials)

    @cached_property
    def order(self) -> int:
        """Number of states from input to output, delays included."""
        channels = [self.polynomials.channel(j) for j in range(self.polynomials.nu)]
        return max(max(len(np.convolve(self.polynomials.A, f)), len(b)) for b, f in channels) - 1

    def embedded(self, structure: str | None) -> Embedding | None:
        """The truth in a structure; None: in its own."""
        return embedding(self.polynomials, structure or self.structure)

    def respond(self, reference: FloatArray, e: FloatArray) -> Signals:
        """Signals for a reference (n, nu) and an innovation (n,), from rest."""
        p = self.polynomials
        noise = lfilter(p.C, np.convolve(p.A, p.D), e)
        if not self.feedback:
            paths = [p.channel(j) for j in range(p.nu)]
            parts = [lfilter(b, np.convolve(p.A, f), reference[:, j]) for j, (b, f) in enumerate(paths)]
            return Signals(reference, np.sum(parts, axis=0) + noise, e)
        b, f = p.channel(0)
        plant = np.convolve(p.A, f)
        y = lfilter([1.0], self._closed_loop, lfilter(b, [1.0], reference[:, 0]) + lfilter(plant, [1.0], noise))
        u = reference[:, 0] - self.feedback * y
        return Signals(u[:, None], y, e)

    @property
    def _closed_loop(self) -> FloatArray:
        """Characteristic polynomial of the loop with the plant B/(A F)."""
        b, f = self.polynomials.channel(0)
        return np.asarray(polyadd(np.convolve(self.polynomials.A, f), self.feedback * b))

    def _pulse_length(self, at: Polynomials) -> int:
        """Samples until the response to a pulse has died out."""
        filters = [at.A, at.C, at.D, *(at.channel(j)[1] for j in range(at.nu))]
        if self.feedback:
            filters.append(self._closed_loop)
        slowest = max(float(np.abs(np.roots(row)).max(initial=0.0)) for row in filters)
        if slowest >= 1.0:
            raise ScenarioError(f"{self.name}: a root of modulus {slowest:.6g} given, expected less than 1")
        steps = 100 if slowest < 1e-3 else 100 + int(np.log(DIED_OUT) / np.log(slowest))
        return min(steps, LONGEST_PULSE)

    def _noise(self, seed: int) -> FloatArray:
        return np.random.default_rng(seed).standard_normal(len(self.reference)) * np.sqrt(self.variance)

    def _bound(self, embedded: Embedding, at: Polynomials) -> Bound:
        orders = layout(embedded.structure, embedded.orders, self.polynomials.nu)
        steps = self._pulse_length(at)
        pulse = np.zeros(steps)
        pulse[0] = 1.0
        driven = self.respond(self.reference, np.zeros(len(self.reference)))
        noise = self.respond(np.zeros((steps, self.polynomials.nu)), pulse)
        return polynomial_bound(at, orders, self.truth, self.variance, self.frequencies, (driven, noise))
