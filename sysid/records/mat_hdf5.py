"""Numbers in MATLAB files of version 7.3, which are HDF5 files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sysid.records.channels import listed
from sysid.records.errors import SysidError
from sysid.records.hdf5_files import ListedArray, list_arrays, read_arrays

CLASSES = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
"""Classes of arrays, in the attribute `MATLAB_class`."""

MARKS_OF_OTHERS = ("MATLAB_empty", "MATLAB_object_decode")
"""Attributes of arrays that hold the size of an empty array, or the number of an object."""

DAMAGED = "a damaged .mat file of version 7.3"


def read_hdf5_variables(file: Path) -> dict[str, NDArray[np.generic]]:
    """Read the real numbers of arrays and of structs of arrays, as `log.u`; other classes are left out.

    HDF5 stores rows first what MATLAB has columns first: arrays are transposed back.

    Raises:
        SysidError: A damaged file, one that MATLAB did not write, too many numbers, or nothing but objects.
    """
    arrays = list_arrays(file, DAMAGED, ("MATLAB_class", *MARKS_OF_OTHERS), nested=True)
    kept = [array for array in arrays if _holds_numbers(array)]
    if arrays and not kept:
        others = [f"{_field(array)} ({_class(array) or 'not of MATLAB'})" for array in arrays]
        raise SysidError(
            f"{file.name}: no arrays of numbers, but {listed(others)}; expected the arrays of such objects, as "
            "u = data.u; y = data.y; Ts = data.Ts; save('log.mat', 'u', 'y', 'Ts')"
        )
    stored, _ = read_arrays(file, DAMAGED, kept, ())
    return {_field(array): content.values.T for array, content in zip(kept, stored, strict=True)}


def _holds_numbers(array: ListedArray) -> bool:
    is_marked = any(mark in array.attributes for mark in MARKS_OF_OTHERS)
    # Complex numbers are pairs of fields, kind "V".
    return _class(array) in CLASSES and not is_marked and array.kind in "biufc"


def _class(array: ListedArray) -> str:
    value = array.attributes.get("MATLAB_class", b"")
    return value.decode() if isinstance(value, bytes) else str(value)


def _field(array: ListedArray) -> str:
    """Name of an array as MATLAB has it."""
    return array.name.replace("/", ".")
