"""What the test bench knows of a problem: records, the truth behind them, and how well it can be known."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from scenarios.estimators.task import Task
from sysid import IOData, Polynomials, StateSpace
from sysid.records.arrays import ComplexArray, FloatArray, Locked


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
        """By which `problem` finds it again, in any process."""

    @property
    def truth(self) -> StateSpace:
        """What an estimate is compared with, the model of the noise included where there is one."""

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies at which it is compared (nf,), Hz."""

    def draw(self, seed: int) -> IOData:
        """One record; the same for the same seed, in any process."""

    def task(self, structure: str | None, ask: str = "fit") -> Task | None:
        """What is asked of an estimator of a structure, None: of one that takes what is asked.

        Args:
            structure: One of `STRUCTURES`, or None.
            ask: `fit` with orders that hold the truth, of its dynamics at least; `underfit` with orders too low by one;
                `select`: the estimator chooses.

        Returns:
            The task; None where the structure cannot be asked this.
        """

    def bound(self, structure: str | None) -> Bound | None:
        """The bound with the orders of the task; None where no model of the structure is the truth, noise included."""


@runtime_checkable
class Periodic(Protocol):
    """A problem whose records hold whole periods: they show their response without a model."""

    def nonparametric(self, record: IOData) -> ComplexArray:
        """Output over input at the problem's frequencies (nf, ny, nu).

        Args:
            record: One that was drawn from this problem.
        """
