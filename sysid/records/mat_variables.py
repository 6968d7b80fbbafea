"""Numbers and texts in MATLAB files of version 7.2 or older."""

from collections.abc import Collection
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import shown
from sysid.records.errors import SysidError
from sysid.records.foreign_files import matlab_contents, matlab_listing
from sysid.records.reading_process import UnreadableError, read_apart

MOST_NUMBERS = 2**27
"""Numbers of all variables that are read, 1 GiB as float64: a small file can claim to unpack to any size."""

MOST_CELLS = 2**8
"""Cells of an array of cells: a larger one holds no names of channels."""

NUMBERS = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
"""Classes of numbers; those of texts and cells are `char` and `cell`."""


def read_variables(file: Path, names: Collection[str] | None = None) -> dict[str, NDArray[np.generic]]:
    """Read dense numbers, short texts and cell arrays of both, at least 2-D, by name; None reads all numbers.

    Other variables are left out: structs, objects, sparse matrices, cells within cells.

    Raises:
        SysidError: It is no such file, or damaged, or holds more than `MOST_NUMBERS`.
    """
    try:
        wanted, total = [], 0
        for name, shape, kind in read_apart(matlab_listing, file):
            if not _is_wanted(name, tuple(shape), kind, names):
                continue
            wanted.append(name)
            # Sizes of zero count as one, which keeps the product of the others in bounds.
            total += prod(max(size, 1) for size in shape)
            if total > MOST_NUMBERS:
                variable = f"{shown(name)} of shape {shown(tuple(shape))}"
                raise UnreadableError(f"{total} numbers in {variable} and before it, expected at most {MOST_NUMBERS}")
        return read_apart(matlab_contents, file, wanted)
    except (UnreadableError, OSError) as error:
        raise SysidError(
            f"{file.name}: not a .mat file of version 7.2 or older, which MATLAB writes by save -v7 ({error})"
        ) from error


def _is_wanted(name: str, shape: tuple[int, ...], kind: str, names: Collection[str] | None) -> bool:
    if names is None:
        return bool(name) and kind in NUMBERS
    is_short = kind == "char" or (kind == "cell" and prod(shape) <= MOST_CELLS)
    return name in names and (kind in NUMBERS or is_short)
