"""Two inputs that share their waveform, as the joints of the thesis did when they moved at once [Morris1996]."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scenarios.problems.linear_problem import BITS, BURN_IN, LinearProblem, noise_variance
from sysid import IOData, Polynomials, StateSpace, oe
from sysid.design import maximum_length_sequence
from sysid.records.arrays import ComplexArray, FloatArray
from sysid.validation import CramerRaoBound
from sysid.validation.cramer_rao import signals_from_rest

SAMPLES = 2000
HOLD = 3
OWN_SHARE = 0.3
"""Own part of the second input, relative to the first: enough to separate the paths, with errors three to four times
those of independent inputs."""

OTHER_BITS = 11
SIGNAL_TO_NOISE_DB = 26.0
F = np.array([1.0, -1.35, 0.425])
B1 = np.array([0.0, 0.03, 0.045])
B2 = np.array([0.0, 0.04, 0.02])
"""Numerators; both paths have the same poles, so that what one input alone shows is a system of the same order."""

SHARED = ("shared", "shared-alone")
"""Both inputs are given; or the first alone: then every estimate takes in the other path, nearly all of it."""


@dataclass(frozen=True, eq=False)
class SharedAlone(LinearProblem):
    """The path from the first input, in records of which only that input is given.

    Attributes:
        both: The problem with both inputs.
    """

    both: LinearProblem = field(kw_only=True)

    def draw(self, seed: int) -> IOData:
        """The record of `both`, without the second input."""
        record = self.both.draw(seed)
        return IOData(record.u[:, :1], record.y, record.dt)

    def bound(self, structure: str | None) -> None:
        """None: the record does not tell the path from what comes with the other input."""
        del structure

    def bound_without_other(self, structure: str | None) -> CramerRaoBound | None:
        """The bound if the second input were silent."""
        return super().bound(structure)

    @cached_property
    def limit(self) -> StateSpace:
        """Limit of output-error estimates: the fit to the record without noise.

        Nearly the sum of both paths, and more than it: the second input's own sequence has little in common with the
        first's at lag 0, but something at others, and these two sequences are the same in each record. Structures with
        a model of the disturbance weigh frequencies otherwise and tend to something close by.
        """
        inputs = self.both.reference
        # Without noise one record is enough: the inputs are the same in each.
        signals = signals_from_rest(self.both.polynomials, inputs, np.zeros(len(inputs)))
        record = IOData(signals.u[BURN_IN:, :1], signals.y[BURN_IN:], self.both.dt)
        b, f = self.polynomials.channel(0)
        # Leading zeros of B are the delay, which the fit is given as every estimator is.
        delay = int(np.argmax(b != 0.0))
        return oe(record, len(b) - delay, len(f) - 1, delay, coloured=False).model

    def expected_bias(self) -> ComplexArray:
        """Bias of the response (nf, 1, 1): `limit` less the truth."""
        return self.limit.frequency_response(self.frequencies) - self.truth.frequency_response(self.frequencies)


def shared(plain: str, name: str, samples: int | None) -> LinearProblem:
    """Make a problem of `SHARED`; samples of a record, or None for `SAMPLES`."""
    truth = Polynomials(B=np.stack((B1, B2)), F=np.stack((F, F)))
    # The noise is that of the usual length, so that problems of other lengths differ in nothing else.
    variance = noise_variance(truth, _inputs(SAMPLES), SIGNAL_TO_NOISE_DB)
    inputs = _inputs(samples or SAMPLES)
    both = LinearProblem(name, truth, inputs, variance)
    if plain == "shared":
        return both
    return SharedAlone(name, Polynomials(B=B1, F=F), inputs[:, :1], variance, both=both)


def _inputs(samples: int) -> FloatArray:
    """Both inputs: a common binary sequence, to which the second adds its own (BURN_IN + samples, 2)."""
    common = maximum_length_sequence(samples + BURN_IN, BITS, clock=HOLD)
    # A register of another length has another period, so that the two sequences have little in common.
    second = maximum_length_sequence(samples + BURN_IN, OTHER_BITS, clock=HOLD)
    return np.stack((common, common + OWN_SHARE * second), axis=1)
