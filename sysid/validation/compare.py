"""Fits of models to data in simulation, one step ahead, and over any other horizon."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from sysid.models.estimate import Estimate
from sysid.models.model_forms import AnyModel, as_model, check_no_data, chosen_model
from sysid.models.predict import predict
from sysid.records.arguments import whole_number
from sysid.records.arrays import FloatArray, Locked
from sysid.records.data import IOData, as_experiments
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.printing import Table
from sysid.validation.own_line import line_left

Model = AnyModel

OWN_DATA = "estimated from this record, or from its beginning"
"""What is said of a model on the data of its fit."""


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
        is_training: Whether the model was estimated from a record of the data set, or from its beginning, so that the
            fit is no validation.
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
    is_training: bool = field(default=False, kw_only=True)

    def __str__(self) -> str:
        """One line with all fits, per output if there are several, and a line for each of several experiments."""
        fits_by_output = []
        for i, output in enumerate(self._labels):
            fits = f"{self.simulation[i]:.2f} % in simulation, {self.one_step[i]:.2f} % one step ahead"
            if self.steps > 1:
                fits += f", {self.ahead[i]:.2f} % {self.steps} steps ahead"
            fits_by_output.append(f"{output}: {fits}" if output else fits)
        lines = [f"{self.name}: {'; '.join(fits_by_output)}"]
        if self.is_training:
            lines.append(f"  {OWN_DATA}: no validation")
        lines += [f"  {fit}" for fit in self.by_experiment]
        return "\n".join(lines)

    @property
    def _labels(self) -> tuple[str, ...]:
        """Names of several outputs; an empty one of a single output."""
        count = len(self.simulation)
        if count > 1 and len(self.output_names) == count:
            return self.output_names
        return ("",) * count


class Fits(tuple[ModelFit, ...]):
    """Fits of several models, printed as a table."""

    __slots__ = ()

    def __str__(self) -> str:
        """Table of all fits, and which of them are to the data of the fit."""
        return "\n".join((self._table().text(), *self._notes()))

    def _notes(self) -> list[str]:
        return [f"{fit.name}: {OWN_DATA}: no validation" for fit in self if fit.is_training]

    def _repr_html_(self) -> str:
        notes = "".join(f"<p>{escape(note)}</p>" for note in self._notes())
        return self._table().html() + notes

    def _table(self) -> Table:
        """A row for each model and output, and below it one for each of several experiments."""
        rows: list[list[str]] = []
        for fit in self:
            rows += _rows(fit, fit.name)
            for of_experiment in fit.by_experiment:
                rows += _rows(of_experiment, f"  {of_experiment.name}")
        heads = ["fit / %", "simulation", "one step ahead", f"{self[0].steps} steps ahead"]
        columns = list(zip(heads, zip(*rows, strict=True), strict=True))
        if self[0].steps == 1:
            # the last column would repeat the one before
            columns.pop()
        return Table(columns)


def _rows(fit: ModelFit, label: str) -> list[list[str]]:
    """A row of the table for each output: its label, and the fits."""
    rows = []
    for i, output in enumerate(fit._labels):
        values = (fit.simulation[i], fit.one_step[i], fit.ahead[i])
        name = f"{label}, {output}" if output else label
        rows.append([name, *(f"{value:.2f}" for value in values)])
    return rows


def compare(
    models: Model | Sequence[Model] | Mapping[str, Model], data: IOData | Sequence[IOData], *, steps: int = 1
) -> Fits:
    """Percent fit of models in simulation and prediction; unlike in MATLAB, models come first and nothing is drawn.

    The fit is 100 (1 - |y - yhat| / |y - mean(y)|), without the initialisation window. The initial state is fitted by
    least squares: to the initialisation window if the record has one, else to the whole record. Channels are matched by
    name, as in `predict`. Over several experiments the squares of errors and of deviations, each from its own mean, are
    summed.

    Args:
        models: A model, an estimate or a choice of `auto`, several, or several by name. Polynomials take the sampling
            interval of the data; continuous-time models and systems of python-control and SciPy are sampled at it,
            exactly for a held input. Systems in discrete time must have the interval of the data.
        data: The record or records, preferably ones that no model was fitted to.
        steps: Horizon of a further prediction, from outputs up to t - steps; one-step prediction and simulation are
            always included.

    Returns:
        One record per model, in their sequence: a tuple that prints as a table.

    Raises:
        SysidError: No model, another sampling interval, channels that do not fit, an output that is constant,
            steps < 1.

    Warns:
        SysidWarning: A model was estimated from one of the records, or beside a line in the output that these have too.
    """
    check_no_data(models)
    steps = whole_number("steps (the simulation is always included)", steps, 1)
    experiments = as_experiments(data, missing=True, series=True)
    named = models if isinstance(models, Mapping) else _named(models, experiments[0])
    if not named:
        raise SysidError("expected at least one model, got none")
    fits = Fits(_fit_to_experiments(name, model, experiments, steps) for name, model in named.items())
    if training := [fit.name for fit in fits if fit.is_training]:
        message = f"{', '.join(training)}: {OWN_DATA}, so that the fit is no validation"
        warnings.warn(message, SysidWarning, stacklevel=2)
    for name, model in named.items():
        if left := line_left(model, experiments):
            warnings.warn(f"{name}: it {left}", SysidWarning, stacklevel=2)
    return fits


def is_training(model: Model, experiments: Sequence[IOData]) -> bool:
    """Whether a model was estimated from one of the experiments, or from its beginning; false where nobody knows."""
    model = chosen_model(model)
    return isinstance(model, Estimate) and any(model.data.include(experiment) for experiment in experiments)


def _named(models: Model | Sequence[Model], record: IOData) -> dict[str, Model]:
    """Models by number and method."""
    sequence = models if isinstance(models, Sequence) else [models]
    chosen = [chosen_model(model) for model in sequence]
    for model in chosen:
        as_model(model, record)  # refuses what is no model
    # numbers tell two estimates of one method apart
    named: dict[str, Model] = {}
    for k, model in enumerate(chosen, 1):
        method = model.method if isinstance(model, Estimate) else "model"
        named[f"{k}: {method}"] = model
    return named


@dataclass(frozen=True, eq=False)
class _Outputs:
    """Outputs of a model for one experiment: simulated, predicted one step ahead, and over the horizon (N, ny)."""

    simulated: FloatArray
    predicted: FloatArray
    ahead: FloatArray


def _fit_to_experiments(name: str, model: Model, experiments: Sequence[IOData], steps: int) -> ModelFit:
    """Fit of a model to all experiments, with that to each of several."""
    own_data = is_training(model, experiments)
    outputs = []
    for experiment in experiments:
        # with steps = 1 one prediction serves twice
        by_horizon = {horizon: predict(model, experiment, steps=horizon) for horizon in {None, 1, steps}}
        outputs.append(_Outputs(by_horizon[None], by_horizon[1], by_horizon[steps]))
    if len(experiments) == 1:
        return replace(_fit_of_outputs(name, experiments, outputs, steps), is_training=own_data)
    fits = []
    for k, (experiment, of_experiment) in enumerate(zip(experiments, outputs, strict=True), 1):
        label = experiment.name or f"experiment {k}"
        fits.append(_fit_of_outputs(label, [experiment], [of_experiment], steps))
    return replace(_fit_of_outputs(name, experiments, outputs, steps, tuple(fits)), is_training=own_data)


def _fit_of_outputs(
    name: str,
    experiments: Sequence[IOData],
    outputs: Sequence[_Outputs],
    steps: int,
    by_experiment: tuple[ModelFit, ...] = (),
) -> ModelFit:
    """Compare the outputs of a model with those of experiments, taken together."""
    simulated = [output.simulated for output in outputs]
    predicted = [output.predicted for output in outputs]
    ahead = [output.ahead for output in outputs]
    return ModelFit(
        name=name,
        simulation=_fit_together(experiments, simulated),
        one_step=_fit_together(experiments, predicted),
        simulated=np.concatenate(simulated),
        predicted=np.concatenate(predicted),
        steps=steps,
        ahead=_fit_together(experiments, ahead),
        predicted_ahead=np.concatenate(ahead),
        by_experiment=by_experiment,
        output_names=experiments[0].output_names or (),
    )


def _fit_together(experiments: Sequence[IOData], predictions: Sequence[FloatArray]) -> FloatArray:
    """Fit in percent per output (ny,), squares of errors and of deviations summed over the experiments."""
    measured, predicted = [], []
    for experiment, prediction in zip(experiments, predictions, strict=True):
        y = experiment.scored.y
        # an unstable model may overflow: infinity minus infinity counts as infinite
        yhat = np.nan_to_num(prediction[experiment.window :], nan=np.inf, posinf=np.inf, neginf=-np.inf)
        if len(experiments) > 1:
            # a common mean would count differences of level between experiments as explained
            level = np.nanmean(y, axis=0)
            y, yhat = y - level, yhat - level
        measured.append(y)
        predicted.append(yhat)
    return fit_percent(np.concatenate(measured), np.concatenate(predicted))


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
    y, yhat = _output_table("y", y), _output_table("yhat", yhat)
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
    measured = np.isfinite(y)
    # missing samples count neither in the error nor in the spread
    error = np.where(measured, np.abs(np.where(measured, y, 0.0) - yhat), 0.0)
    largest = error.max(axis=0)
    finite = np.isfinite(largest)
    # scaled first: errors of an unstable predictor may overflow when squared
    scale = np.where(finite & (largest > 0.0), largest, 1.0)
    scaled = np.where(finite, error, 0.0) / scale
    size = np.where(finite, scale * np.linalg.norm(scaled, axis=0), np.inf)
    return np.asarray(100.0 * (1.0 - size / spread))


def _output_table(name: str, value: ArrayLike) -> FloatArray:
    """Outputs (N, ny) as numbers; of a single output (N,) too."""
    try:
        table = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise SysidError(f"{name}: expected numbers (N, ny), got a value of type {type(value).__name__}") from error
    if table.ndim not in (1, 2) or not table.size:
        raise SysidError(f"{name}: expected shape (N, ny), got {table.shape}")
    return table[:, None] if table.ndim == 1 else table
