"""Data sets of the package as the packages `nonlinear_benchmarks` [Champneys2024] and IdentiBench take them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hmtb_twin.files.atomic_write import working_folder
from scenarios.datasets.canonical import load_dataset
from scenarios.datasets.data_set import DataRecord, DataSet, Joints
from scenarios.datasets.spec import UNITS, Scoring
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from identibench import BenchmarkSpec
    from nonlinear_benchmarks.utilities import Input_output_data

INSTALL = "pip install 'hmtb-twin[benchmarks]'"


def nonlinear_benchmark(
    name: str,
    *,
    joint: Joints | None = None,
    block: str | None = None,
    train_test_split: bool = True,
    atleast_2d: bool = False,
    always_return_tuples_of_datasets: bool = False,
    cache: str | Path | None = None,
) -> Any:
    """Load a data set as a loader of the package `nonlinear_benchmarks` does, as its `Input_output_data`.

    Args:
        name: Data set, as for `load_dataset`.
        joint: The joint of records with one input and output; several names: of records with exactly these.
        block: Block of the spec.
        train_test_split: Return two parts; else a tuple of all records.
        atleast_2d: Inputs (N, nu) and outputs (N, ny) also where there is one.
        always_return_tuples_of_datasets: Tuples also where a part has one record.
        cache: Folder of the copies, as for `load_dataset`.

    Returns:
        Training and validation records, then test records: a record, or a tuple of several. Test records have the
        number of samples from which a model may find its initial state.

    Raises:
        ScenarioError: No such data set or no such records, or the package is not installed.
    """
    try:
        from nonlinear_benchmarks.utilities import always_return_tuples_of_datasets_fun, atleast_2d_fun
    except ImportError as error:
        raise ScenarioError(f"the package nonlinear_benchmarks is not installed: {INSTALL}") from error
    selected = load_dataset(name, cache=cache).select(joint=joint, block=block)
    # The package has two parts: validation records belong to the first.
    train = [_input_output_data(record) for record in (*selected.train, *selected.validation)]
    test = [_input_output_data(record) for record in selected.test]
    if not train_test_split:
        return atleast_2d_fun((*train, *test), apply=atleast_2d)
    if not train or not test:
        missing = "test" if train else "training"
        raise ScenarioError(f"{name}: no {missing} records selected; train_test_split=False has all")
    train_part = atleast_2d_fun(_single_or_all(train), apply=atleast_2d)
    test_part = atleast_2d_fun(_single_or_all(test), apply=atleast_2d)
    return always_return_tuples_of_datasets_fun(train_part, test_part, apply=always_return_tuples_of_datasets)


def _single_or_all(records: "Sequence[Input_output_data]") -> "Input_output_data | tuple[Input_output_data, ...]":
    return records[0] if len(records) == 1 else tuple(records)


def identibench_spec(name: str, *, joint: Joints | None = None, cache: str | Path | None = None) -> "BenchmarkSpec":
    """Return the benchmark of a data set for `identibench.run_benchmark`: simulation of its test records.

    The records are written to IdentiBench's data root, once. The score `test` is the primary score of the data set, but
    for the single precision in which IdentiBench keeps records; where the test part has several blocks, each is a test
    set of its own too.

    Args:
        name: Data set, as for `load_dataset`.
        joint: The joint of the records, or several; by default those of the data set if all its records have the same.
        cache: Folder of the copies, as for `load_dataset`.

    Raises:
        ScenarioError: No such data set, records with different joints, a data set that scores predictions, or the
            package is not installed.
    """
    try:
        from identibench import BenchmarkSpec, Dataset, Simulation
    except ImportError as error:
        raise ScenarioError(f"the package identibench is not installed: {INSTALL}") from error
    selected = load_dataset(name, cache=cache)
    if joint is not None:
        selected = selected.select(joint=joint)
    choices = sorted({record.joints for record in selected.index})
    if len(choices) > 1:
        in_words = "; ".join(", ".join(joints) for joints in choices)
        raise ScenarioError(f"{name} has records of different joints; expected joint=... of: {in_words}")
    scoring = selected.spec.scoring
    if scoring.steps:
        raise ScenarioError(
            f"{name} scores predictions {scoring.steps} samples ahead; expected a data set of simulations"
        )
    channels, label = range(len(choices[0])), "-".join((name, *choices[0]))
    # Written here, not by IdentiBench's preparation, which would run a user's script again in another process.
    # With the hash, so that records of another build do not pass for these.
    data = Dataset(f"{label}-{selected.records_hash[:8]}", prepare=None)
    if not data.path.is_dir():
        with working_folder(data.path.parent) as scratch:
            _write_records(selected, scratch / "records")
            (scratch / "records").rename(data.path)
    test_sets = {"test": [(data, "test/*/*.hdf5")]}
    blocks = dict.fromkeys(record.block for record in selected.test)
    if len(blocks) > 1:
        test_sets |= {block: [(data, f"test/{block}/*.hdf5")] for block in blocks}
    validation = [(data, "validation/*/*.hdf5")] if selected.validation else []
    return BenchmarkSpec(
        name=label,
        u_cols=[f"u{k}" for k in channels],
        y_cols=[f"y{k}" for k in channels],
        train=[(data, "train/*/*.hdf5")],
        valid=validation,
        test_sets=test_sets,
        task=Simulation(metric=_metric(scoring), init_window=selected.spec.window),
    )


def _input_output_data(record: DataRecord) -> "Input_output_data":
    from nonlinear_benchmarks.utilities import Input_output_data

    if record.signals.withheld:
        raise ScenarioError(f"{record.name}: its outputs are withheld, expected a data set with all outputs")
    window = record.state_initialization_window_length
    # Copies, because users of the package may write into them; those of the record are locked.
    return Input_output_data(record.u.copy(), record.y.copy(), record.sampling_time, record.name, window)


def _write_records(selected: DataSet, folder: Path) -> None:
    """Write records as IdentiBench reads them."""
    from identibench.utils import iodata_to_hdf5

    for record in selected.records():
        iodata_to_hdf5(_input_output_data(record), folder / record.part / record.block, record.name)


def _metric(scoring: Scoring) -> Callable[[np.ndarray, np.ndarray], float]:
    """The metric of a data set from those of IdentiBench."""
    from identibench import metrics

    compute = {"rmse": metrics.rmse, "nrmse": metrics.nrmse, "fit": metrics.fit_index}[scoring.metric]
    # IdentiBench gives NRMSE as a ratio and the fit in percent
    factor = {"rmse": UNITS.get(scoring.unit, 1.0), "nrmse": 100.0, "fit": 1.0}[scoring.metric]

    def metric(prediction: np.ndarray, target: np.ndarray) -> float:
        return factor * np.mean(compute(prediction, target))

    metric.__name__ = f"{scoring.metric}_{scoring.unit}" if scoring.metric == "rmse" else scoring.metric
    return metric
