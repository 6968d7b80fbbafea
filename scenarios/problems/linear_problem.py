"""Problems with one output whose truth is a polynomial model, in open or closed loop."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.estimators.task import Task
from scenarios.files.errors import ScenarioError
from scenarios.problems.problem import MORE_ORDERS, Problem
from sysid import IOData, Polynomials, StateSpace
from sysid.design import maximum_length_sequence
from sysid.models import innovations_form
from sysid.polynomial.structures import Embedding, embedding, layout, own_structure
from sysid.records.arrays import FloatArray
from sysid.validation.cramer_rao import CramerRaoBound, cramer_rao_bound, prediction_gradient, signals_from_rest

BURN_IN = 500
"""Samples before each record, so that it does not start at rest."""

BITS = 12
"""Of the shift register of the binary sequences: a period of 4095 bits."""


@dataclass(frozen=True, eq=False)
class PolynomialProblem(Problem):
    """A problem whose truth is A y = B/F u + C/D e.

    Attributes:
        name: Name in the registry.
        polynomials: The truth.
    """

    name: str
    polynomials: Polynomials

    @cached_property
    def structure(self) -> str:
        """Its own structure: the one of fewest parameters."""
        return own_structure(self.polynomials)

    @cached_property
    def order(self) -> int:
        """Number of states from input to output, delays included."""
        lengths = []
        for j in range(self.polynomials.nu):
            b, f = self.polynomials.channel(j)
            lengths += [len(np.convolve(self.polynomials.A, f)), len(b)]
        return max(lengths) - 1

    def embedded(self, structure: str | None) -> Embedding | None:
        """The truth in a structure; None: in its own."""
        return embedding(self.polynomials, structure or self.structure)

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """See `Problem.task`."""
        embedded = self.embedded(structure)
        if embedded is None:
            return None
        orders = {"fit": embedded.orders, "underfit": underfit(embedded), "select": {}}[ask]
        if orders is None:
            return None
        return Task(embedded.structure, dict(orders), self.order + MORE_ORDERS, self.frequencies)


@dataclass(frozen=True, eq=False)
class LinearProblem(PolynomialProblem):
    """A y = B/F u + C/D e with a reference that is the same in each record, and noise that is not.

    Attributes:
        reference: Inputs, or the reference of the loop; the burn-in in front (BURN_IN + N, nu).
        variance: Of the innovation.
        feedback: Gain of a proportional controller, u = r - gain y; 0: open loop.
        dt: Sampling interval, s.
    """

    reference: FloatArray
    variance: float
    feedback: float = 0.0
    dt: float = SAMPLE_TIME
    _bounds: dict[str, CramerRaoBound] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def truth(self) -> StateSpace:
        """The truth in innovation form."""
        return innovations_form(self.polynomials, self.dt, self.variance)

    def draw(self, seed: int) -> IOData:
        """One record: the noise depends on the seed."""
        signals = signals_from_rest(self.polynomials, self.reference, self._noise(seed), self.feedback)
        return IOData(signals.u[BURN_IN:], signals.y[BURN_IN:], self.dt)

    def bound(self, structure: str | None) -> CramerRaoBound | None:
        """See `Problem.bound`."""
        embedded = self.embedded(structure)
        if embedded is None or embedded.polynomials is None:
            return None
        orders = layout(embedded.structure, embedded.orders, self.polynomials.nu)
        # Kept by structure: most metrics ask for it.
        if embedded.structure not in self._bounds:
            self._bounds[embedded.structure] = cramer_rao_bound(
                embedded.polynomials,
                orders,
                self.reference,
                dt=self.dt,
                variance=self.variance,
                frequencies=self.frequencies,
                system=self.polynomials,
                feedback=self.feedback,
                burn_in=BURN_IN,
            )
        return self._bounds[embedded.structure]

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """Parameters (p,) of a perfect estimate: its error is the bound times the gradient of the log likelihood.

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
        signals = signals_from_rest(self.polynomials, self.reference, e, self.feedback)
        orders = layout(structure, embedded.orders, self.polynomials.nu)
        # The score of Gaussian innovations: gradient times innovations over their variance [Ljung1999, sec. 7.4].
        rows = prediction_gradient(embedded.polynomials, orders, signals)[BURN_IN:]
        return bound.parameters + bound.covariance @ (rows.T @ e[BURN_IN:]) / self.variance

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, Polynomials]:
        """The model with the parameters of a structure's bound (p,), and its polynomials."""
        embedded = self.embedded(structure)
        if embedded is None:
            raise ScenarioError(f"{self.name} has no model of structure {structure!r}")
        polynomials = layout(structure, embedded.orders, self.polynomials.nu).polynomials(theta)
        return innovations_form(polynomials, self.dt, self.variance), polynomials

    def _noise(self, seed: int) -> FloatArray:
        return np.random.default_rng(seed).standard_normal(len(self.reference)) * np.sqrt(self.variance)


@dataclass(frozen=True)
class BinaryExcitation:
    """Excitation by a maximum-length sequence of +-1, and noise in proportion.

    Attributes:
        hold: Samples for which every bit is held.
        samples: Of a record, where its name does not state another number.
        signal_to_noise_db: Power of the output without noise over that of the noise, dB.
        variance: Of the innovation instead, where it is given.
        feedback: Gain of a proportional controller.
    """

    hold: int
    samples: int
    signal_to_noise_db: float = 20.0
    variance: float | None = None
    feedback: float = 0.0

    def problem(self, name: str, truth: Polynomials, samples: int | None = None) -> LinearProblem:
        """The problem of a system under this excitation; another number of samples leaves the same system and noise."""
        variance = self.variance
        if variance is None:
            usual = maximum_length_sequence(self.samples + BURN_IN, BITS, clock=self.hold)
            variance = noise_variance(truth, usual[:, None], self.signal_to_noise_db)
        reference = maximum_length_sequence((samples or self.samples) + BURN_IN, BITS, clock=self.hold)
        return LinearProblem(name, truth, reference[:, None], variance, self.feedback)


def noise_variance(truth: Polynomials, inputs: FloatArray, signal_to_noise_db: float) -> float:
    """Variance of the innovation for a given signal-to-noise ratio at the output.

    Args:
        truth: The system.
        inputs: The burn-in in front (BURN_IN + N, nu).
        signal_to_noise_db: Power of the output without noise over that of the noise, dB.
    """
    output = signals_from_rest(truth, inputs, np.zeros(len(inputs))).y[BURN_IN:]
    # The power gain of the noise filter C/(A D) is the sum of squares of its pulse response, which has died by then.
    pulse = np.zeros(5000)
    pulse[0] = 1.0
    gain = float(np.sum(lfilter(truth.C, np.convolve(truth.A, truth.D), pulse) ** 2))
    return float(np.var(output)) / 10.0 ** (signal_to_noise_db / 10.0) / gain


def underfit(embedded: Embedding) -> dict[str, int] | None:
    """Orders of the dynamics too low by one; None where there is nothing to remove.

    B is cut as far as the order of the state needs it, and keeps one coefficient.
    """
    orders = dict(embedded.orders)
    if embedded.structure == "ss":
        orders["order"] -= 1
        return orders if orders["order"] >= 1 else None
    poles = "na" if "na" in orders else "nf"
    # A model without poles would be another structure.
    if orders[poles] < 2:
        return None
    states = max(orders[poles], orders["nb"] + orders["nk"] - 1)
    orders[poles] -= 1
    orders["nb"] = max(1, min(orders["nb"], states - orders["nk"]))
    return orders
