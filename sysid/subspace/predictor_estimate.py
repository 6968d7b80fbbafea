"""Prediction-error fit of `pem_ss`: checks before the fit, and the `Estimate` that it returns."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.data_summary import DataSummary
from sysid.models.estimate import Estimate
from sysid.models.predict import residuals
from sysid.models.repeated_errors import count_repetition_once
from sysid.models.state_space import StateSpace, is_covariance
from sysid.polynomial.offset_test import offset_messages
from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray, real_array
from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning, warn_each
from sysid.subspace.predictor import Predictor, Scales

LEAST_WEIGHT = 1e-6  # of outputs that a weight ignores, relative to the largest: their rows of C and D stay determined


@dataclass(frozen=True, eq=False)
class RealiseLocally:
    """Pure function from local coordinates to the model; a class, so that estimates can be pickled.

    Attributes:
        origin: Predictor, channels scaled.
        basis: Directions (entries of A, M, C, D; q).
        parameters: Coordinates of `origin` (q,).
        scales: Of the channels.
        data: Sampling interval and names.
        covariance: Innovation covariance that the model carries (ny, ny); None if unknown.
    """

    origin: Predictor
    basis: FloatArray
    parameters: FloatArray
    scales: Scales
    data: DataSummary
    covariance: FloatArray | None

    @staticmethod
    def of_all_entries(model: StateSpace, scales: Scales, data: DataSummary) -> "RealiseLocally":
        """Coordinates that are all entries of the predictor's matrices, from a model with innovation covariance."""
        origin = scales.predictor(model, gain=True)
        covariance = np.asarray(model.innovation_covariance)
        return RealiseLocally(origin, np.eye(len(origin.vector())), origin.vector(), scales, data, covariance)

    def __call__(self, theta: FloatArray) -> StateSpace:
        """Model for local coordinates (q,)."""
        moved = self.origin.moved(self.basis @ (theta - self.parameters))
        return self.scales.model(moved, self.data, self.covariance)


def check_gain(nu: int, gain: bool) -> None:
    """Refuse a model that neither inputs nor innovations drive."""
    if not (gain or nu):
        raise SysidError(
            "gain=False given for a time series: without input, only the innovation gain drives its states"
        )


def scaled_output_weight(weight: ArrayLike | None, scales: Scales) -> FloatArray | None:
    """Weight of the scaled outputs (ny, ny), of trace ny and regular; refuse what is no weight of the outputs."""
    if weight is None:
        return None
    W = real_array("output_weight", weight)
    ny = len(scales.y)
    if W.shape != (ny, ny):
        raise SysidError(f"output_weight: expected a matrix ({ny}, {ny}) for {ny} output(s), got shape {W.shape}")
    size = np.abs(W).max() or 1.0  # only ratios matter, and the squares of a huge or tiny weight are out of range
    if not (W.any() and is_covariance(W / size)):
        raise SysidError(
            f"output_weight must be symmetric without negative eigenvalues, and not zero, got {shown(W.tolist())}"
        )
    values, vectors = np.linalg.eigh(W / size * np.outer(scales.y, scales.y))
    W = vectors * np.maximum(values, LEAST_WEIGHT * values[-1]) @ vectors.T
    return np.asarray(W * (ny / np.trace(W)), dtype=np.float64)


def check_enough_samples(experiments: Sequence[IOData], order: int, count: int) -> int:
    """Number of samples after the initialisation windows; refuse too few, and outputs that are zero."""
    samples = int(usable_samples(experiments))
    unknown = count + order * len(experiments)
    # the initial state of every experiment is estimated as well
    short = [len(e) for e in experiments if len(e) - e.window <= order]
    if samples * experiments[0].ny <= unknown or short:
        raise SysidError(
            f"too many states for the data: order {order} has {count} parameters and {order} initial conditions per "
            f"experiment, given {samples} usable samples of {experiments[0].ny} output(s) in {len(experiments)} "
            "experiment(s)"
        )
    if not any(e.y[e.window + order :].any() for e in experiments):
        names = ", ".join(experiments[0].output_names or ())
        raise SysidError(
            f"the outputs ({names}) are zero from sample {order} on, which {order} states can reproduce without input: "
            "there is nothing to identify"
        )
    return samples


def make_predictor_estimate(
    method: str,
    experiments: Sequence[IOData],
    order_values: Mapping[str, Any],
    scales: Scales,
    *,
    predictor: Predictor,
    basis: FloatArray,
    covariance: FloatArray,
    diagnostics: Mapping[str, Any],
    messages: Sequence[str],
    innovation: FloatArray | None = None,
) -> Estimate:
    """Assemble the estimate from a predictor in scaled channels, and the basis and covariance of its local coordinates.

    `innovation` is the covariance of the prediction errors, channels scaled, if the residuals do not give it: they are
    larger after missing outputs.
    """
    summary = DataSummary.of(experiments)
    parameters = basis.T @ predictor.vector()
    freedom = degrees_of_freedom(experiments, predictor, len(parameters))
    if innovation is not None:
        innovation = innovation * np.outer(scales.y, scales.y) * usable_samples(experiments) / freedom
    bare = scales.model(predictor, summary, innovation)
    with warnings.catch_warnings():
        # reported by the estimator
        warnings.simplefilter("ignore", SysidWarning)
        errors = [residuals(bare, e) for e in experiments]
    variance = innovation
    if variance is None:
        scored_errors = np.concatenate([error[e.window :] for error, e in zip(errors, experiments, strict=True)])
        variance = scored_errors.T @ scored_errors / freedom
    realise = RealiseLocally(predictor, basis, parameters, scales, summary, variance)
    model = realise(parameters)
    if not any("offset" in message for message in messages):
        of_offset = offset_messages(model, experiments, errors)
        messages = (*messages, *of_offset)
        warn_each(of_offset, stacklevel=3)
    estimate = Estimate(
        model=model,
        polynomials=None,
        parameters=parameters,
        parameter_names=tuple(f"local{i + 1}" for i in range(len(parameters))),
        covariance=covariance,
        noise_variance=variance,
        residuals=np.concatenate(errors),
        method=method,
        orders=order_values,
        diagnostics={**diagnostics, "warnings": tuple(messages)},
        data=summary,
        realise=realise,
    )
    return count_repetition_once(estimate, experiments)


def usable_samples(experiments: Sequence[IOData]) -> float:
    """Known samples after the initialisation windows, per output."""
    if all(e.complete for e in experiments):
        return sum(len(e) - e.window for e in experiments)
    return sum(int(e.known[e.window :].sum()) for e in experiments) / experiments[0].ny


def degrees_of_freedom(experiments: Sequence[IOData], predictor: Predictor, parameters: int) -> float:
    """Samples minus parameters and initial states, per output."""
    samples = usable_samples(experiments)
    return samples - (parameters + len(predictor.A) * len(experiments)) / experiments[0].ny
