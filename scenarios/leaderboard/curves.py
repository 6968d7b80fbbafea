"""Numbers for drawing out of result files, which anyone may have written."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sysid.arrays import FloatArray

MOST = 100_000
"""Numbers in a curve."""


def numbers(value: Any, dimensions: int = 1) -> FloatArray | None:
    """An array of numbers, those that are not known NaN; None where the value is none of so many dimensions."""
    if not isinstance(value, list | tuple) or not value:
        return None
    try:
        found = np.array(value, dtype=float)  # null becomes NaN, "inf" and "-inf" themselves
    except (TypeError, ValueError):
        return None
    return found if found.ndim == dimensions and found.size <= MOST else None


def curves(table: Any, *names: str) -> tuple[FloatArray, ...] | None:
    """Arrays of one length by name; None where one is missing or of another length."""
    if not isinstance(table, Mapping):
        return None
    found = [numbers(table.get(name)) for name in names]
    known = tuple(array for array in found if array is not None)
    return known if len(known) == len(names) and len({len(array) for array in known}) == 1 else None


def number_of(table: Any, name: str) -> float:
    """A number by name; NaN where there is none."""
    value = table.get(name) if isinstance(table, Mapping) else None
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else float("nan")
