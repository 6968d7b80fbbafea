"""Data files: our own logs, CSV from anywhere, .mat; to and from the analyst's record."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.suggest import unknown
from sysid import IOData

if TYPE_CHECKING:
    from hmtb_twin import JointLog

TIME_NAMES = ("t", "time", "time_s")
DEFAULT_DT = 0.02


def write_log(log: "JointLog", path: Path) -> Path:
    """Write a log as NetCDF4 (`.nc`, everything) or CSV (`.csv`: time, commanded and measured angles, rad).

    Args:
        log: The log.
        path: File to write; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ScenarioError: Another ending.
    """
    if path.suffix == ".nc":
        log.save(path)
    elif path.suffix == ".csv":
        from hmtb_twin import JOINTS

        header = ["time_s", *(f"{name}_commanded" for name in JOINTS), *(f"{name}_measured" for name in JOINTS)]
        time = np.arange(len(log.commanded)) * log.dt
        table = np.column_stack([time, log.commanded, log.measured])
        np.savetxt(path, table, fmt="%.17g", delimiter=",", header=",".join(header), comments="")
    else:
        raise ScenarioError(f"unknown format {path.suffix!r}; there are: .nc, .csv")
    return path


def read_data(
    path: str | Path, *, joint: str | None = None, input: str = "u", output: str = "y", dt: float | None = None
) -> tuple[IOData, tuple[str, ...]]:
    """Read one input and one output from a file.

    Args:
        path: `.nc` (a joint log), `.csv` (with a header or two bare columns), or `.mat` (version 7.2 or older).
        joint: Joint of a joint log, or of a CSV written from one.
        input: Name of the input column or variable.
        output: Name of the output column or variable.
        dt: Sampling interval, s; by default from the file's time column or variable `dt`, else 0.02.

    Returns:
        The record, and what had to be assumed, in words.

    Raises:
        ScenarioError: The file is missing, foreign, or lacks what is asked for.
    """
    path = Path(path)
    if not path.is_file():
        raise ScenarioError(f"no data file {str(path)!r}; expected a .nc log, a .csv or a .mat file")
    if dt is not None and not dt > 0:
        raise ScenarioError(f"dt must be above 0 s, given {dt}")
    if path.suffix == ".nc":
        from hmtb_twin import JointLog

        return JointLog.load(path).iodata(joint), ()
    if joint is not None:
        from hmtb_twin import JOINTS

        if joint not in JOINTS:
            raise ScenarioError(unknown("joint", joint, JOINTS))
        input, output = f"{joint}_commanded", f"{joint}_measured"
    if path.suffix == ".csv":
        columns = _read_csv(path)
    elif path.suffix == ".mat":
        columns = _read_mat(path)
    else:
        raise ScenarioError(f"{str(path)!r}: unknown kind of data file; expected .nc, .csv or .mat")
    for name in (input, output):
        if name not in columns:
            raise ScenarioError(f"{path.name}: {unknown('column', name, columns)}")
    if input == output:
        raise ScenarioError(f"{path.name}: input and output are both {input!r}; expected two different columns")
    step, notes = _sampling(columns, dt)
    data = IOData(columns[input], columns[output], step, input_names=(input,), output_names=(output,), name=path.stem)
    return data, notes


def _sampling(columns: dict[str, np.ndarray], dt: float | None) -> tuple[float, tuple[str, ...]]:
    if dt is not None:
        return dt, ()
    if "dt" in columns and columns["dt"].size == 1:
        return float(columns["dt"][0]), ()
    for name in TIME_NAMES:
        if name in columns and len(columns[name]) > 1:
            steps = np.diff(columns[name])
            step = float(np.median(steps))
            if not step > 0 or np.abs(steps - step).max() > 0.01 * step:
                raise ScenarioError(
                    f"column {name!r} is not uniform: steps from {steps.min():.6g} to {steps.max():.6g} s; "
                    "expected one sampling interval (resample, or give --dt)"
                )
            # The mean step is free of the rounding that the text puts on single times.
            return float((columns[name][-1] - columns[name][0]) / (len(columns[name]) - 1)), ()
    return DEFAULT_DT, (
        f"the file has no time column; a sampling interval of {DEFAULT_DT} s is assumed, set it with --dt",
    )


def _read_csv(path: Path) -> dict[str, np.ndarray]:
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path.name}: not a text file; expected CSV with columns u and y") from error
    if not lines:
        raise ScenarioError(f"{path.name}: the file is empty; expected CSV with columns u and y")
    separator = next((mark for mark in (",", ";", "\t") if mark in lines[0]), None)
    rows = [[cell.strip().strip('"') for cell in line.split(separator)] for line in lines]
    if _is_number(rows[0][0]):
        if len(rows[0]) != 2:
            raise ScenarioError(
                f"{path.name}: {len(rows[0])} columns without a header; expected a header, or two columns u, y"
            )
        names, first = ["u", "y"], 0
    else:
        names, first = rows[0], 1
    values = []
    for number, row in enumerate(rows[first:], start=first + 1):
        if len(row) != len(names):
            raise ScenarioError(
                f"{path.name}, line {number}: {len(row)} values, expected {len(names)} ({', '.join(names)})"
            )
        try:
            values.append([float(cell) if cell else np.nan for cell in row])
        except ValueError as error:
            raise ScenarioError(f"{path.name}, line {number}: {error}; expected numbers") from error
    if not values:
        raise ScenarioError(f"{path.name}: a header and no data")
    table = np.array(values)
    return dict(zip(names, table.T, strict=True))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_mat(path: Path) -> dict[str, np.ndarray]:
    from scipy.io import loadmat

    try:
        content = loadmat(path)
    except (NotImplementedError, ValueError, OSError, TypeError) as error:
        raise ScenarioError(f"{path.name}: not a .mat file of version 7.2 or older ({error})") from error
    numeric = {
        key: value for key, value in content.items() if isinstance(value, np.ndarray) and value.dtype.kind in "iuf"
    }
    return {
        key: value.ravel().astype(float) for key, value in numeric.items() if value.size == max(value.shape, default=0)
    }
