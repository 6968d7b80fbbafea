"""Bus records as text tables: the ASCII flat file of the thesis, and CSV; every number reads back to the last bit."""

from pathlib import Path
from urllib.parse import quote, unquote

import numpy as np

from hmtb_twin.bus.record import COLUMNS, UNITS, BusRecord
from scenarios.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError

FLAT = "hmtb ascii record 1"
"""Marks the ASCII files of this version, in their first line."""

CSV_HEADER = ",".join(("time_s", *COLUMNS))
"""First line of our CSV files."""

FLAGS = 2
"""The last columns hold whole numbers."""


def write_flat(record: BusRecord, path: Path) -> Path:
    """Write the ASCII flat file [Morris1996, II.5], which MATLAB's `load -ascii` reads; NaN is a lost sample."""
    lines = [
        FLAT,
        f"test: {quote(record.name, safe='_-.')}",
        f"excited: {' '.join(map(quote, record.axes))}",
        f"sampling time: {record.dt!r} s",
        f"samples: {len(record)}",
        "lost samples: NaN",
        "column 1: time, s",
        *(f"column {k}: {name}, {unit}" for k, (name, unit) in enumerate(zip(COLUMNS, UNITS, strict=True), start=2)),
    ]
    write_whole(path, "".join(f"% {line}\n" for line in lines) + _rows(record, " "))
    return path


def write_csv(record: BusRecord, path: Path) -> Path:
    """Write CSV with one line of names; SI units and radians, NaN for lost samples."""
    write_whole(path, CSV_HEADER + "\n" + _rows(record, ","))
    return path


def read_flat(path: Path) -> BusRecord:
    """Read a file that `write_flat` wrote; `ScenarioError` on others and damaged ones."""
    text = _text(path)
    header = [line[1:].strip() for line in text.splitlines() if line.startswith("%")]
    named = dict(line.split(":", 1) for line in header if ":" in line)
    expected = {f"column {k}": f" {n}, {u}" for k, (n, u) in enumerate(zip(COLUMNS, UNITS, strict=True), start=2)}
    wrong = [key for key, value in expected.items() if named.get(key, "").strip() != value.strip()]
    if header[:1] != [FLAT] or wrong:
        what = f"{wrong[0]} is {named.get(wrong[0], 'not named').strip()!r}" if wrong else "its first line differs"
        raise ScenarioError(f"{path.name} is no ASCII record of ours: {what}; expected '% {FLAT}' and its columns")
    try:
        dt, samples = float(named["sampling time"].strip().removesuffix("s")), int(named["samples"])
    except (KeyError, ValueError) as error:
        raise ScenarioError(f"{path.name}: no sampling time or number of samples among its first lines") from error
    table = _numbers(path, [line for line in text.splitlines() if line and not line.startswith("%")], None)
    if len(table) != samples:
        raise ScenarioError(f"{path.name}: {len(table)} lines of numbers, expected {samples}: the file is cut off")
    axes = tuple(map(unquote, named.get("excited", "").split()))
    return _record(path, unquote(named.get("test", path.stem).strip()), dt, axes, table)


def read_csv(path: Path) -> BusRecord:
    """Read a CSV file with our columns; the record is named after the file, and its excited axes are not known."""
    first, *lines = _text(path).splitlines() or [""]
    if first.strip() != CSV_HEADER:
        raise ScenarioError(f"{path.name}: its columns are not those of a bus record: {CSV_HEADER}")
    table = _numbers(path, [line for line in lines if line], ",")
    if len(table) < 2:
        raise ScenarioError(f"{path.name}: {len(table)} lines of numbers; the sampling time needs two")
    return _record(path, path.stem, float(table[1, 0] - table[0, 0]), (), table)


def _rows(record: BusRecord, separator: str) -> str:
    table = np.column_stack([record.time, record.columns()])
    text = [list(map(repr, column.tolist())) for column in table.T]
    for column in text[-FLAGS:]:
        column[:] = [value.removesuffix(".0") for value in column]
    return "".join(separator.join(row) + "\n" for row in zip(*text, strict=True)).replace("nan", "NaN")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path.name}: not a text file") from error


def _numbers(path: Path, lines: list[str], separator: str | None) -> np.ndarray:
    width = len(COLUMNS) + 1
    if not lines:
        return np.empty((0, width))
    try:
        return np.loadtxt(lines, delimiter=separator, comments=None, ndmin=2, usecols=range(width))
    except ValueError as error:
        for line in lines:
            if len(line.split(separator)) != width:
                raise ScenarioError(
                    f"{path.name}: {len(line.split(separator))} values in the line of time {line.split(separator)[0]}, "
                    f"expected {width}"
                ) from error
        raise ScenarioError(f"{path.name}: {error}") from error


def _record(path: Path, name: str, dt: float, axes: tuple[str, ...], table: np.ndarray) -> BusRecord:
    times = table[:, 0]
    if len(times) and not np.abs(times - times[0] - dt * np.arange(len(times))).max() <= 1e-6 * dt:
        raise ScenarioError(f"{path.name}: its times are not {dt:g} s apart; expected every tick in its place")
    return BusRecord.from_columns(name, dt, axes, table[:, 1:])
