"""Fits of models to data in simulation, one step ahead, and over any other horizon."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.predict import Choice, as_model, chosen_model, predict
from sysid.models.state_space import StateSpace
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError
from sysid.records.printing import Table

Model = StateSpace | Estimate | Choice


@dataclass(frozen=True, eq=False, repr=False)
class ModelFit(Locked):
    """Fit of one model to a data set; samples of several experiments follow each other.

    Attributes:
        name: The model.
        simulation: Fit in percent of the output simulated from the input alone, per output (ny,).
        one_step: Fit in percent of the one-step prediction, per output (ny,).
        simulated: Simulated output, initial state fitted (N, ny).
        predicted: One-step prediction, initial state fitted (N, ny).
        steps: The horizon of a further prediction, in samples.
        ahead: Fit in percent of the prediction over that horizon, per output (ny,).
        predicted_ahead: Prediction over that horizon (N, ny).
        by_experiment: The same by experiment; empty for a single record.
        output_names: One name per output.
    """

    name: str
    simulation: FloatArray
    one_step: FloatArray
    simulated: FloatArray
    predicted: FloatArray
    steps: int = field(default=1, kw_only=True)
    ahead: FloatArray = field(kw_only=True)
    predicted_ahead: FloatArray = field(kw_only=True)
    by_experiment: tuple["ModelFit", ...] = field(default=(), kw_only=True)
    output_names: tuple[str, ...] = field(default=(), kw_only=True)

    def __str__(self) -> str:
        """One line with all fits, per output if there are several, and a line for each of several experiments."""
        parts = []
        for i, name in enumerate(self._labels):
            text = f"{self.simulation[i]:.2f} % in simulation, {self.one_step[i]:.2f} % one step ahead"
            text += f", {self.ahead[i]:.2f} % {self.steps} steps ahead" if self.steps > 1 else ""
            parts.append((f"{name}: " if name else "") + text)
        return "\n".join((f"{self.name}: {'; '.join(parts)}", *(f"  {one}" for one in self.by_experiment)))

    @property
    def _labels(self) -> tuple[str, ...]:
        """Names of several outputs; an empty one of a single output."""
        count = len(self.simulation)
        return self.output_names if len(self.output_names) == count > 1 else ("",) * count


class Fits(tuple[ModelFit, ...]):
    """Fits of several models, printed as a table."""

    __slots__ = ()

    def __str__(self) -> str:
        """Table of all fits."""
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> Table:
        rows: list[list[str]] = []
        for fit in self:
            for one in (fit, *fit.by_experiment):
                for i, name in enumerate(one._labels):
                    values = (one.simulation[i], one.one_step[i], one.ahead[i])
                    label = ("  " * (one is not fit)) + one.name + (f", {name}" if name else "")
                    rows.append([label, *(f"{value:.2f}" for value in values)])
        heads = ["fit / %", "simulation", "one step ahead", f"{self[0].steps} steps ahead"]
        columns = list(zip(heads, zip(*rows, strict=True), strict=True))
        return Table(columns if self[0].steps > 1 else columns[:-1])


def compare(
    models: Model | Sequence[Model] | Mapping[str, Model], data: IOData | Sequence[IOData], *, steps: int = 1
) -> Fits:
    """Fit 100 (1 - |y - yhat| / |y - mean(y)|) of every model, without the initialisation window.

    The initial state is fitted by least squares: to the initialisation window if the record has one, else to the whole
    record. Channels are matched by name, as in `predict`. Over several experiments the squares of errors and of
    deviations, each from its own mean, are summed.

    Args:
        models: A model, an estimate or a choice of `auto`, several, or several by name.
        data: The record or records, preferably ones that no model was fitted to.
        steps: Horizon of a further prediction, from outputs up to t - steps; one-step prediction and simulation are
            always included.

    Returns:
        One record per model, in their sequence: a tuple that prints as a table.

    Raises:
        SysidError: No model, channels that do not fit, an output that is constant, steps < 1.
    """
    named: Mapping[str, Model]
    if isinstance(models, Mapping):
        named = models
    else:
        sequence = [chosen_model(model) for model in (models if isinstance(models, Sequence) else [models])]
        for model in sequence:
            as_model(model)
        methods = [model.method if isinstance(model, Estimate) else "model" for model in sequence]
        named = {f"{k}: {method}": model for k, (method, model) in enumerate(zip(methods, sequence, strict=True), 1)}
    if not named:
        raise SysidError("expected at least one model, got none")
    steps = whole_number("steps (the simulation is always included)", steps, 1)
    experiments = as_experiments(data, missing=True, series=True)
    return Fits(_fit(name, model, experiments, steps) for name, model in named.items())


def _fit(name: str, model: Model, experiments: Sequence[IOData], steps: int) -> ModelFit:
    outputs = []
    for data in experiments:
        of_horizon = {horizon: predict(model, data, steps=horizon) for horizon in {None, 1, steps}}
        outputs.append((of_horizon[None], of_horizon[1], of_horizon[steps]))
    single = tuple(
        _of(name if len(experiments) == 1 else e.name or f"experiment {k + 1}", [e], [own], steps)
        for k, (e, own) in enumerate(zip(experiments, outputs, strict=True))
    )
    return single[0] if len(single) == 1 else _of(name, experiments, outputs, steps, single)


def _of(
    name: str,
    experiments: Sequence[IOData],
    outputs: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
    steps: int,
    by_experiment: tuple[ModelFit, ...] = (),
) -> ModelFit:
    measured = [e.scored.y for e in experiments]
    # a common mean would count differences of level between experiments as explained
    y = np.concatenate([part - np.nanmean(part, axis=0) if len(measured) > 1 else part for part in measured])
    fits = []
    for kind in zip(*outputs, strict=True):
        # an unstable model may overflow: infinity minus infinity counts as infinite
        hats = [
            np.nan_to_num(hat[e.window :], nan=np.inf, posinf=np.inf, neginf=-np.inf)
            for hat, e in zip(kind, experiments, strict=True)
        ]
        if len(measured) > 1:
            hats = [hat - np.nanmean(part, axis=0) for hat, part in zip(hats, measured, strict=True)]
        fits.append(fit_percent(y, np.concatenate(hats)))
    simulated, predicted, ahead = (np.concatenate(kind) for kind in zip(*outputs, strict=True))
    return ModelFit(
        name=name,
        simulation=fits[0],
        one_step=fits[1],
        simulated=simulated,
        predicted=predicted,
        steps=steps,
        ahead=fits[2],
        predicted_ahead=ahead,
        by_experiment=by_experiment,
        output_names=experiments[0].output_names or (),
    )


def fit_percent(y: ArrayLike, yhat: ArrayLike) -> FloatArray:
    """100 (1 - |y - yhat| / |y - mean(y)|) per output (ny,).

    100 is perfect, 0 no better than the mean, minus infinity an overflow.

    Args:
        y: Measured output (N, ny); NaN marks missing samples, which are not scored.
        yhat: Output of the model (N, ny).

    Returns:
        Fits in percent (ny,).

    Raises:
        SysidError: Shapes differ, NaN in yhat, or an output is constant.
    """
    y, yhat = (_table(name, value) for name, value in (("y", y), ("yhat", yhat)))
    if y.shape != yhat.shape:
        raise SysidError(f"y and yhat must have one shape, got {y.shape} and {yhat.shape}")
    unknown = np.isnan(yhat) & np.isfinite(y)
    if unknown.any():
        raise SysidError(f"yhat is NaN at {int(unknown.sum())} sample(s) where y is known: the fit is not defined")
    spread = np.sqrt(np.nansum((y - np.nanmean(y, axis=0)) ** 2, axis=0))
    # rounding of the mean gives a constant a spread of its last digit
    rounding = 1e-14 * np.sqrt(len(y)) * np.nanmax(np.abs(y), axis=0)
    if (spread <= rounding).any():
        raise SysidError(f"output {int(np.argmin(spread - rounding))} is constant: its fit is not defined")
    known = np.isfinite(y)
    error = np.where(known, np.abs(np.where(known, y, 0.0) - yhat), 0.0)
    largest = error.max(axis=0)
    finite = np.isfinite(largest)
    # scaled first: errors of an unstable predictor may overflow when squared
    scale = np.where(finite & (largest > 0.0), largest, 1.0)
    size = np.where(finite, scale * np.linalg.norm(np.where(finite, error, 0.0) / scale, axis=0), np.inf)
    return np.asarray(100.0 * (1.0 - size / spread))


def _table(name: str, value: ArrayLike) -> FloatArray:
    try:
        out = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise SysidError(f"{name}: expected numbers (N, ny), got a value of type {type(value).__name__}") from error
    if out.ndim not in (1, 2) or not out.size:
        raise SysidError(f"{name}: expected shape (N, ny), got {out.shape}")
    return out[:, None] if out.ndim == 1 else out
