"""Predicted outputs of the test records, read from files of any of three formats, strictly."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from scenarios.datasets.data_set import DataRecord
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.mat_numbers import read_mat_numbers
from scenarios.files.netcdf import read_netcdf

ENDINGS = (".nc", ".csv", ".mat")
"""Endings of files of predictions; others beside them are left alone."""

FORMATS = """a folder, or files, with one file for each record of the test part, named after the experiment:
EXPERIMENT.csv, a first row with the names of the outputs, then one row per sample; EXPERIMENT.nc, a variable y (sample,
output), with the names in a variable output; or EXPERIMENT.mat (version 7 or older), a matrix y, outputs in columns
in the order of experiments.json. Numbers are angles in rad, for all samples, those of the window too; what stands there
is not looked at, and may be NaN."""
"""What predictions look like."""


def read_predictions(paths: Path | Sequence[Path], records: Sequence[DataRecord]) -> Mapping[str, np.ndarray]:
    """Read predictions; see `FORMATS`.

    Args:
        paths: A folder, or files.
        records: The records that are to be predicted.

    Returns:
        Outputs (N, ny), rad, by experiment.

    Raises:
        ScenarioError: A record without predictions or with two files of them, a file of no such record, or one that is
            damaged, or has other channels or another length, or numbers that are none behind the window.
    """
    known = {record.name: record for record in records}
    found: dict[str, Path] = {}
    for path in _files(paths):
        if path.stem not in known:
            raise ScenarioError(f"{path} is of no record to predict: {unknown('experiment', path.stem, known)}")
        if path.stem in found:
            raise ScenarioError(f"{path.stem} has two files of predictions: {found[path.stem]} and {path}")
        found[path.stem] = path
    missing = [name for name in known if name not in found]
    if missing:
        raise ScenarioError(
            f"no predictions of {', '.join(missing[:5])}{' and others' if len(missing) > 5 else ''}: {len(found)} of "
            f"{len(known)} files there; expected {FORMATS.partition(':')[0]}"
        )
    return {
        name: checked(record, _read(found[name], record.joints), str(found[name])) for name, record in known.items()
    }


def checked(record: DataRecord, values: np.ndarray, source: str) -> np.ndarray:
    """Refuse predictions that do not fit a record.

    Args:
        record: The record.
        values: Predicted outputs (N, ny), or (N,) of a single one.
        source: Where they come from, for messages.

    Returns:
        Predicted outputs (N, ny).

    Raises:
        ScenarioError: No numbers, another length or number of outputs, or NaN or infinite behind the window.
    """
    values = np.asarray(values)
    if values.dtype.kind not in "iuf":
        raise ScenarioError(f"{source}: values of type {values.dtype} given, expected real numbers")
    table = values[:, None] if values.ndim == 1 else values
    wanted = (len(record), len(record.joints))
    if table.shape != wanted:
        hint = "; time runs along the first axis" if table.shape == wanted[::-1] else ""
        raise ScenarioError(
            f"{source}: predictions of shape {values.shape} given, expected {wanted}: {wanted[0]} samples of "
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
    given = (paths,) if isinstance(paths, Path) else tuple(paths)
    for path in given:
        if path.is_dir():
            yield from sorted(entry for entry in path.iterdir() if entry.suffix in ENDINGS and entry.is_file())
        elif not path.exists():
            raise ScenarioError(f"no predictions at {path}: expected {FORMATS.partition(':')[0]}")
        elif path.suffix not in ENDINGS or not path.is_file():
            raise ScenarioError(f"{path} given as predictions, expected a folder or files {', '.join(ENDINGS)}")
        else:
            yield path


def _read(path: Path, outputs: tuple[str, ...]) -> np.ndarray:
    if path.suffix == ".csv":
        return _read_csv(path, outputs)
    return _read_netcdf(path, outputs) if path.suffix == ".nc" else _read_mat(path)


def _read_csv(path: Path, outputs: tuple[str, ...]) -> np.ndarray:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read {path}: {error}") from error
    names = tuple(word.strip() for word in rows[0]) if rows else ()
    _check_names(path, names, outputs)
    return np.array(
        [_numbers(path, number, row, len(names)) for number, row in enumerate(rows[1:], start=2)], dtype=float
    )


def _numbers(path: Path, number: int, row: Sequence[str], count: int) -> list[float]:
    try:
        values = [number_of(word) for word in row]
    except ValueError:
        values = []
    if len(values) != count:
        raise ScenarioError(f"{path}, row {number}: {','.join(row)[:60]!r} given, expected {count} numbers")
    return values


def number_of(word: str) -> float:
    """A number as a table has it; Python would take 1_0 for 10 too.

    Raises:
        ValueError: It is none.
    """
    if "_" in word:
        raise ValueError(f"{word[:50]!r} given, expected a number")
    return float(word)


def _read_netcdf(path: Path, outputs: tuple[str, ...]) -> np.ndarray:
    variables = read_netcdf(path).variables
    for name in ("y", "output"):
        if name not in variables:
            raise ScenarioError(f"{path} has no variable {name}, but {', '.join(variables) or 'none'}")
    _check_names(path, tuple(map(str, variables["output"].values.ravel())), outputs)
    return variables["y"].values


def _read_mat(path: Path) -> np.ndarray:
    found = read_mat_numbers(path, ("y",))
    if "y" not in found:
        raise ScenarioError(f"{path} has no matrix y")
    return found["y"]


def _check_names(path: Path, given: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    if given != outputs:
        raise ScenarioError(
            f"{path}: outputs {', '.join(given) or 'without names'} given, expected {', '.join(outputs)} in this order"
        )
