"""Numbers for drawing out of result files, which anyone may have written."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid.records.arrays import FloatArray

MOST = 100_000
"""Numbers in a curve."""

LARGEST = 1e100
"""No number that is drawn is larger, nor its inverse."""


def numbers(value: Any, dimensions: int = 1) -> FloatArray | None:
    """An array of numbers; None where the value is none of so many dimensions.

    What is not known is NaN, and so is what no axis can hold.
    """
    if not isinstance(value, list | tuple) or not value:
        return None
    try:
        found = np.array(value, dtype=float)  # null becomes NaN
    except (TypeError, ValueError, OverflowError):
        return None
    found[~drawable(found)] = np.nan
    return found if found.ndim == dimensions and found.size <= MOST else None


def drawable(values: FloatArray | float) -> NDArray[np.bool_]:
    """Whether an axis can hold them: finite, and neither huge nor, but for 0, tiny."""
    size = np.abs(values)
    return (size == 0.0) | ((size >= 1.0 / LARGEST) & (size <= LARGEST))


def curves(table: Any, *names: str) -> tuple[FloatArray, ...] | None:
    """Arrays of one length by name; None where one is missing or of another length."""
    if not isinstance(table, Mapping):
        return None
    found = [numbers(table.get(name)) for name in names]
    known = tuple(array for array in found if array is not None)
    return known if len(known) == len(names) and len({len(array) for array in known}) == 1 else None


def number_of(table: Any, name: str) -> float:
    """A number by name; NaN where there is none that an axis can hold."""
    value = table.get(name) if isinstance(table, Mapping) else None
    found = None if isinstance(value, bool | str) else numbers([value])
    return float("nan") if found is None else float(found[0])
