"""The result of `rarx`, `rarmax` and `roe`, and the state from which they continue."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sysid.models.estimate import Estimate
from sysid.polynomial.orders import Orders
from sysid.records.arrays import FloatArray, Locked
from sysid.records.labelled import Labelled
from sysid.records.printing import Part
from sysid.recursive.adaptation import Adaptation


@dataclass(frozen=True, eq=False, repr=False)
class RecursiveState(Locked):
    """Complete state of a recursion between two samples: a later part of the record continues from it.

    Attributes:
        orders: The structure.
        adaptation: Rule of the gain.
        theta: Parameters (p,).
        memory: Memory of the rule, P or its square root (p, p).
        phi: Regressors of the last sample (p,).
        psi: Their gradients (p,).
        filters: Per regressed signal, the past outputs of its gradient filter.
        generated: Per regressed signal, its last sample if the model generates it; zero for measured signals.
        tails: Per regressed signal, the delayed samples that have not entered yet, the latest at the end.
        dt: Sampling interval in s.
        samples: Number of samples so far.
        steps: Number of predictions so far.
        squares: Sum of squared errors, with the weights of the rule.
        weight: Sum of these weights.
        energy: Sum of squared lengths of psi.
        shortened: Number of steps shortened to keep the predictor stable.
    """

    orders: Orders
    adaptation: Adaptation
    theta: FloatArray
    memory: FloatArray
    phi: FloatArray
    psi: FloatArray
    filters: tuple[FloatArray, ...]
    generated: tuple[float, ...]
    tails: tuple[FloatArray, ...]
    dt: float
    samples: int = 0
    steps: int = 0
    squares: float = 0.0
    weight: float = 0.0
    energy: float = 0.0
    shortened: int = 0

    @property
    def scaled_covariance(self) -> FloatArray:
        """P (p, p): covariance over variance of the errors (`Forgetting`), or covariance (`Kalman`)."""
        return self.adaptation.leave(self.memory)


@dataclass(frozen=True, eq=False, repr=False)
class RecursiveEstimate(Labelled, Locked):
    """Parameters sample by sample, and the last model.

    Attributes:
        parameters: Estimates from the data up to each sample (N, p).
        parameter_names: One name per parameter.
        predicted: Prediction of each output by the parameters before it (N, 1); NaN before the first prediction.
        residuals: Output minus prediction (N, 1); zero before the first prediction.
        P: The final matrix P (p, p): covariance of the parameters over variance of the errors (`Forgetting`), or
            covariance (`Kalman`).
        final: The last parameters as an estimate, with their covariance: a model like any other.
        state: Final state; this record as `start` continues the recursion with the next samples.
        shortened: Number of steps, since the first start, shortened to keep the predictor stable.
    """

    parameters: FloatArray
    parameter_names: tuple[str, ...]
    predicted: FloatArray
    residuals: FloatArray
    P: FloatArray
    final: Estimate
    state: RecursiveState
    shortened: int

    def _parts(self) -> list[Part]:
        shortening = f", {self.shortened} steps shortened to keep the predictor stable" if self.shortened else ""
        return [f"{len(self.parameters)} samples of parameters{shortening}; the last ones:", *self.final._parts()]

    def _variables(self) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        arrays = {name: ("time", column) for name, column in zip(self.parameter_names, self.parameters.T, strict=True)}
        arrays |= {"predicted": ("time", self.predicted[:, 0]), "residuals": ("time", self.residuals[:, 0])}
        # the record may be the last part of a longer recursion
        time = (np.arange(len(self.parameters)) + self.state.samples - len(self.parameters)) * self.state.dt
        return arrays, {"time": ("time", time, {"units": "s"})}, {"method": self.final.method}
