"""What `rarx`, `rarmax` and `roe` return, and what they need to go on."""

from dataclasses import dataclass

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray, Locked, lock
from sysid.recursive.adaptation import Adaptation


@dataclass(frozen=True, eq=False, repr=False)
class RecursiveState(Locked):
    """All that a recursion knows between two samples; a later piece of the record goes on from it.

    Attributes:
        orders: The structure.
        adaptation: Rule of the gain.
        theta: Parameters (p,).
        memory: What the rule carries on (p, p).
        phi: Regressors of the last sample (p,).
        psi: Their gradients (p,).
        filters: Per regressed signal, the past of the filter that makes gradients of it.
        made: Per regressed signal, what the model made of the last sample; zero for measured ones.
        tails: Per regressed signal, the last samples that have not entered yet, the latest at the end.
        dt: Sampling interval in s.
        samples: Seen so far.
        steps: Predictions made so far.
        squares: Sum of squared errors, weighted as the rule forgets.
        weight: Sum of these weights.
        energy: Sum of squared lengths of psi.
        shortened: Number of steps that had to be shortened to keep the predictor stable.
    """

    orders: Orders
    adaptation: Adaptation
    theta: FloatArray
    memory: FloatArray
    phi: FloatArray
    psi: FloatArray
    filters: tuple[FloatArray, ...]
    made: tuple[float, ...]
    tails: tuple[FloatArray, ...]
    dt: float
    samples: int = 0
    steps: int = 0
    squares: float = 0.0
    weight: float = 0.0
    energy: float = 0.0
    shortened: int = 0

    def __post_init__(self) -> None:
        """Lock."""
        for name in ("theta", "memory", "phi", "psi"):
            object.__setattr__(self, name, lock(getattr(self, name)))
        for name in ("filters", "tails"):
            object.__setattr__(self, name, tuple(lock(np.asarray(part, dtype=float)) for part in getattr(self, name)))

    @property
    def scaled_covariance(self) -> FloatArray:
        """P (p, p): covariance over variance of the errors (`Forgetting`), or covariance (`Kalman`)."""
        return self.adaptation.leave(self.memory)


@dataclass(frozen=True, eq=False, repr=False)
class RecursiveEstimate(Locked):
    """Parameters as they were known sample by sample.

    Attributes:
        parameters: Estimate from the data up to each sample (N, p).
        parameter_names: One name per parameter.
        predicted: Each output as the parameters known before it predict it (N, 1); NaN before the first prediction.
        residuals: Each output less that (N, 1); zero before the first prediction.
        P: The matrix P in the end (p, p): covariance of the parameters over variance of the errors (`Forgetting`), or
            covariance (`Kalman`).
        final: The last parameters as an estimate, with their covariance: a model like any other.
        state: From which the recursion goes on: given as `start`, this whole record continues with the next samples.
        shortened: Number of steps, from the very beginning, that had to be shortened to keep the predictor stable.
    """

    parameters: FloatArray
    parameter_names: tuple[str, ...]
    predicted: FloatArray
    residuals: FloatArray
    P: FloatArray
    final: Estimate
    state: RecursiveState
    shortened: int

    def __post_init__(self) -> None:
        """Lock."""
        for name in ("parameters", "predicted", "residuals", "P"):
            object.__setattr__(self, name, lock(getattr(self, name)))
