"""Records from files: CSV, MATLAB, NetCDF."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.mat_variables import read_variables

TIME_NAMES = ("t", "time", "ts")
INTERVAL_NAMES = ("ts", "dt")
MOST_BYTES = 2**31
SECONDS = {
    **dict.fromkeys(("", "s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "microsecond", "microseconds"), 1e-6),
}
SAME_INTERVAL = 1e-3  # two intervals closer than this part are one, written with few digits
Columns = Mapping[str, FloatArray]


def read_csv(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from text: columns separated by commas, semicolons, tabs or spaces.

    The first line names the columns; a file without such a line has the columns `inputs` then `outputs`. Lines that
    begin with # or % are ignored. Empty cells and `nan` are missing samples.

    Args:
        path: The file.
        inputs: Names of the input columns.
        outputs: Names of the output columns.
        dt: Sampling interval, s. Required unless the file has a column of times (`t`, `time`, `Time (ms)`) or a
            constant column `dt`; must agree with it otherwise.
        missing: Whether missing output samples are allowed.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No file, no text, no such column, cells that are no numbers, no or contradicting sampling intervals,
            times that are not uniform.
    """
    file = _existing(path, "a text file")
    return record_of(_csv_columns(file, (*inputs, *outputs)), inputs, outputs, dt, missing, file)


def read_mat(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from a MATLAB file of version 7.2 or older.

    Args:
        path: The file.
        inputs: Names of the input variables, vectors, or matrices with time first.
        outputs: Names of the output variables, likewise.
        dt: As in `read_csv`; the file may hold it as a scalar `dt` or `Ts`, or as a vector of times.
        missing: Whether missing output samples are allowed.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No file, another format, no such variable, and as in `read_csv`.
    """
    file = _existing(path, "a .mat file")
    # A row vector can only be a signal; a matrix is taken time first, never transposed on a guess.
    columns = {
        name: values.astype(float).reshape(-1, 1) if 1 in values.shape else values.astype(float)
        for name, values in read_variables(file).items()
        if values.dtype.kind in "biuf" and values.ndim == 2 and values.size
    }
    return record_of(columns, inputs, outputs, dt, missing, file)


def read_netcdf(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from NetCDF4: variables over one dimension of time, of one column or several.

    Args:
        path: The file.
        inputs: Names of the input variables; their first dimension is time.
        outputs: Names of the output variables, likewise.
        dt: As in `read_csv`; the file may hold it as an attribute or scalar `dt`, or as the time coordinate.
        missing: Whether missing output samples are allowed.

    Returns:
        The record, named after the file; units from the attributes `units`.

    Raises:
        SysidError: No file, another format, no such variable, and as in `read_csv`.
    """
    import h5py
    import xarray as xr

    file = _existing(path, "a NetCDF4 file")
    try:
        with h5py.File(file) as whole:
            # h5py detects a damaged file here and closes it; xarray would leave it half open.
            _ = dict(whole["/"].attrs)
        with xr.open_dataset(file, engine="h5netcdf", decode_times=False) as stored:
            numbers = {str(n): v for n, v in stored.variables.items() if v.dtype.kind in "biuf" and v.ndim <= 2}
            # Packed zeros of a small file can claim more memory than there is.
            if (size := sum(variable.nbytes for variable in numbers.values())) > MOST_BYTES:
                raise SysidError(f"{file.name}: arrays of {size} bytes, expected at most {MOST_BYTES}")
            columns = {
                name: np.atleast_1d(np.asarray(variable.values, dtype=float)) for name, variable in numbers.items()
            }
            units = {str(name): str(variable.attrs.get("units", "")) for name, variable in stored.variables.items()}
            if "dt" not in columns and "dt" in stored.attrs:
                if isinstance(stored.attrs["dt"], str):
                    raise SysidError(f"{file.name}: attribute dt is the text {stored.attrs['dt']!r}; expected a number")
                columns["dt"] = np.atleast_1d(np.asarray(stored.attrs["dt"], dtype=float))
    except SysidError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        raise SysidError(f"{file.name}: not a NetCDF4 file, or a damaged one ({error})") from error
    for name in [n for n in columns if units.get(n) in SECONDS and units.get(n) and n.lower() in TIME_NAMES]:
        columns[f"{name} ({units[name]})"] = columns.pop(name)
    return record_of(columns, inputs, outputs, dt, missing, file, units)


def record_of(
    columns: Columns,
    inputs: Sequence[str],
    outputs: Sequence[str],
    dt: float | None,
    missing: bool,
    file: Path,
    units: Mapping[str, str] | None = None,
) -> IOData:
    """Make a record of named columns (N,) or (N, k); columns that are no channels may hold the sampling interval."""
    channels = [
        *((inputs,) if isinstance(inputs, str) else inputs),
        *((outputs,) if isinstance(outputs, str) else outputs),
    ]
    for name in channels:
        if not isinstance(name, str):
            raise SysidError(f"{file.name}: expected columns by name, got {name!r}; there are {', '.join(columns)}")
        if name not in columns:
            near = get_close_matches(name, columns, 1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            there = ", ".join(columns) or "none of numbers"
            raise SysidError(f"{file.name}: unknown column {name!r}{hint}; there are {there}")
    if len(set(channels)) != len(channels):
        raise SysidError(f"{file.name}: expected different columns, got {', '.join(channels)}")
    step = sampling_interval({n: v for n, v in columns.items() if n not in channels}, dt, file)
    split = 1 if isinstance(inputs, str) else len(inputs)
    parts = []
    for names in (channels[:split], channels[split:]):
        tables = [v[:, None] if v.ndim == 1 else v for v in (columns[n] for n in names)]
        if len({len(table) for table in tables}) > 1:
            raise SysidError(f"{file.name}: {', '.join(f'{n} has {len(columns[n])} samples' for n in names)}")
        labels = [
            (name if table.shape[1] == 1 else f"{name}{k + 1}", (units or {}).get(name, ""))
            for name, table in zip(names, tables, strict=True)
            for k in range(table.shape[1])
        ]
        parts.append((np.hstack(tables), tuple(label for label, _ in labels), tuple(unit for _, unit in labels)))
    (u, input_names, input_units), (y, output_names, output_units) = parts
    try:
        return IOData(
            u,
            y,
            step,
            input_names=input_names,
            output_names=output_names,
            input_units=input_units,
            output_units=output_units,
            missing=missing,
            name=file.stem,
        )
    except SysidError as error:
        raise SysidError(f"{file.name}: {error}") from error


def sampling_interval(columns: Columns, dt: float | None, file: Path) -> float:
    """Sampling interval in s on which the columns of times and `dt` agree."""
    if dt is not None and not 0 < dt < np.inf:
        raise SysidError(f"dt must be above 0 s, got {dt}")
    intervals = {} if dt is None else {"dt as given": float(dt)}
    for name, table in columns.items():
        values = table.ravel()
        key, unit = _name_and_unit(name)
        if key not in (*TIME_NAMES, *INTERVAL_NAMES) or (values.size == 1 and key not in INTERVAL_NAMES):
            continue
        if unit not in SECONDS:
            raise SysidError(f"{file.name}: column {name!r} is in {unit!r}; expected a time in s, ms or us")
        constant = bool((values == values[0]).all())
        if key in INTERVAL_NAMES and (constant or key not in TIME_NAMES or values.size == 1):
            step = float(values[0])
            if not (constant and 0.0 < step < np.inf):
                present = f"{step:g}" if values.size == 1 else f"{values.min():g} to {values.max():g}"
                raise SysidError(f"{file.name}: {name!r} is {present}; expected one sampling interval above 0 s")
        else:
            step = _step(values, name, file, dt is not None)
        intervals[repr(name)] = step * SECONDS[unit]
    if not intervals:
        raise SysidError(
            f"{file.name}: no sampling interval; expected a column of times (t, time, 'Time (s)'), "
            f"a variable dt or Ts, or dt in s; the file has {', '.join(columns) or 'no other column'}"
        )
    (first, interval), *others = intervals.items()
    for name, other in others:
        if abs(other - interval) > SAME_INTERVAL * interval:
            raise SysidError(
                f"{file.name}: sampling interval {interval:.6g} s by {first}, {other:.6g} s by {name}; "
                "expected one value (omit the wrong one)"
            )
    return interval


def _existing(path: str | Path, kind: str) -> Path:
    if not isinstance(path, str | Path):
        raise SysidError(f"expected the path of {kind}, got {shown(path)}")
    file = Path(path)
    if not file.is_file():
        raise SysidError(f"no data file {str(path)!r}; expected {kind}")
    return file


def _name_and_unit(name: str) -> tuple[str, str]:
    """Split `Time (s)`, `t[ms]`, `time_s` or `time / s` into name and unit, lower case."""
    text = name.strip().lower()
    match = re.fullmatch(r"([a-z]+)\s*(?:[(\[]\s*([^)\]]*?)\s*[)\]]|(?:_|\s*/\s*|\s+)([a-zµ]+))?", text)
    if match is None:
        return text, ""
    return match[1], match[2] or match[3] or ""


def _step(times: FloatArray, name: str, file: Path, allow_jitter: bool) -> float:
    """Interval of uniform times, in their unit; jitter is allowed where the user has given the interval."""
    steps = np.diff(times)
    middle = float(np.median(steps))
    if not middle > 0 or (np.abs(steps - middle).max() > 0.01 * middle and not allow_jitter):
        raise SysidError(
            f"{file.name}: column {name!r} is not uniform: steps from {steps.min():.6g} to {steps.max():.6g}; "
            "expected one sampling interval (resample, or give dt if the times only jitter)"
        )
    # the mean step: single times are rounded in the text
    return float((times[-1] - times[0]) / (len(times) - 1))


def _csv_columns(file: Path, expected: Sequence[str]) -> dict[str, FloatArray]:
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise SysidError(f"{file.name}: not a text file; expected columns {', '.join(expected)}") from error
    numbered = [(k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = [(k, line) for k, line in numbered if line.lstrip()[0] not in "#%"]
    if not lines:
        raise SysidError(f"{file.name}: the file is empty; expected columns {', '.join(expected)}")
    separator = next((mark for mark in (";", ",", "\t") if mark in lines[0][1]), None)
    rows = [(k, [cell.strip().strip('"') for cell in line.split(separator)]) for k, line in lines]
    if all(not row[-1] for _, row in rows):
        # A separator at the end of every line starts no further column.
        rows = [(k, row[:-1]) for k, row in rows]
    if _is_number(rows[0][1][0]):
        names = list(expected)
        if len(rows[0][1]) != len(names):
            raise SysidError(
                f"{file.name}: {len(rows[0][1])} columns without a header; expected a header, or the columns "
                f"{', '.join(names)}"
            )
    else:
        names = rows.pop(0)[1]
    if not rows:
        raise SysidError(f"{file.name}: a header and no data")
    values: NDArray[np.float64] = np.empty((len(rows), len(names)))
    for target, (number, row) in zip(values, rows, strict=True):
        if len(row) != len(names):
            raise SysidError(
                f"{file.name}, line {number}: {len(row)} values, expected {len(names)} ({', '.join(names)})"
            )
        try:
            target[:] = [float(cell) if cell else np.nan for cell in row]
        except ValueError as error:
            raise SysidError(f"{file.name}, line {number}: {error}; expected numbers") from error
    return dict(zip(names, values.T, strict=True))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
