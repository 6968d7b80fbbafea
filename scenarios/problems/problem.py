"""Problem of the test bench: its records, the truth behind them, and the best accuracy that one record allows."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from scenarios.estimators.task import Task
from sysid import IOData, StateSpace
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.validation import CramerRaoBound

COUNT = 16
"""Frequencies at which estimates are compared with the truth."""

LOWEST = 0.05
"""Of the lowest bandwidth. Below it the response is the static gain again, its imaginary part all but zero and known
all but exactly: ratios to its deviation would be ratios of rounding errors."""

HIGHEST = 0.6
"""Of the Nyquist frequency. Above it hardly a system here responds any more."""

MORE_ORDERS = 3
"""Most orders beyond the true one for an estimator that chooses."""


class Problem(Locked):
    """A system with known truth and a way to draw records of it."""

    # For the type checker alone: subclasses have a field or a cached property here, which a property would shadow.
    if TYPE_CHECKING:

        @property
        def name(self) -> str:
            """Name by which `scenarios.problems.registry.problem` finds it, in any process."""

        @property
        def truth(self) -> StateSpace:
            """True model, with its noise model where there is one."""

    @cached_property
    def frequencies(self) -> FloatArray:
        """Frequencies at which estimates are compared with the truth (nf,), Hz.

        A logarithmic grid over all that matters of the system. Where there is no bandwidth it begins below the slowest
        pole.
        """
        nyquist = 0.5 / self.truth.dt
        bandwidths = self.truth.bandwidth()
        known = bandwidths[np.isfinite(bandwidths)]
        if len(known):
            corner = float(known.min())
        else:
            poles = self.truth.input_path().poles()
            speeds = np.abs(np.log(poles[np.abs(poles) > 1e-6])) / (2.0 * np.pi * self.truth.dt)
            corner = float(speeds.min(initial=HIGHEST * nyquist))
        return np.geomspace(LOWEST * min(corner, nyquist), HIGHEST * nyquist, COUNT)

    def draw(self, seed: int) -> IOData:
        """One record; the same for the same seed, in any process."""
        raise NotImplementedError

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """The task for an estimator.

        Args:
            structure: That of the estimator, one of `STRUCTURES`; None: the estimator takes any.
            ask: `fit` with orders that hold the truth, of its dynamics at least; `underfit` with orders too low by one;
                `select`: the estimator chooses.

        Returns:
            The task; None where there is none for the structure.
        """
        raise NotImplementedError

    def bound(self, structure: str | None) -> CramerRaoBound | None:
        """The Cramér-Rao bound with the orders of the task; None where the structure cannot hold truth and noise."""
        del structure
        return None

    def scattered(self, seed: int) -> StateSpace:
        """Model as good as any estimate, where there is no bound: the truth itself, if nothing scatters it."""
        del seed
        return self.truth

    def nonparametric(self, record: IOData) -> ComplexArray | None:
        """Measured response at the lines of a record of whole periods (nf, ny, nu); None for other records."""
        del record
        return None
