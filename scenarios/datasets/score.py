"""Scores of predictions and models on the test part of a data set, and the predictors that give a model's outputs."""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.linalg import block_diag

from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.predictions import checked, read_predictions
from scenarios.datasets.spec_tables import UNITS, Scoring
from scenarios.files.errors import ScenarioError
from sysid import Estimate, IOData, StateSpace, SysidWarning, predict
from sysid.records.arrays import FloatArray


class Predictor(Protocol):
    """Predicts the outputs of a record."""

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny).

        Args:
            record: Inputs, outputs and the window.
            steps: How far ahead: the output at t may use those up to t - steps; 0: those of the window alone.
        """
        ...


@dataclass(frozen=True, eq=False)
class ModelPredictor:
    """A linear model about an operating point.

    Attributes:
        model: The model.
        inputs: Inputs of the operating point (nu,), rad; None with `outputs`.
        outputs: Outputs of it (ny,), rad. None: a constant on every output is found from the window, together with the
            initial state.
    """

    model: StateSpace
    inputs: FloatArray | None = None
    outputs: FloatArray | None = None

    def __post_init__(self) -> None:
        if (self.inputs is None) != (self.outputs is None):
            raise ScenarioError("an operating point has inputs and outputs; one of them given")

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny); the initial state is fitted by least squares to the window alone.

        Without a window the model starts at rest at its operating point.

        Raises:
            ScenarioError: Neither a window nor an operating point: nothing tells the outputs' level.
            SysidError: The channels are not those of the model.
        """
        ahead = steps or None
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # An unstable predictor shows in its score.
            warnings.simplefilter("ignore", SysidWarning)
            if self.inputs is not None and self.outputs is not None:
                about = record.subtract(u=self.inputs, y=self.outputs)
                start = None if record.window else np.zeros(self.model.order)
                return predict(self.model, about, steps=ahead, x0=start) + self.outputs
            if not record.window:
                raise ScenarioError(
                    f"{record.name or 'the record'} has no initialisation window: expected a model with its operating "
                    "point, because nothing else tells the level of the outputs"
                )
            about = record.subtract(u=record.u[: record.window].mean(axis=0))
            return predict(_with_constant(self.model), about, steps=ahead)


@dataclass(frozen=True, eq=False)
class StackedPredictor:
    """A predictor of its own for every output.

    Attributes:
        rows: One per output, each of all inputs.
    """

    rows: tuple[Predictor, ...]

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        parts = (row.predicted(record.select(outputs=[i]), steps) for i, row in enumerate(self.rows))
        return np.hstack(tuple(parts))


@dataclass(frozen=True, eq=False)
class Hold:
    """The last output that is known, for as long as none follows.

    Attributes:
        level: Outputs where none is known (ny,), rad.
    """

    level: FloatArray

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        last = np.arange(len(record)) - steps if steps else np.full(len(record), record.window - 1)
        return np.where((last >= 0)[:, None], record.y[np.maximum(last, 0)], self.level)


@dataclass(frozen=True, eq=False)
class StaticGain:
    """Outputs that follow the inputs at once.

    Attributes:
        gain: (ny, nu).
        level: (ny,), rad.
    """

    gain: FloatArray
    level: FloatArray

    def predicted(self, record: IOData, steps: int) -> FloatArray:
        """Return the outputs (N, ny)."""
        return np.asarray(record.u @ self.gain.T + self.level)

    @classmethod
    def fitted(cls, parts: Sequence[IOData]) -> "StaticGain":
        """The one that fits records best, by least squares."""
        u, y = (np.concatenate([getattr(part, name) for part in parts]) for name in "uy")
        solution, *_ = np.linalg.lstsq(np.column_stack([u, np.ones(len(u))]), y, rcond=None)
        return cls(solution[:-1].T, solution[-1])


def as_predictor(model: Predictor | StateSpace | Estimate) -> Predictor:
    """A model as a predictor; a bare one finds its operating point in each window."""
    if isinstance(model, Estimate):
        return ModelPredictor(model.model)
    return ModelPredictor(model) if isinstance(model, StateSpace) else model


def _with_constant(model: StateSpace) -> StateSpace:
    """The model with one more state per output, a constant that adds to it."""
    ny = model.ny
    return replace(
        model,
        A=block_diag(model.A, np.eye(ny)),
        B=np.vstack([model.B, np.zeros((ny, model.nu))]),
        C=np.hstack([model.C, np.eye(ny)]),
        K=np.vstack([model.gain, np.zeros((ny, ny))]),
    )


Model = Predictor | StateSpace | Estimate
"""What can be scored besides predictions."""


@dataclass(frozen=True)
class Score:
    """The score of one output on one record.

    Attributes:
        experiment: The record.
        joint: The output.
        value: In the metric and unit of the data set.
    """

    experiment: str
    joint: str
    value: float


@dataclass(frozen=True)
class Scores:
    """The scores of all outputs of all records.

    Attributes:
        scoring: Metric, unit and horizon.
        scores: One per record and output.
    """

    scoring: Scoring
    scores: tuple[Score, ...]

    @property
    def mean(self) -> float:
        """The arithmetic mean over all records and outputs, each pair counted once: the primary score."""
        return _mean(self.scores)

    @property
    def by_joint(self) -> Mapping[str, float]:
        """For each output the arithmetic mean over the records that have it."""
        joints = dict.fromkeys(score.joint for score in self.scores)
        return {joint: _mean([s for s in self.scores if s.joint == joint]) for joint in joints}

    @property
    def unit(self) -> str:
        """Of the scores: that of the angle for a root mean square error, else percent."""
        return self.scoring.unit


def score(predictions: Path | Sequence[Path] | Mapping[str, np.ndarray], data_set: DataSet | Path | str) -> Scores:
    """Score predicted outputs of the test part.

    Args:
        predictions: A folder or files (see `predictions.FORMATS`), or outputs (N, ny), rad, by experiment.
        data_set: The data set or its folder.

    Returns:
        The scores, behind the initialisation window, in the metric that the data set states.

    Raises:
        ScenarioError: Predictions are missing or do not fit their record.
    """
    opened = _opened(data_set)
    records = opened.test
    if not isinstance(predictions, Mapping):
        return scored(opened.spec.scoring, records, read_predictions(predictions, records).__getitem__)
    strange = sorted(predictions.keys() - {record.name for record in records})
    missing = [record.name for record in records if record.name not in predictions]
    if strange or missing:
        what = (
            f"no predictions of {', '.join(missing[:5])}" if missing else f"{strange[0]} is no record of the test part"
        )
        raise ScenarioError(f"{opened.label}: {what}; {len(predictions)} given, expected {len(records)}")
    fitting = {record.name: checked(record, predictions[record.name], record.name) for record in records}
    return scored(opened.spec.scoring, records, fitting.__getitem__)


def score_model(
    model: Model | Callable[[DataRecord], Model],
    data_set: DataSet | Path | str,
    *,
    records: Sequence[DataRecord] | None = None,
    scoring: Scoring | None = None,
) -> Scores:
    """Score a model by the same rules: its initial state is found from the window alone.

    Args:
        model: A model, or for each record the one that predicts it.
        data_set: The data set or its folder.
        records: Records to score on; the test part by default.
        scoring: Metric, unit and horizon; those of the data set by default.

    Raises:
        ScenarioError: No records, or a model without operating point and a data set without a window.
        SysidError: The channels are not those of the model.
    """
    opened = _opened(data_set)
    rule = scoring or opened.spec.scoring
    chosen = {record.name: record for record in (opened.test if records is None else records)}

    def hat(name: str) -> np.ndarray:
        record = chosen[name]
        found = model if isinstance(model, StateSpace | Estimate) or hasattr(model, "predicted") else model(record)
        window = opened.spec.window if record.part == "train" else record.state_initialization_window_length
        return as_predictor(found).predicted(replace(record.iodata(), window=window or 0), rule.steps)

    return scored(rule, tuple(chosen.values()), hat)


def scored(scoring: Scoring, records: Iterable[DataRecord], hat: Callable[[str], np.ndarray]) -> Scores:
    """Score outputs of some records.

    Args:
        scoring: Metric, unit and horizon.
        records: The records.
        hat: Predicted outputs (N, ny), rad, by experiment; infinite and NaN from a model that grows beyond all numbers.

    Raises:
        ScenarioError: No records.
    """
    found: list[Score] = []
    for record in records:
        if record.signals.withheld:
            raise ScenarioError(
                f"the outputs of {record.name} behind the window are withheld; whoever has the complete data set "
                "scores it, by hmtb dataset grade"
            )
        data, predicted = record.iodata(), hat(record.name)
        window = data.window
        values = metric(scoring, data.y[window:], predicted[window:])
        found += [Score(record.name, joint, float(v)) for joint, v in zip(record.joints, values, strict=True)]
    if not found:
        raise ScenarioError("no records to score on")
    return Scores(scoring, tuple(found))


def metric(scoring: Scoring, measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """The metric of each output (ny,).

    Args:
        scoring: Metric and unit.
        measured: Outputs (N, ny), rad, window cut off.
        predicted: Likewise; not finite: an infinite error.

    Returns:
        `rmse` in the unit, `nrmse` and `fit` in percent.

    Raises:
        ScenarioError: Measured outputs are missing, or one does not move, of which only `rmse` is defined.
    """
    if not np.isfinite(measured).all():
        raise ScenarioError("measured outputs are missing: there is no score of such a record")
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(measured - predicted)
        rmse = np.where(np.isfinite(error).all(axis=0), np.sqrt(np.mean(error**2, axis=0)), np.inf)
    return in_metric(scoring, rmse, measured.std(axis=0))


def in_metric(scoring: Scoring, rmse: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Root mean square errors in the metric of a data set.

    Args:
        scoring: Metric and unit.
        rmse: Root mean square errors, rad.
        spread: Standard deviations of the outputs, rad.

    Raises:
        ScenarioError: An output that does not move, of which only `rmse` is defined.
    """
    if scoring.metric == "rmse":
        return UNITS[scoring.unit] * rmse
    if not (spread > 0.0).all():
        raise ScenarioError(f"an output does not move: {scoring.metric} is not defined, rmse is")
    relative = 100.0 * rmse / spread
    return relative if scoring.metric == "nrmse" else 100.0 - relative


def _opened(data_set: DataSet | Path | str) -> DataSet:
    return data_set if isinstance(data_set, DataSet) else open_data_set(data_set)


def _mean(scores: Sequence[Score]) -> float:
    return float(np.mean([score.value for score in scores]))
