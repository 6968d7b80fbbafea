"""Bus records as text tables: the ASCII flat file of the thesis, and CSV; every number reads back to the last bit."""

from pathlib import Path
from urllib.parse import quote, unquote

import numpy as np

from hmtb_twin.bus.record import COLUMNS, UNITS, BusRecord
from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError

FLAT = "hmtb ascii record 1"
"""Marks the ASCII files of this version, in their first line."""

CSV_HEADER = ",".join(("time_s", *COLUMNS))
"""First line of our CSV files."""

_LABELS = [f"{name}, {unit}" for name, unit in zip(COLUMNS, UNITS, strict=True)]
_COLUMN_LINES = {f"column {number}": label for number, label in enumerate(_LABELS, start=2)}
"""Lines of the header for the columns; the first column is time."""


def write_flat(record: BusRecord, path: Path) -> Path:
    """Write the ASCII flat file [Morris1996, II.5], which MATLAB's `load -ascii` reads; NaN is a lost sample."""
    # Names are quoted as in a URL: a blank would separate two axes, a line break end the comment.
    axes = " ".join(map(quote, record.axes))
    lines = [
        FLAT,
        f"test: {quote(record.name, safe='_-.')}",
        f"excited: {axes}",
        f"sampling time: {record.dt!r} s",
        f"samples: {len(record)}",
        "lost samples: NaN",
        "column 1: time, s",
        *(f"{key}: {label}" for key, label in _COLUMN_LINES.items()),
    ]
    write_whole(path, "".join(f"% {line}\n" for line in lines) + _rows(record, " "))
    return path


def write_csv(record: BusRecord, path: Path) -> Path:
    """Write CSV with one line of names; SI units and radians, NaN for lost samples."""
    write_whole(path, CSV_HEADER + "\n" + _rows(record, ","))
    return path


def read_flat(path: Path) -> BusRecord:
    """Read a file that `write_flat` wrote; `ScenarioError` on others and damaged ones."""
    lines = _lines(path)
    header = [line[1:].strip() for line in lines if line.startswith("%")]
    named: dict[str, str] = {}
    for line in header:
        key, mark, value = line.partition(":")
        if mark:
            named[key] = value.strip()
    wrong = [key for key, label in _COLUMN_LINES.items() if named.get(key) != label]
    if header[:1] != [FLAT] or wrong:
        reason = f"{wrong[0]} is {named.get(wrong[0], 'not named')!r}" if wrong else "its first line differs"
        raise ScenarioError(f"{path.name} is no ASCII record of ours: {reason}; expected '% {FLAT}' and its columns")
    try:
        dt, samples = float(named["sampling time"].removesuffix("s")), int(named["samples"])
    except (KeyError, ValueError) as error:
        raise ScenarioError(f"{path.name}: no sampling time or number of samples among its first lines") from error
    # The header states the number of samples because a file that was cut at the end of a line reads without an error.
    table = _numbers(path, [line for line in lines if not line.startswith("%")], None)
    if len(table) != samples:
        raise ScenarioError(f"{path.name}: {len(table)} lines of numbers, expected {samples}: the file is cut off")
    axes = tuple(map(unquote, named.get("excited", "").split()))
    return _record(path, unquote(named.get("test", path.stem)), dt, axes, table)


def read_csv(path: Path) -> BusRecord:
    """Read a CSV file with our columns; the record is named after the file, and its excited axes are not known."""
    first, *lines = _lines(path) or [""]
    if first.strip() != CSV_HEADER:
        raise ScenarioError(f"{path.name}: its columns are not those of a bus record: {CSV_HEADER}")
    table = _numbers(path, lines, ",")
    if len(table) < 2:
        raise ScenarioError(f"{path.name}: {len(table)} lines of numbers; the sampling time needs two")
    return _record(path, path.stem, float(table[1, 0] - table[0, 0]), (), table)


def _rows(record: BusRecord, separator: str) -> str:
    # `repr` writes as few digits as read back to the same bits.
    columns = [list(map(repr, column.tolist())) for column in (record.time, *record.columns().T)]
    for column in columns[-2:]:  # status and saturation are whole numbers
        column[:] = [value.removesuffix(".0") for value in column]
    rows = [separator.join(row) + "\n" for row in zip(*columns, strict=True)]
    return "".join(rows).replace("nan", "NaN")


def _lines(path: Path) -> list[str]:
    try:
        return [line for line in path.read_text(encoding="utf-8").splitlines() if line]
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path.name}: not a text file") from error


def _numbers(path: Path, lines: list[str], separator: str | None) -> np.ndarray:
    """Parse lines of numbers: time, then the columns of a bus record (N, columns)."""
    width = len(COLUMNS) + 1  # time comes first
    try:
        table = np.loadtxt(lines, delimiter=separator, comments=None, ndmin=2) if lines else np.empty((0, width))
    except ValueError as error:
        raise ScenarioError(f"{path.name}: {error}") from error
    if table.shape[1] != width:
        raise ScenarioError(f"{path.name}: {table.shape[1]} columns of numbers, expected {width}")
    return table


def _record(path: Path, name: str, dt: float, axes: tuple[str, ...], table: np.ndarray) -> BusRecord:
    times = table[:, 0]
    # Lost samples are NaN in their row, never a missing row: the times of a whole record are a uniform grid.
    if len(times) and not np.abs(times - times[0] - dt * np.arange(len(times))).max() <= 1e-6 * dt:
        raise ScenarioError(f"{path.name}: its times are not {dt:g} s apart; expected every tick in its place")
    return BusRecord.from_columns(name, dt, axes, table[:, 1:])
