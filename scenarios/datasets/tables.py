"""Tables of a data set as CSV files."""

import csv
import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scenarios.files.errors import ScenarioError


def table_text(columns: Iterable[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """Write rows as CSV (RFC 4180, but for line feeds alone).

    Args:
        columns: Names of the columns.
        rows: Cells by the name of their column; others are left out.
    """
    stream = io.StringIO()
    # The same bytes on every system.
    writer = csv.DictWriter(stream, list(columns), lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def read_table(path: Path) -> list[dict[str, str]]:
    """Read the rows of a table; none where there is no such file.

    Raises:
        ScenarioError: It cannot be read, or is damaged.
    """
    if not path.is_file():
        return []
    columns, *rows = read_rows(path, "table") or [[]]
    if any(len(row) != len(columns) for row in rows):
        raise ScenarioError(f"{path} is damaged: a row has more or fewer columns than the first")
    return [dict(zip(columns, row, strict=True)) for row in rows]


def read_rows(path: Path, purpose: str) -> list[list[str]]:
    """Read the cells of a CSV file, without empty lines; `ScenarioError` names the file by its purpose."""
    try:
        # Spreadsheets write a byte-order mark before UTF-8.
        with path.open(newline="", encoding="utf-8-sig") as stream:
            return [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ScenarioError(f"cannot read the {purpose} {path}: {error}") from error


def read_text(path: Path, purpose: str) -> str:
    """Read a text in UTF-8; `ScenarioError` names the file by its purpose."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"cannot read the {purpose} {str(path)!r}: {error}") from error
