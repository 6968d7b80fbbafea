"""The headline of `hmtb verify`: the bandwidths that an estimator recovers, joint by joint, and what that answers."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scenarios.bench.metric import Metric
from scenarios.commands.output import print_table
from scenarios.commands.verify_numbers import interval, number
from scenarios.identification.recovered_bandwidth import ABOUT_1_HZ, near_1_hz

NAME = "bandwidth"
"""Metric that has them."""

CLOSE = 1.1
"""A median within this factor of its truth is called close."""

COLUMNS = (
    "joint",
    "excitation",
    "amplitude, mrad",
    "median",
    "95 % range",
    "small signals",
    "best linear",
    "near 1 Hz",
)


def bandwidth_rows(figures: Mapping[str, Metric]) -> list[dict[str, Any]]:
    """A row for each joint, excitation and amplitude; none where the run has no such figure or no models.

    Args:
        figures: Of a result, by name.

    Returns:
        joint, excitation, mrad; median and range (95 % of the records) of what is recovered, Hz; small_signal and
        best_linear: what is true, Hz; near: records whose bandwidth is about 1 Hz; models: records with a model.
    """
    figure = figures.get(NAME)
    classes = figure.curves.get("classes", ()) if figure else ()
    parts = {part.label: part for part in figure.parts} if figure else {}
    rows = []
    for row in sorted(classes, key=lambda one: (one["joint"], one["excitation"], one["mrad"])):
        part = parts[f"{row['joint']} {row['excitation']} {row['mrad']:g} mrad"]
        rows.append(
            {
                **{key: row[key] for key in ("joint", "excitation", "mrad")},
                "median": part.value,
                "range": part.interval,
                **{key: _hz(row[key]) for key in ("small_signal", "best_linear")},
                **{key: row[key] for key in ("near", "models")},
            }
        )
    return rows


def show_bandwidths(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the table.

    Args:
        rows: Of `bandwidth_rows`.
    """
    cells = [
        (
            *(row["joint"], row["excitation"], f"{row['mrad']:g}"),
            *(number(row["median"]), interval(row["range"])),
            *(number(row["small_signal"]), number(row["best_linear"])),
            f"{row['near']} of {row['models']}",
        )
        for row in rows
    ]
    print_table("Recovered bandwidths of the arm's joints, Hz, beside what is true", COLUMNS, cells)


def answer(rows: Sequence[Mapping[str, Any]]) -> str:
    """In a sentence: whether it finds the thesis' 1 Hz, and whether what it finds is true.

    Args:
        rows: Of `bandwidth_rows`, at least one.
    """
    low, high = ABOUT_1_HZ
    near, models = (sum(row[key] for row in rows) for key in ("near", "models"))
    found = sum(near_1_hz(row["median"]) for row in rows)
    true = sum(near_1_hz(row["best_linear"]) for row in rows)
    text = (
        f"About 1 Hz ({low:g} to {high:g} Hz) is what it finds in {near} of {models} records and in the median of "
        f"{found} of {len(rows)} rows; the best linear truth is about 1 Hz in {true} of them"
    )
    apart = {_apart(row): row for row in rows if math.isfinite(_apart(row))}
    if not apart:
        return f"{text}."
    worst = apart[max(apart)]
    close = sum(_apart(row) <= math.log(CLOSE) for row in rows)
    return (
        f"{text}, and its median lies within {100 * (CLOSE - 1):.0f} % of that truth in {close}, furthest from it for "
        f"{worst['joint']} {worst['excitation']} {worst['mrad']:g} mrad: {number(worst['median'])} Hz, where "
        f"{number(worst['best_linear'])} Hz is true."
    )


def _apart(row: Mapping[str, Any]) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.abs(np.log(np.divide(row["median"], row["best_linear"]))))


def _hz(value: float | None) -> float:
    """A number of a file, which has null for none."""
    return float("nan") if value is None else float(value)
