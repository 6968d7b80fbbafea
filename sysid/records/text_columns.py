"""Columns of numbers and times from text, also of files of a million lines."""

import codecs
import csv
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sysid.records.channels import listed
from sysid.records.date_texts import AmbiguousDateError, dates, is_date_text
from sysid.records.errors import Message, SysidError, SysidWarning
from sysid.records.optional import optional
from sysid.records.time_stamps import Column, Place, is_clock, is_counter, is_time

CLOCK_TIME = re.compile(r"\s*(?:(\d{4}-\d\d-\d\d)|\d{1,2}:\d\d:\d\d)")
"""Times as 2026-01-31T12:00:00.5, with or without a zone, and as 12:00:00.5."""

UNNAMED_TIME = ".time"
"""Name of the first of one column too many without a header, until it is seen to hold times."""

READ_TIMES = "times as 2026-01-31T12:00:00.5, 31/1/2026 12:00 or 12:00:00.5"

SPREADSHEET_ERRORS = ("#N/A", "#DIV/0!", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!")
"""Cells that begin a line like a comment."""

DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+(?:[eE][-+]?\d+)?\s*")


def text_columns(file: Path, expected: Sequence[str]) -> tuple[dict[str, Column], Place]:
    """Read the columns of a table by name, and a function from a sample to its line.

    The file is in UTF-8, UTF-16 with its mark, or the Windows character set. `expected` names the columns of a file
    without a header, and those that must be numbers. Other columns of texts are left out, unless they have a time's
    name.

    Raises:
        SysidError: No text, no data, lines of unequal length, cells that are no numbers.
    """
    with optional("files"):
        import pandas as pd

    names, separator, decimal, skipped, encoding = _decoded_layout(file, expected)
    if repeated := [name for name in (*expected, *filter(is_time, names)) if names.count(name) > 1]:
        raise SysidError(f"{file.name}: {names.count(repeated[0])} columns are named {repeated[0]!r}; expected one")

    def place(sample: int) -> str:
        line = sample + 1
        for other in skipped:
            line += other < line + 1
        return f"line {line}"

    try:
        table = pd.read_csv(
            file,
            sep=separator or r"\s+",
            header=None,
            names=range(len(names)),
            skiprows=[line - 1 for line in skipped],
            usecols=range(len(names)),
            skip_blank_lines=False,
            skipinitialspace=True,
            decimal=decimal,
            encoding=encoding,
            low_memory=False,
        )
    except (ValueError, OSError) as error:
        raise SysidError(f"{file.name}: not a table of columns {', '.join(expected)} ({error})") from error
    columns: dict[str, Column] = {}
    for name, position in zip(names, table, strict=True):
        values = _column(name, table[position], expected, place, file)
        if values is not None:
            columns[name] = values
    if UNNAMED_TIME in names:
        columns = _with_unnamed_time(columns, len(names), expected, file)
    return _with_dates(columns, expected), place


def _decoded_layout(file: Path, expected: Sequence[str]) -> tuple[list[str], str | None, str, list[int], str]:
    """The layout of a file, and the encoding in which it can be read."""
    with file.open("rb") as stream:
        is_utf_16 = stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    # UTF-8 first: every byte but five is a character of the Windows set, which would hide it.
    for encoding in ("utf-16",) if is_utf_16 else ("utf-8-sig", "cp1252"):
        try:
            return *_layout(file, encoding, expected), encoding
        except UnicodeDecodeError:
            continue
    raise SysidError(f"{file.name}: not a text file; expected columns {', '.join(expected)}")


def _column(name: str, cells: Any, expected: Sequence[str], place: Place, file: Path) -> Column | None:
    """Numbers, times or, in a column with the name of a time, texts; None of other columns of texts."""
    with optional("files"):
        import pandas as pd

    if cells.dtype.kind in "biuf":
        return cells.to_numpy()
    first = str(cells.iloc[0])
    time = CLOCK_TIME.match(first)
    if is_date_text(first, is_known=bool(time)):
        return _dates(name, cells, expected, place, file)
    if not time and name not in expected and not is_time(name):
        return None
    if not time:
        values = pd.to_numeric(cells, errors="coerce")
    elif time[1]:
        values = pd.to_datetime(cells, format="ISO8601", utc=True, errors="coerce").dt.tz_localize(None)
    else:
        values = pd.to_timedelta(cells, errors="coerce")
    bad = np.flatnonzero(values.isna() & (cells.notna() | bool(time)))
    if not len(bad):
        return values.to_numpy()
    wanted = f"numbers or {READ_TIMES}" if is_time(name) else "numbers"
    if time:
        wanted = READ_TIMES
    if bad[0] == 0 and len(cells) > 1 and _is_value(str(cells.iloc[1])):
        wanted += "; delete a row of units (the unit of times is in their name, 'Time (ms)', or in time_unit)"
    elif not time and name not in expected:
        return cells.astype(str).to_numpy(str)
    message = f"{_unreadable(name, cells, int(bad[0]), place, file)}; expected {wanted}"
    raise SysidError(Message(message, "not-a-number", time_unit=", or in time_unit"))


def _dates(name: str, cells: Any, expected: Sequence[str], place: Place, file: Path) -> Column | None:
    """Times of a column of dates; None of a column that need not hold times and does not."""
    is_needed = is_time(name) or name in expected
    try:
        times, remark = dates(cells)
    except AmbiguousDateError as error:
        if not is_needed:
            return None
        raise SysidError(f"{file.name}: column {name!r}: {error}") from error
    bad = np.flatnonzero(np.isnat(times))
    if len(bad) and not is_needed:
        return None
    if len(bad):
        problem = _unreadable(name, cells, int(bad[0]), place, file)
        raise SysidError(f"{problem}; expected a date as {str(cells.iloc[0])!r} above, or {READ_TIMES}")
    if remark:
        warnings.warn(f"{file.name}: column {name!r}: {remark}", SysidWarning, stacklevel=7)
    return times


def _with_dates(columns: dict[str, Column], expected: Sequence[str]) -> dict[str, Column]:
    """Columns in which a clock beside a column of days has the date of its day."""
    days, clocks = [], []
    for name, values in columns.items():
        is_date = values.dtype.kind == "M" and np.array_equal(values, values.astype("datetime64[D]"))
        # A constant date is that of the beginning: the clock itself tells that midnight has passed.
        if is_date and len(np.unique(values)) not in (1, len(values)):
            days.append(name)
        elif values.dtype.kind == "m" and is_time(name):
            clocks.append(name)
    if len(days) != 1 or len(clocks) != 1:
        return columns
    times = columns[days[0]] + columns[clocks[0]]
    joined = {name: values for name, values in columns.items() if name != days[0] or name in expected}
    for name in (*days, *clocks):
        if name in joined:
            joined[name] = times
    return joined


def _unreadable(name: str, cells: Any, sample: int, place: Place, file: Path) -> str:
    return f"{file.name}, {place(sample)}: could not convert {str(cells.iloc[sample])!r} in column {name!r}"


def _layout(file: Path, encoding: str, expected: Sequence[str]) -> tuple[list[str], str | None, str, list[int]]:
    """Check the lines; names, separator (None: blanks), decimal mark, and the lines from 1 that hold no data."""
    names: list[str] = []
    separator: str | None = None
    decimal, comment, skipped, number = "", "", [], 0
    with file.open(encoding=encoding) as lines:
        for number, line in enumerate(lines, start=1):
            text = line.strip(" \r\n\f")
            if not text or (text[0] in "#%" and not text.startswith(SPREADSHEET_ERRORS)):
                skipped.append(number)
                comment = comment if names else text.strip("#% ")
                continue
            if not names:
                separator = next((mark for mark in (";", ",", "\t") if mark in text), None)
                names = _cells(text, separator)
                if not _is_number(names[0]):
                    skipped.append(number)
                    continue
                names = _names_without_header(file, names, expected, _cells(comment, separator))
            # A separator at the end of a line starts no further column.
            count = text.count(separator) + 1 if separator and '"' not in text else len(_cells(text, separator))
            if count != len(names) and not (separator and text[-1] == separator and count == len(names) + 1):
                there = f"expected {len(names)} ({listed(names)})"
                raise SysidError(f"{file.name}, line {number}: {count} values, {there}")
            if not decimal:
                comma = separator != "," and any(map(DECIMAL_COMMA.fullmatch, text.split(separator)))
                decimal = "," if comma else "."
    if not names:
        raise SysidError(f"{file.name}: the file is empty; expected columns {', '.join(expected)}")
    if number == len(skipped):
        raise SysidError(f"{file.name}: a header and no data")
    return names, separator, decimal, skipped


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    try:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error as error:
        raise SysidError(f"a line of {len(line)} characters cannot be read ({error})") from error
    return cells[:-1] if cells[1:] and not cells[-1] else cells


def _names_without_header(file: Path, first: list[str], expected: Sequence[str], comment: list[str]) -> list[str]:
    """Names from the comment above the numbers, if it names all columns that are expected; else the expected ones."""
    if len(comment) == len(first) and set(expected) <= set(comment):
        return comment
    if len(first) == len(expected) + 1 and not any(map(is_time, expected)):
        return [UNNAMED_TIME, *expected]
    if len(first) != len(expected):
        raise _without_header(len(first), expected, file)
    return list(expected)


def _without_header(count: int, expected: Sequence[str], file: Path) -> SysidError:
    return SysidError(
        f"{file.name}: {count} columns without a header; expected a header, or the columns {', '.join(expected)}"
    )


def _with_unnamed_time(
    columns: dict[str, Column], count: int, expected: Sequence[str], file: Path
) -> dict[str, Column]:
    """Take the first of one column too many for times if its numbers rise evenly; refuse the file otherwise."""
    times = columns.get(UNNAMED_TIME, np.zeros(0))
    is_text = times.dtype.kind in "mM"
    if not (is_text or is_clock(times) or is_counter("time", times)):
        raise _without_header(count, expected, file)
    names = ", ".join(("time", *expected))
    message = f"{file.name}: no header; the columns are taken for {names}, as the first rises evenly"
    warnings.warn(message, SysidWarning, stacklevel=7)
    return {"time": times, **{name: columns[name] for name in expected}}


def _is_value(cell: str) -> bool:
    return _is_number(cell) or CLOCK_TIME.match(cell) is not None


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
