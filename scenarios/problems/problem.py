"""Problem of the test bench: its records, the truth behind them, and the best accuracy that one record allows."""

from typing import TYPE_CHECKING

import numpy as np

from scenarios.estimators.task import Task
from sysid import IOData, StateSpace
from sysid.records.arrays import ComplexArray, FloatArray, Locked
from sysid.validation import CramerRaoBound

NYQUIST_SHARES = np.geomspace(0.002, 0.6, 16)
"""Frequencies at which estimates are compared with the truth, as shares of the Nyquist frequency.

They are the same for all problems, so that the frequencies of a task do not tell the problem. The slowest
system here begins to fall off at 0.005; above 0.6 hardly one responds.
"""

MORE_ORDERS = 3
"""Most orders beyond the true one for an estimator that chooses."""


def common_frequencies(dt: float) -> FloatArray:
    """Frequencies at which an estimator claims the covariance of its response (nf,), Hz: by the sampling alone."""
    return np.asarray(NYQUIST_SHARES * (0.5 / dt))


class Problem(Locked):
    """A system with known truth and a way to draw records of it."""

    # For the type checker alone: subclasses have a field or a cached property here, which a property would shadow.
    if TYPE_CHECKING:

        @property
        def name(self) -> str:
            """Name in the registry; `scenarios.problems.registry.problem` makes the problem of it in any process."""

        @property
        def truth(self) -> StateSpace:
            """True model, with its noise model where there is one."""

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies at which estimates are compared with the truth (nf,), Hz."""
        return common_frequencies(self.truth.dt)

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
