"""Fits of models to data: in simulation and one step ahead, always both."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sysid.arrays import FloatArray, Locked, lock
from sysid.data import IOData
from sysid.errors import SysidError
from sysid.estimate import Estimate
from sysid.predict import predict
from sysid.state_space import StateSpace

Model = StateSpace | Estimate


@dataclass(frozen=True, eq=False)
class ModelFit(Locked):
    """How well one model explains one record.

    Attributes:
        name: The model.
        simulation: Fit in percent of the output simulated from the input alone, per output (ny,).
        one_step: Fit in percent of the one-step prediction, per output (ny,).
        simulated: Simulated output, initial state fitted (N, ny).
        predicted: One-step prediction, initial state fitted (N, ny).
        output_names: One name per output.
    """

    name: str
    simulation: FloatArray
    one_step: FloatArray
    simulated: FloatArray
    predicted: FloatArray
    output_names: tuple[str, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Lock."""
        for attribute in ("simulation", "one_step", "simulated", "predicted"):
            object.__setattr__(self, attribute, lock(getattr(self, attribute)))

    def __str__(self) -> str:
        """One line: both fits, per output where there are several."""
        names = (
            self.output_names if len(self.output_names) == len(self.simulation) > 1 else ("",) * len(self.simulation)
        )
        parts = (
            (f"{name}: " if name else "") + f"{simulation:.2f} % in simulation, {one_step:.2f} % one step ahead"
            for name, simulation, one_step in zip(names, self.simulation, self.one_step, strict=True)
        )
        return f"{self.name}: {'; '.join(parts)}"


def compare(models: Model | Sequence[Model] | Mapping[str, Model], data: IOData) -> tuple[ModelFit, ...]:
    """Fit 100 (1 - |y - yhat| / |y - mean(y)|) of every model, without the initialisation window.

    The initial state is fitted by least squares: to the initialisation window where the record has one, else to the
    whole record.

    Args:
        models: A model or estimate, several, or several by name.
        data: The record to explain, best one that no model was fitted to.

    Returns:
        One record per model, in the sequence given.

    Raises:
        SysidError: No model, channels that do not fit, an output that is constant.
    """
    named: Mapping[str, Model]
    if isinstance(models, Mapping):
        named = models
    else:
        several = [models] if isinstance(models, StateSpace | Estimate) else list(models)
        named = {_name(model, k): model for k, model in enumerate(several)}
    if not named:
        raise SysidError("expected at least one model, got none")
    out = []
    for name, model in named.items():
        simulated = predict(model, data, steps=None)
        predicted = predict(model, data)
        out.append(
            ModelFit(
                name=name,
                simulation=fit_percent(data.y[data.window :], simulated[data.window :]),
                one_step=fit_percent(data.y[data.window :], predicted[data.window :]),
                simulated=simulated,
                predicted=predicted,
                output_names=data.output_names or (),
            )
        )
    return tuple(out)


def fit_percent(y: FloatArray, yhat: FloatArray) -> FloatArray:
    """100 (1 - |y - yhat| / |y - mean(y)|) per output (ny,).

    100 is perfect, 0 no better than the mean, minus infinity what grows beyond all numbers.

    Args:
        y: Measured (N, ny); NaN where a sample is missing: it is not scored.
        yhat: Explained (N, ny).

    Raises:
        SysidError: Shapes differ, or an output is constant.
    """
    if y.shape != yhat.shape:
        raise SysidError(f"y and yhat must have one shape, got {y.shape} and {yhat.shape}")
    spread = np.sqrt(np.nansum((y - np.nanmean(y, axis=0)) ** 2, axis=0))
    # Rounding of the mean leaves a constant a spread of its last digit.
    rounding = 1e-14 * np.sqrt(len(y)) * np.nanmax(np.abs(y), axis=0)
    if (spread <= rounding).any():
        raise SysidError(f"output {int(np.argmin(spread - rounding))} is constant: its fit is not defined")
    # samples that are missing are not scored
    known = np.isfinite(y)
    error = np.where(known, np.abs(np.where(known, y, 0.0) - yhat), 0.0)
    largest = error.max(axis=0)
    finite = np.isfinite(largest)
    # scaled first: an unstable predictor's errors may be too large to square
    scale = np.where(finite & (largest > 0.0), largest, 1.0)
    size = np.where(finite, scale * np.linalg.norm(np.where(finite, error, 0.0) / scale, axis=0), np.inf)
    return np.asarray(100.0 * (1.0 - size / spread))


def _name(model: Model, index: int) -> str:
    return f"{index + 1}: {model.method}" if isinstance(model, Estimate) else f"{index + 1}: model"
