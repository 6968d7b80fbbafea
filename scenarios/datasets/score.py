"""Scores of predictions and models on the test part of a data set, and files of predictions."""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.spec_tables import UNITS, Scoring
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.mat_file import read_mat_numbers
from scenarios.files.netcdf import read_netcdf
from scenarios.identification.predictors import Predictor, as_predictor
from sysid import Estimate, StateSpace

ENDINGS = (".nc", ".csv", ".mat")
"""Endings of files of predictions; other files in their folder are ignored."""

EXPECTED = "a folder, or files EXPERIMENT.csv, .nc or .mat, one for each record of the test part"

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
        """The primary score: the mean over all records and outputs, each pair counted once."""
        return float(np.mean([score.value for score in self.scores]))

    @property
    def by_joint(self) -> Mapping[str, float]:
        """Mean score of each output over the records that have it."""
        joints = dict.fromkeys(score.joint for score in self.scores)
        return {joint: float(np.mean([s.value for s in self.scores if s.joint == joint])) for joint in joints}

    @property
    def unit(self) -> str:
        """Unit of the scores: that of the angle for a root mean square error, else percent."""
        return self.scoring.unit


def score(predictions: Path | Sequence[Path] | Mapping[str, np.ndarray], data_set: DataSet | Path | str) -> Scores:
    """Score predicted outputs of the test part, behind the window, in the metric of the data set.

    Args:
        predictions: A folder or files (see `read_predictions`), or outputs (N, ny), rad, by experiment.
        data_set: The data set or its folder.

    Raises:
        ScenarioError: Predictions are missing or do not fit their record.
    """
    opened = _opened(data_set)
    records = opened.test
    if not isinstance(predictions, Mapping):
        return score_outputs(opened.spec.scoring, records, read_predictions(predictions, records).__getitem__)
    strange = sorted(predictions.keys() - {record.name for record in records})
    missing = [record.name for record in records if record.name not in predictions]
    if strange or missing:
        what = f"no predictions of {', '.join(missing[:5])}" if missing else f"no test record {strange[0]}"
        raise ScenarioError(f"{opened.label}: {what}; {len(predictions)} given, expected {len(records)}")
    outputs = {record.name: _fitting(record, predictions[record.name], record.name) for record in records}
    return score_outputs(opened.spec.scoring, records, outputs.__getitem__)


def score_model(
    model: Model | Callable[[DataRecord], Model],
    data_set: DataSet | Path | str,
    *,
    records: Sequence[DataRecord] | None = None,
    scoring: Scoring | None = None,
) -> Scores:
    """Score a model by the same rules: its initial state is estimated from the window alone.

    Args:
        model: A model, or a function that returns the model of each record.
        data_set: The data set or its folder.
        records: Records to score on; the test part by default.
        scoring: Metric, unit and horizon; those of the data set by default.

    Raises:
        ScenarioError: No records, or a model without operating point and a data set without a window.
        SysidError: The channels are not those of the model.
    """
    opened = _opened(data_set)
    rule = scoring or opened.spec.scoring
    by_name = {record.name: record for record in (opened.test if records is None else records)}

    def outputs(name: str) -> np.ndarray:
        record = by_name[name]
        one = model if isinstance(model, StateSpace | Estimate) or hasattr(model, "predicted") else model(record)
        window = opened.spec.window if record.part == "train" else record.state_initialization_window_length
        return as_predictor(one).predicted(replace(record.iodata(), window=window or 0), rule.steps)

    return score_outputs(rule, tuple(by_name.values()), outputs)


def score_outputs(scoring: Scoring, records: Iterable[DataRecord], outputs: Callable[[str], np.ndarray]) -> Scores:
    """Score predicted outputs of records.

    Args:
        scoring: Metric, unit and horizon.
        records: The records.
        outputs: Returns the predicted outputs (N, ny), rad, of an experiment; not finite where a model diverges.

    Raises:
        ScenarioError: No records, or withheld outputs.
    """
    scores: list[Score] = []
    for record in records:
        if record.signals.withheld:
            raise ScenarioError(
                f"the outputs of {record.name} behind the window are withheld; whoever has the complete data set "
                "scores it, by hmtb dataset grade"
            )
        data, predicted = record.iodata(), outputs(record.name)
        values = metric(scoring, data.y[data.window :], predicted[data.window :])
        scores += [Score(record.name, joint, float(value)) for joint, value in zip(record.joints, values, strict=True)]
    if not scores:
        raise ScenarioError("no records to score on")
    return Scores(scoring, tuple(scores))


def metric(scoring: Scoring, measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return the metric of each output (ny,): `rmse` in the unit, `nrmse` and `fit` in percent.

    Args:
        scoring: Metric and unit.
        measured: Outputs (N, ny), rad, without the window.
        predicted: Likewise; values that are not finite give an infinite error.

    Raises:
        ScenarioError: Measured outputs are missing, or one does not move, for which only `rmse` is defined.
    """
    if not np.isfinite(measured).all():
        raise ScenarioError("measured outputs are missing: there is no score of such a record")
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(measured - predicted)
        rmse = np.where(np.isfinite(error).all(axis=0), np.sqrt(np.mean(error**2, axis=0)), np.inf)
    return in_metric(scoring, rmse, measured.std(axis=0))


def in_metric(scoring: Scoring, rmse: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Convert root mean square errors to the metric of a data set.

    Args:
        scoring: Metric and unit.
        rmse: Root mean square errors, rad.
        spread: Standard deviations of the outputs, rad.

    Raises:
        ScenarioError: An output that does not move, for which only `rmse` is defined.
    """
    if scoring.metric == "rmse":
        return UNITS[scoring.unit] * rmse
    if not (spread > 0.0).all():
        raise ScenarioError(f"an output does not move: {scoring.metric} is not defined, rmse is")
    relative = 100.0 * rmse / spread
    return relative if scoring.metric == "nrmse" else 100.0 - relative


def read_predictions(paths: Path | Sequence[Path], records: Sequence[DataRecord]) -> Mapping[str, np.ndarray]:
    """Read predictions: one file for each record, named after the experiment.

    EXPERIMENT.csv has the names of the outputs in its first row, then a row per sample; EXPERIMENT.nc a variable y
    (sample, output) and the names in a variable output; EXPERIMENT.mat (version 7 or older) a matrix y, outputs in
    columns in the order of the index. All samples are there, rad; those of the window are ignored and may be NaN.

    Args:
        paths: A folder, or files.
        records: The records that are to be predicted.

    Returns:
        Outputs (N, ny), rad, by experiment.

    Raises:
        ScenarioError: A record without predictions or with two files of them, a file of no such record, or one that is
            damaged or has other channels, another length, or values behind the window that are not finite.
    """
    known = {record.name: record for record in records}
    files: dict[str, Path] = {}
    for path in _files(paths):
        if path.stem not in known:
            raise ScenarioError(f"{path} is of no record to predict: {unknown('experiment', path.stem, known)}")
        if path.stem in files:
            raise ScenarioError(f"{path.stem} has two files of predictions: {files[path.stem]} and {path}")
        files[path.stem] = path
    missing = [name for name in known if name not in files]
    if missing:
        more = " and others" if len(missing) > 5 else ""
        raise ScenarioError(
            f"no predictions of {', '.join(missing[:5])}{more}: {len(files)} of {len(known)} files there; "
            f"expected {EXPECTED}"
        )
    return {
        name: _fitting(record, _read(files[name], record.joints), str(files[name])) for name, record in known.items()
    }


def _fitting(record: DataRecord, values: np.ndarray, source: str) -> np.ndarray:
    """Predicted outputs as (N, ny); refused where they do not fit the record."""
    values = np.asarray(values)
    if values.dtype.kind not in "iuf":
        raise ScenarioError(f"{source}: values of type {values.dtype} given, expected real numbers")
    table = values[:, None] if values.ndim == 1 else values
    shape = (len(record), len(record.joints))
    if table.shape != shape:
        hint = "; time runs along the first axis" if table.shape == shape[::-1] else ""
        raise ScenarioError(
            f"{source}: predictions of shape {values.shape} given, expected {shape}: {shape[0]} samples of "
            f"{', '.join(record.joints)}{hint}"
        )
    window = record.state_initialization_window_length or 0
    wrong = np.argwhere(~np.isfinite(table[window:]))
    if len(wrong):
        sample, output = wrong[0]
        raise ScenarioError(
            f"{source}: {len(wrong)} numbers behind the window are not finite, the first at sample {window + sample} "
            f"of {record.joints[output]}"
        )
    return table.astype(float)


def _files(paths: Path | Sequence[Path]) -> Iterable[Path]:
    for path in (paths,) if isinstance(paths, Path) else paths:
        if path.is_dir():
            yield from sorted(entry for entry in path.iterdir() if entry.suffix in ENDINGS and entry.is_file())
        elif not path.exists():
            raise ScenarioError(f"no predictions at {path}: expected {EXPECTED}")
        elif path.suffix not in ENDINGS or not path.is_file():
            raise ScenarioError(f"{path} given as predictions, expected {EXPECTED}")
        else:
            yield path


def _read(path: Path, outputs: tuple[str, ...]) -> np.ndarray:
    if path.suffix == ".mat":
        matrices = read_mat_numbers(path, ("y",))
        if "y" not in matrices:
            raise ScenarioError(f"{path} has no matrix y")
        return matrices["y"]
    if path.suffix == ".csv":
        return _read_csv(path, outputs)
    variables = read_netcdf(path).variables
    for name in ("y", "output"):
        if name not in variables:
            raise ScenarioError(f"{path} has no variable {name}, but {', '.join(variables) or 'none'}")
    _check_names(path, tuple(map(str, variables["output"].values.ravel())), outputs)
    return variables["y"].values


def _read_csv(path: Path, outputs: tuple[str, ...]) -> np.ndarray:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read {path}: {error}") from error
    _check_names(path, tuple(word.strip() for word in rows[0]) if rows else (), outputs)
    values = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            # Python reads 1_0 as 10; in a table of numbers it is a slip.
            numbers = [float(word) for word in row if "_" not in word]
        except ValueError:
            numbers = []
        if len(numbers) != len(outputs) or len(row) != len(outputs):
            raise ScenarioError(f"{path}, row {number}: {','.join(row)[:60]!r} given, expected {len(outputs)} numbers")
        values.append(numbers)
    return np.array(values, dtype=float)


def _check_names(path: Path, names: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    if names != outputs:
        raise ScenarioError(
            f"{path}: outputs {', '.join(names) or 'without names'} given, expected {', '.join(outputs)} in this order"
        )


def _opened(data_set: DataSet | Path | str) -> DataSet:
    return data_set if isinstance(data_set, DataSet) else open_data_set(data_set)
