"""Scores of predictions and models on the test part of a data set, and files of predictions."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin.files.netcdf import read_netcdf
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.spec import UNITS, Scoring
from scenarios.datasets.tables import read_rows
from scenarios.files.errors import ScenarioError, unknown
from sysid import Estimate, Polynomials, StateSpace, SysidError
from sysid.models.polynomials import innovations_form
from sysid.records.mat_variables import read_variables
from sysid.validation.predictors import Predictor, as_predictor

ENDINGS = (".nc", ".csv", ".mat")
"""Endings of files of predictions; other files in their folder are ignored."""

EXPECTED = "a folder, or files EXPERIMENT.csv, .nc or .mat, one for each record of the test part"

MOST_DIGITS = 64
"""Bytes of a number and its separator in a CSV file of predictions, at most; a float64 in full takes 25."""

MOST_NAMED = 5
"""Records without predictions that an error names."""

Model = Predictor | StateSpace | Estimate | Polynomials
"""Submissions that can be scored besides predictions."""


class Score(NamedTuple):
    """The score of one output on one record, in the metric and unit of the data set."""

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
        values: dict[str, list[float]] = {}
        for output in self.scores:
            values.setdefault(output.joint, []).append(output.value)
        return {joint: float(np.mean(scores)) for joint, scores in values.items()}

    @property
    def unit(self) -> str:
        """Unit of the scores: that of the angle for a root mean square error, else percent."""
        return self.scoring.unit


def score(
    predictions: Path | str | Sequence[Path] | Mapping[str, np.ndarray], data_set: DataSet | Path | str
) -> Scores:
    """Score predicted outputs of the test part, behind the window, in the metric of the data set.

    Of files there is one for each record, named after the experiment: EXPERIMENT.csv has the names of the outputs in
    its first row, then a row per sample; EXPERIMENT.nc a variable y (sample, output) and the names in a variable
    output; EXPERIMENT.mat (version 7 or older) a matrix y, outputs in columns in the order of the index. All
    samples are there, rad; those of the window are ignored and may be NaN.

    Args:
        predictions: A folder, files, or outputs (N, ny), rad, by experiment.
        data_set: The data set or its folder.

    Raises:
        ScenarioError: A record without predictions or with two files of them, predictions of no such record, or such
            that are damaged or have other channels, another length, or values behind the window that are not finite.
    """
    opened = data_set if isinstance(data_set, DataSet) else open_data_set(data_set)
    records = {record.name: record for record in opened.test}
    sources: Mapping[str, Path | np.ndarray]
    sources = predictions if isinstance(predictions, Mapping) else _files_by_experiment(predictions)
    for name, source in sources.items():
        if name not in records:
            origin = source if isinstance(source, Path) else opened.label
            raise ScenarioError(f"{origin}: no test record: {unknown('experiment', name, records)}")
    if missing := [name for name in records if name not in sources]:
        and_others = " and others" if len(missing) > MOST_NAMED else ""
        raise ScenarioError(
            f"{opened.label}: no predictions of {', '.join(missing[:MOST_NAMED])}{and_others}: {len(sources)} of "
            f"{len(records)} given; expected {EXPECTED}"
        )
    # All are read before any is scored: no score of a submission that is damaged.
    outputs = {name: _predicted_outputs(record, sources[name]) for name, record in records.items()}
    return score_outputs(opened.spec.scoring, records.values(), lambda record: outputs[record.name])


def score_model(model: Model | Callable[[DataRecord], Model], data_set: DataSet | Path | str) -> Scores:
    """Score a model on the test part by the same rules: its initial state is estimated from the window alone.

    Args:
        model: A model, or a function that returns the model of each record.
        data_set: The data set or its folder.

    Raises:
        ScenarioError: No test records.
        SysidError: A model without operating point and a data set without a window, or other channels than the model's.
    """
    opened = data_set if isinstance(data_set, DataSet) else open_data_set(data_set)

    def outputs(record: DataRecord) -> np.ndarray:
        # A new one for each record: a function may return another model.
        predictor = as_predictor(_model_of(model, record))
        return predictor.predicted(record.iodata(), opened.spec.scoring.steps)

    return score_outputs(opened.spec.scoring, opened.test, outputs)


def _model_of(model: Model | Callable[[DataRecord], Model], record: DataRecord) -> StateSpace | Estimate | Predictor:
    """The model to score on a record; polynomials at the sampling time of the record."""
    # Predictors may be callable too, and are models nevertheless.
    is_model = isinstance(model, StateSpace | Estimate | Polynomials) or hasattr(model, "predicted")
    chosen: Any = model if is_model or not callable(model) else model(record)
    if isinstance(chosen, Polynomials):
        return innovations_form(chosen, record.sampling_time)
    if not isinstance(chosen, StateSpace | Estimate) and not hasattr(chosen, "predicted"):
        raise ScenarioError(
            f"a model of type {type(chosen).__name__} given, expected a StateSpace, Polynomials, an estimate of "
            "sysid, or a function that returns one of these for each record; outputs are scored by score()"
        )
    return chosen


def score_outputs(
    scoring: Scoring, records: Iterable[DataRecord], outputs: Callable[[DataRecord], np.ndarray]
) -> Scores:
    """Score predicted outputs of records.

    Args:
        scoring: Metric, unit and horizon.
        records: The records.
        outputs: Returns the predicted outputs (N, ny), rad, of a record; not finite where a model diverges.

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
        data, predicted = record.iodata(), outputs(record)
        values = metric(scoring, data.y[data.window :], predicted[data.window :])
        for joint, value in zip(record.joints, values, strict=True):
            scores.append(Score(record.name, joint, float(value)))
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
    # A model that diverges overflows; its infinite error is its score.
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.abs(measured - predicted)
        rmse = np.where(np.isfinite(error).all(axis=0), np.sqrt(np.mean(error**2, axis=0)), np.inf)
    return in_metric(scoring, rmse, measured.std(axis=0))


def in_metric(scoring: Scoring, rmse: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Convert root mean square errors, rad, to a metric; `spread`: standard deviations of the outputs, rad."""
    if scoring.metric == "rmse":
        return UNITS[scoring.unit] * rmse
    if not (spread > 0.0).all():
        raise ScenarioError(f"an output does not move: {scoring.metric} is not defined, rmse is")
    relative = 100.0 * rmse / spread
    return relative if scoring.metric == "nrmse" else 100.0 - relative


def _predicted_outputs(record: DataRecord, source: Path | np.ndarray) -> np.ndarray:
    """Predicted outputs as (N, ny), from a file where that is given; refused where they do not fit the record."""
    shape = (len(record), len(record.joints))
    if isinstance(source, Path):
        origin = str(source)
        # Two rows and a column to spare, for the header and an index; a larger file would fill the memory.
        most_bytes = MOST_DIGITS * (len(record) + 2) * (len(record.joints) + 1)
        if source.suffix == ".csv" and source.stat().st_size > most_bytes:
            raise ScenarioError(
                f"{source} has {source.stat().st_size} bytes, expected at most {most_bytes} for its record"
            )
        table = _read(source, record.joints, shape)
    else:
        origin = record.name
        table = _shaped(np.asarray(source), record.joints, shape, origin)
    window = record.state_initialization_window_length or 0
    not_finite = np.argwhere(~np.isfinite(table[window:]))
    if len(not_finite):
        first_sample, first_output = not_finite[0]
        raise ScenarioError(
            f"{origin}: {len(not_finite)} numbers behind the window are not finite, the first at sample "
            f"{window + first_sample} of {record.joints[first_output]}"
        )
    return table


def _shaped(values: np.ndarray, outputs: tuple[str, ...], shape: tuple[int, int], source: object) -> np.ndarray:
    """Check that predicted outputs are real numbers of a shape, and return them as floats."""
    # Texts and complex numbers would become floats, with a warning at most.
    if values.dtype.kind not in "iuf":
        raise ScenarioError(f"{source}: values of type {values.dtype} given, expected real numbers")
    table = values[:, None] if values.ndim == 1 else values
    if table.shape != shape:
        hint = "; time runs along the first axis" if table.shape == shape[::-1] else ""
        raise ScenarioError(
            f"{source}: predictions of shape {values.shape} given, expected {shape}: {shape[0]} samples of "
            f"{', '.join(outputs)}{hint}"
        )
    return table.astype(float)


def _files_by_experiment(paths: Path | str | Sequence[Path]) -> dict[str, Path]:
    """Files of predictions by the experiment that they are named after."""
    if isinstance(paths, str):
        paths = Path(paths)
    if isinstance(paths, Path):
        paths = (paths,)
    files: dict[str, Path] = {}
    for path in _files(paths):
        if path.stem in files:
            raise ScenarioError(f"{path.stem} has two files of predictions: {files[path.stem]} and {path}")
        files[path.stem] = path
    return files


def _files(paths: Iterable[Path]) -> Iterator[Path]:
    """Files of predictions among paths and in folders."""
    for path in paths:
        if path.is_dir():
            yield from sorted(file for file in path.iterdir() if file.suffix in ENDINGS and file.is_file())
        elif not path.exists():
            raise ScenarioError(f"no predictions at {path}: expected {EXPECTED}")
        elif path.suffix not in ENDINGS or not path.is_file():
            raise ScenarioError(f"{path} given as predictions, expected {EXPECTED}")
        else:
            yield path


def _read(path: Path, outputs: tuple[str, ...], shape: tuple[int, int]) -> np.ndarray:
    """Predicted outputs in a file of one of `ENDINGS`; matrices of MATLAB have no names of outputs."""
    names = outputs
    if path.suffix == ".csv":
        names, values = _read_csv(path)
    elif path.suffix == ".mat":
        try:
            matrices = read_variables(path, ("y",))
        except SysidError as error:
            raise ScenarioError(f"cannot read {path}: {error}") from error
        if "y" not in matrices:
            raise ScenarioError(f"{path} has no matrix y")
        values = matrices["y"]
    else:
        variables = read_netcdf(path).variables
        if missing := {"y", "output"} - variables.keys():
            raise ScenarioError(f"{path} has no variable {min(missing)}, but {', '.join(variables) or 'none'}")
        values = variables["y"].values
        names = tuple(map(str, variables["output"].values.ravel()))
    # A file without a header: its first sample was taken for names.
    if path.suffix == ".csv" and names and all(_is_number(name) for name in names):
        raise ScenarioError(f"{path}: the first row holds numbers, expected names of outputs: {','.join(outputs)}")
    if names != outputs:
        raise ScenarioError(
            f"{path}: outputs {', '.join(names) or 'without names'} given, expected {', '.join(outputs)} in this order"
        )
    return _shaped(values, outputs, shape, path)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_csv(path: Path) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the outputs, from the first row, and their values, from the others."""
    header, *rows = read_rows(path, "predictions") or [[]]
    values = np.full((len(rows), len(header)), np.nan)
    for index, row in enumerate(rows):
        try:
            # Python reads 1_0 as 10; in a table of numbers it is a slip.
            row_values = [float(word.replace("_", "x")) for word in row]
        except ValueError:
            row_values = []
        if len(row_values) != len(header):
            cells = ",".join(row)[:60]
            # Rows are counted from 1, the header included.
            raise ScenarioError(f"{path}, row {index + 2}: {cells!r} given, expected {len(header)} numbers")
        values[index] = row_values
    return tuple(name.strip() for name in header), values
