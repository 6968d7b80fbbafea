"""The experiments of a data set as a table: what a reader of CSV, or of a catalogue, sees of them."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmtb_twin.parameters import SAMPLE_RATE
from scenarios.datasets.hashes import file_hash
from scenarios.datasets.plan import Plan


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes:
        name: Its heading.
        kind: ``"string"``, ``"integer"`` or ``"number"``.
        description: What it holds.
    """

    name: str
    kind: str
    description: str


COLUMNS = (
    Column("name", "string", "Name of the experiment, that of its files"),
    Column("part", "string", "train, validation or test"),
    Column("block", "string", "Block of records of the spec that asks for it"),
    Column("arm", "string", "Arm under its conditions"),
    Column("joints", "string", "Joints whose commands are the inputs and whose angles the outputs, parted by spaces"),
    Column("samples", "integer", "Samples of the record"),
    Column("duration", "number", "Length of the record, s"),
    Column("file", "string", "Its record, a NetCDF4 file"),
    Column("bytes", "integer", "Size of that file, 0 where there is none"),
    Column("sha256", "string", "SHA-256 of that file, - where there is none"),
    Column("status", "string", "ok, or why there is no record"),
)
"""What the table holds; no cell is empty."""


def experiment_rows(folder: Path, plan: Plan, entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row per experiment, in the order of the plan.

    Args:
        folder: That of the data set; its records are there.
        plan: The plan.
        entries: Those of the index of experiments.
    """
    rows = []
    for number, entry in enumerate(entries):
        path = folder / entry["file"]
        there = not entry["failed"]
        duration = plan.duration(number)
        rows.append(
            {
                "name": entry["name"],
                "part": entry["part"],
                "block": entry["block"],
                "arm": entry["arm"],
                "joints": " ".join(entry["joints"]),
                "samples": round(SAMPLE_RATE * duration) if there else 0,
                "duration": duration if there else 0.0,
                "file": entry["file"],
                "bytes": path.stat().st_size if there else 0,
                "sha256": file_hash(path) if there else "-",
                "status": entry["failed"] or "ok",
            }
        )
    return rows


def experiment_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table as CSV, a heading first."""
    target = io.StringIO()
    writer = csv.DictWriter(target, [column.name for column in COLUMNS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return target.getvalue()
