"""Data files: our own logs, CSV from anywhere, .mat; to and from the analyst's record."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.suggest import unknown
from sysid import IOData

if TYPE_CHECKING:
    from hmtb_twin import JointLog

TIME_NAMES = ("t", "time", "ts")
"""Names of columns of instants, upper or lower case; a unit may follow, as in `Time (s)`, `t [ms]` or `time_s`."""

INTERVAL_NAMES = ("ts", "dt")
"""Names of variables or constant columns that hold the sampling interval, likewise."""

SECONDS = {
    **dict.fromkeys(("", "s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "microsecond", "microseconds"), 1e-6),
}
"""Length of the units that a time may be given in, s."""

SAME_INTERVAL = 1e-3
"""Two sampling intervals that differ by less than this part are one, written with few digits."""


def write_log(log: "JointLog", path: Path) -> Path:
    """Write a log as NetCDF4 (`.nc`, everything) or CSV (`.csv`: time, commanded and measured angles, rad).

    Args:
        log: The log.
        path: File to write; its ending chooses the format.

    Returns:
        The path.

    Raises:
        ScenarioError: Another ending, or the file cannot be written.
    """
    if path.is_dir():
        raise ScenarioError(f"cannot write {str(path)!r}: it is a folder; expected a file or nothing of that name")
    if path.suffix == ".nc":
        try:
            log.save(path)
        except ValueError as error:
            # The text of the NetCDF library's own errors is for its programmers; the system's number is enough.
            number = getattr(error.__cause__, "errno", None)
            why = os.strerror(number) if number else "the file system refuses"
            raise ScenarioError(f"cannot write {str(path)!r}: {why}") from error
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
) -> IOData:
    """Read one input and one output from a file.

    Args:
        path: `.nc` (a joint log), `.csv` (with a header or two bare columns), or `.mat` (version 7.2 or older).
        joint: Joint of a joint log, or of a CSV written from one.
        input: Name of the input column or variable.
        output: Name of the output column or variable.
        dt: Sampling interval, s. Needed where the file says none; must agree with it where it does.

    Returns:
        The record.

    Raises:
        ScenarioError: The file is missing, foreign, or lacks what is asked for; no sampling interval, or two that
            contradict each other.
    """
    path = Path(path)
    if not path.is_file():
        raise ScenarioError(f"no data file {str(path)!r}; expected a .nc log, a .csv or a .mat file")
    if dt is not None and not 0 < dt < np.inf:
        raise ScenarioError(f"dt must be above 0 s, given {dt}")
    if path.suffix == ".nc":
        from hmtb_twin import JointLog

        data = JointLog.load(path).iodata(joint)
        if dt is not None and abs(dt - data.dt) > SAME_INTERVAL * data.dt:
            raise ScenarioError(
                f"{path.name}: --dt says a sampling interval of {dt:.6g} s, the log of {data.dt:.6g} s; "
                "expected one (leave out --dt)"
            )
        return data
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
    for option, name in (("input", input), ("output", output)):
        if name not in columns:
            raise ScenarioError(f"{path.name}: {unknown('column', name, columns)}; choose one by --{option}")
    if input == output:
        raise ScenarioError(f"{path.name}: input and output are both {input!r}; expected two different columns")
    others = {name: values for name, values in columns.items() if name not in (input, output)}
    step = _sampling(others, dt, path)
    return IOData(columns[input], columns[output], step, input_names=(input,), output_names=(output,), name=path.stem)


def excited(path: Path) -> tuple[str, ...]:
    """Joints that the experiment of a joint log excites; none for other files."""
    if path.suffix != ".nc":
        return ()
    from hmtb_twin import JointLog

    return JointLog.load(path).axes


def _sampling(columns: Mapping[str, np.ndarray], dt: float | None, path: Path) -> float:
    """The one sampling interval that the file and `dt` agree on, s."""
    found = {} if dt is None else {"--dt": dt}
    for name, values in columns.items():
        key, unit = _name_and_unit(name)
        if key not in (*TIME_NAMES, *INTERVAL_NAMES) or (values.size == 1 and key not in INTERVAL_NAMES):
            continue
        if unit not in SECONDS:
            raise ScenarioError(f"{path.name}: column {name!r} is in {unit!r}; expected a time in s, ms or us")
        if key in INTERVAL_NAMES and (values == values[0]).all():
            step = float(values[0])
            if not step > 0:
                raise ScenarioError(f"{path.name}: {name!r} is {step:g}; expected a sampling interval above 0 s")
        else:
            step = _step(values, name, path, dt is not None)
        found[repr(name)] = step * SECONDS[unit]
    if not found:
        raise ScenarioError(
            f"{path.name}: no sampling interval; expected a column of times (t, time, 'Time (s)'), "
            f"a variable dt or Ts, or --dt SECONDS; the file has {', '.join(columns)}"
        )
    (first, interval), *others = found.items()
    for name, other in others:
        if abs(other - interval) > SAME_INTERVAL * interval:
            raise ScenarioError(
                f"{path.name}: {first} says a sampling interval of {interval:.6g} s, {name} of {other:.6g} s; "
                "expected one (leave the wrong one out)"
            )
    return interval


def _name_and_unit(name: str) -> tuple[str, str]:
    """Split `Time (s)`, `t[ms]`, `time_s` or `time / s` into name and unit, lower case."""
    text = name.strip().lower()
    match = re.fullmatch(r"([a-z]+)\s*(?:[(\[]\s*([^)\]]*?)\s*[)\]]|(?:_|\s*/\s*|\s+)([a-zµ]+))?", text)
    if match is None:
        return text, ""
    return match[1], match[2] or match[3] or ""


def _step(times: np.ndarray, name: str, path: Path, given: bool) -> float:
    """The interval of uniform instants, in their unit; `given` allows jitter, since the user has vouched for one."""
    steps = np.diff(times)
    middle = float(np.median(steps))
    if not middle > 0 or (np.abs(steps - middle).max() > 0.01 * middle and not given):
        raise ScenarioError(
            f"{path.name}: column {name!r} is not uniform: steps from {steps.min():.6g} to {steps.max():.6g}; "
            "expected one sampling interval (resample, or give --dt where the instants only jitter)"
        )
    # The mean step is free of the rounding that the text puts on single times.
    return float((times[-1] - times[0]) / (len(times) - 1))


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
