"""Three inputs, three outputs, ten states: sharp resonances that all inputs reach and all outputs show."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg

from hmtb_twin.parameters.values import SAMPLE_TIME
from scenarios.estimators.task import Task
from scenarios.problems.linear_problem import BITS, BURN_IN
from scenarios.problems.problem import MORE_ORDERS, Problem
from sysid import IOData, StateSpace
from sysid.design import maximum_length_sequence
from sysid.models.recursion import state_trajectory
from sysid.records.arrays import FloatArray
from sysid.subspace.cramer_rao_ss import LocalCoordinates, cramer_rao_bound_ss
from sysid.validation import CramerRaoBound

SAMPLES = 12_000
HOLD = 5
"""Samples for which every bit is held."""

CHANNELS = 3
SEED = 7
"""Of the system."""

RESONANCES_HZ = (0.7, 1.9, 4.2, 7.5)
DAMPING = (0.25, 0.12, 0.08, 0.06)
REAL_HZ = (0.35, 3.0)
SIGNAL_TO_NOISE_DB = 20.0
COLOUR = 0.9
"""Pole of the coloured noise."""

MIMO = ("mimo", "mimo-coloured")
"""Order 10 with white noise at the outputs; the same with noise of first order at each output: order 13 with it."""


@dataclass(frozen=True, eq=False)
class MimoProblem(Problem):
    """A state-space model in innovation form, with inputs that are the same in each record.

    Attributes:
        name: Name in the registry.
        truth: With the covariance of the innovation.
        inputs: The burn-in in front (BURN_IN + N, nu).
        order: States from input to output.
    """

    name: str
    truth: StateSpace
    inputs: FloatArray
    order: int

    @cached_property
    def noise_free(self) -> FloatArray:
        """Output without noise, the burn-in in front (BURN_IN + N, ny)."""
        m = self.truth
        return state_trajectory(m.A, self.inputs @ m.B.T, np.zeros(m.order)) @ m.C.T

    def draw(self, seed: int) -> IOData:
        """One record: the noise depends on the seed."""
        m = self.truth
        root = np.linalg.cholesky(np.asarray(m.innovation_covariance))
        e = np.random.default_rng(seed).standard_normal((len(self.inputs), m.ny)) @ root.T
        # Linear: the states that the noise drives add to those that the inputs drive.
        noise_states = state_trajectory(m.A, e @ m.gain.T, np.zeros(m.order))
        y = self.noise_free + e + noise_states @ m.C.T
        return IOData(self.inputs[BURN_IN:], y[BURN_IN:], m.dt)

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """See `Problem.task`; None where the structure is not `ss`, or None."""
        if structure not in (None, "ss"):
            return None
        order = {"fit": self.truth.order, "underfit": self.order - 1, "select": 0}[ask]
        orders = {"order": order} if order else {}
        return Task("ss", orders, self.truth.order + MORE_ORDERS, self.frequencies)

    def bound(self, structure: str | None) -> CramerRaoBound | None:
        """See `Problem.bound`; parameters are local coordinates at the truth."""
        return self._bound if structure in (None, "ss") else None

    @cached_property
    def _bound(self) -> CramerRaoBound:
        return cramer_rao_bound_ss(self._coordinates, self.draw, self.frequencies)

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """See `LinearProblem.efficient`."""
        del structure
        # The score of the record: gradient of its log likelihood in the local coordinates.
        return self._bound.parameters + self._bound.covariance @ self._coordinates.normal(self.draw(seed)).gradient

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, None]:
        """The model with the local coordinates of the bound (q,)."""
        del structure
        return self._coordinates.realise(theta), None

    @cached_property
    def _coordinates(self) -> LocalCoordinates:
        return LocalCoordinates.at(self.truth, self.draw(0))


def mimo(plain: str, name: str, samples: int | None) -> MimoProblem:
    """Make a problem of `MIMO`; samples of a record, or None for `SAMPLES`."""
    rng = np.random.default_rng(SEED)
    blocks = _modes()
    A = np.asarray(scipy.linalg.block_diag(*blocks), dtype=np.float64)
    n = len(A)
    B, C = rng.standard_normal((n, CHANNELS)), rng.standard_normal((CHANNELS, n))
    moduli = np.concatenate([np.full(len(block), np.linalg.norm(block, 2)) for block in blocks])
    # White noise of variance 1 drives a mode of modulus r to the variance 1 / (1 - r^2): all modes are reached alike.
    B = B * np.sqrt(1.0 - np.minimum(0.999, moduli**2))[:, None]
    noise_free = state_trajectory(A, _inputs(SAMPLES) @ B.T, np.zeros(n)) @ C.T
    variances = np.var(noise_free[BURN_IN:], axis=0) / 10.0 ** (SIGNAL_TO_NOISE_DB / 10.0)
    K = np.zeros((n, CHANNELS))
    if plain == "mimo-coloured":
        # v(t+1) = 0.9 v(t) + w(t), the innovation at t + 1; its output 1/(1 - 0.9/z) e = e + 0.9/(z - 0.9) e
        A = scipy.linalg.block_diag(A, COLOUR * np.eye(CHANNELS))
        B = np.vstack((B, np.zeros((CHANNELS, CHANNELS))))
        C = np.hstack((C, np.eye(CHANNELS)))
        K = np.vstack((K, COLOUR * np.eye(CHANNELS)))
        variances = variances * (1.0 - COLOUR**2)
    truth = StateSpace(A, B, C, np.zeros((CHANNELS, CHANNELS)), K, SAMPLE_TIME, np.diag(variances))
    return MimoProblem(name, truth, _inputs(samples or SAMPLES), n)


def _modes() -> list[FloatArray]:
    """Blocks of A: a rotation for each resonance, then the real poles."""
    blocks = []
    for frequency, damping in zip(RESONANCES_HZ, DAMPING, strict=True):
        w = 2.0 * np.pi * frequency
        q = np.exp((-damping + 1j * np.sqrt(1.0 - damping**2)) * w * SAMPLE_TIME)
        blocks.append(np.array([[q.real, q.imag], [-q.imag, q.real]]))
    for frequency in REAL_HZ:
        blocks.append(np.array([[np.exp(-2.0 * np.pi * frequency * SAMPLE_TIME)]]))
    return blocks


def _inputs(samples: int) -> FloatArray:
    """One binary sequence, a third of its period apart in the three inputs (BURN_IN + samples, 3)."""
    n, period = samples + BURN_IN, 2**BITS - 1
    register = np.concatenate(([1], np.zeros(BITS - 1)))
    inputs = [maximum_length_sequence(n, BITS, clock=HOLD, state=register)]
    one_period = maximum_length_sequence(period * HOLD, BITS, clock=HOLD)
    # A maximum-length sequence and itself shifted have next to no correlation: 1 over its period.
    for channel in range(1, CHANNELS):
        shift = channel * (period // CHANNELS) * HOLD
        inputs.append(np.resize(np.roll(one_period, shift), n))
    return np.stack(inputs, axis=1)
