"""The experiments of a data set as a table: what a reader of CSV, or of a catalogue, sees of them."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import Status
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.plan import Plan
from scenarios.experiments.excitation_computer import BOARD
from scenarios.experiments.scenario import Scenario
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf import read_array


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
    Column(
        "velocity_limited", "integer", "Samples, of those given, in which a command moved as fast as its limit allows"
    ),
    Column("clipped", "integer", "Samples, of those given, in which a converter stood at an end of its range"),
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
        limited, clipped = _limited(path, plan, number) if there else (0, 0)
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
                "velocity_limited": limited,
                "clipped": clipped,
                "status": entry["failed"] or "ok",
            }
        )
    return rows


def _limited(path: Path, plan: Plan, number: int) -> tuple[int, int]:
    """In how many samples of a record a command moved at its limit, and in how many a converter clipped."""
    status = read_array(path, "status")
    clipped = (status & Status.CONVERTER_SATURATED) != 0
    experiment = plan[number].experiment
    # Waveforms that are kept apart are not looked into: they would have to be known.
    if isinstance(experiment, Scenario) and not plan.spec.commitment:
        for one in experiment.excitation:
            clipped = clipped | BOARD.beyond(one.asked(experiment.duration)[: len(clipped), 0])
    return int(np.count_nonzero(status & Status.VELOCITY_LIMITED)), int(np.count_nonzero(clipped))


def experiment_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table as CSV, a heading first."""
    target = io.StringIO()
    writer = csv.DictWriter(target, [column.name for column in COLUMNS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return target.getvalue()
