"""What the test bench knows of a problem: its records, the truth behind them, and the accuracy that one allows."""

import hashlib
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from scenarios.estimators.task import Task
from sysid import IOData, Polynomials, StateSpace
from sysid.records.arrays import ComplexArray, FloatArray, Locked

COUNT = 16
"""Frequencies at which estimates are compared with the truth."""

LOWEST = 0.05
"""Of the lowest bandwidth. Below it the response is the static gain again, its imaginary part all but zero and known
all but exactly: ratios to its deviation would be ratios of rounding errors."""

HIGHEST = 0.6
"""Of the Nyquist frequency. Above it hardly a system here responds any more."""


@dataclass(frozen=True, eq=False)
class Bound(Locked):
    """The Cramér-Rao bound of a structure on a problem: covariance of the best unbiased estimate from one record.

    Attributes:
        polynomials: The truth in the structure; of `ss` with one output as ARMAX of its order, with several None.
        parameters: Its parameters in the sequence A, B, C, D, F, or local coordinates where there are none (p,).
        covariance: Of them (p, p).
        frequencies: (nf,), Hz.
        response: From input to output (nf, ny, nu).
        response_directions: Change of real and imaginary part of the response by independent steps of one standard
            deviation each (p, nf, ny, nu, 2); products summed over the first axis are covariances.
        bandwidth_hz: (ny, nu).
        bandwidth_deviation: Standard deviation of its logarithm (ny, nu).
    """

    polynomials: Polynomials | None
    parameters: FloatArray
    covariance: FloatArray
    frequencies: FloatArray
    response: ComplexArray
    response_directions: FloatArray
    bandwidth_hz: FloatArray
    bandwidth_deviation: FloatArray


class Problem(Protocol):
    """A system with known truth and a way to draw records of it."""

    @property
    def name(self) -> str:
        """Name by which `scenarios.problems.registry.problem` finds it, in any process."""

    @property
    def truth(self) -> StateSpace:
        """True model, with its noise model where there is one."""

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies at which it is compared (nf,), Hz."""

    def draw(self, seed: int) -> IOData:
        """One record; the same for the same seed, in any process."""

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """The task for an estimator.

        Args:
            structure: That of the estimator, one of `STRUCTURES`; None: the estimator takes any.
            ask: `fit` with orders that hold the truth, of its dynamics at least; `underfit` with orders too low by one;
                `select`: the estimator chooses.

        Returns:
            The task; None where there is none for the structure.
        """

    def bound(self, structure: str | None) -> Bound | None:
        """The bound with the orders of the task; None where the structure cannot hold the truth with its noise."""


@runtime_checkable
class Periodic(Protocol):
    """A problem whose records hold whole periods: they show their response without a model."""

    def nonparametric(self, record: IOData) -> ComplexArray:
        """Output over input at the problem's frequencies (nf, ny, nu).

        Args:
            record: One that was drawn from this problem.
        """


def comparison_frequencies(truth: StateSpace) -> FloatArray:
    """Frequencies on a logarithmic grid over all that matters of a system (16,), Hz.

    Where there is no bandwidth they begin below the slowest pole.
    """
    nyquist = 0.5 / truth.dt
    bandwidths = truth.bandwidth()
    known = bandwidths[np.isfinite(bandwidths)]
    if len(known):
        corner = float(known.min())
    else:
        poles = truth.input_path().poles()
        speeds = np.abs(np.log(poles[np.abs(poles) > 1e-6])) / (2.0 * np.pi * truth.dt)
        corner = float(speeds.min(initial=HIGHEST * nyquist))
    return np.geomspace(LOWEST * min(corner, nyquist), HIGHEST * nyquist, COUNT)


def generator_of(name: str) -> np.random.Generator:
    """A random number generator that is the same for a name in any process and on any machine."""
    return np.random.default_rng(int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big"))
