"""Columns of numbers in NetCDF4 files, which are HDF5 files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sysid.records.errors import SysidError
from sysid.records.hdf5_files import ListedArray, StoredArray, list_arrays, read_arrays
from sysid.records.time_stamps import Column

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""Beginning of the name of an array that only states the length of a dimension."""

MISSING, SCALES = ("_FillValue", "missing_value"), ("scale_factor", "add_offset")
"""Attributes that name the number of a missing sample, and those of packed numbers: CF conventions, sec. 2.5.1, 8.1."""

DAMAGED = "not a NetCDF4 file, or a damaged one"


def netcdf_columns(file: Path) -> tuple[dict[str, Column], dict[str, str]]:
    """Read the variables (N,) or (N, k) of a NetCDF file by name, and their units; a file's attribute `dt` is a column.

    Raises:
        SysidError: Another format, a damaged file, too many numbers.
    """
    arrays = [array for array in list_arrays(file, DAMAGED, ("NAME",), nested=False) if _is_column(array)]
    stored, of_file = read_arrays(file, DAMAGED, arrays, (*MISSING, *SCALES, "units", "dt"))
    columns, units = {}, {}
    for array, content in zip(arrays, stored, strict=True):
        try:
            columns[array.name] = _unpacked(content)
        except (ValueError, TypeError) as error:
            raise SysidError(f"{file.name}: {DAMAGED} ({error})") from error
        units[array.name] = _text(content.attributes, "units")
    if "dt" not in columns and "dt" in of_file:
        dt = of_file["dt"]
        if isinstance(dt, str):
            raise SysidError(f"{file.name}: attribute dt is the text {dt!r}; expected a number")
        if np.asarray(dt).dtype.kind not in "iuf" or np.size(dt) != 1:
            raise SysidError(f"{file.name}: attribute dt is {dt!s:.40}; expected a real number")
        columns["dt"] = np.atleast_1d(np.asarray(dt, dtype=float))
    return columns, units


def _is_column(array: ListedArray) -> bool:
    is_variable = not _text(array.attributes, "NAME").startswith(NO_VARIABLE)
    return is_variable and array.kind in "biuf" and len(array.shape) <= 2


def _unpacked(content: StoredArray) -> Column:
    """Numbers with their scale and offset; those that mark a missing sample as NaN."""
    values, attributes = np.atleast_1d(content.values), content.attributes
    for marker in MISSING:
        if marker in attributes:
            lost = values == attributes[marker]
            values = np.where(lost, np.nan, values) if lost.any() else values
    scales = [name for name in SCALES if name in attributes]
    if any(np.size(attributes[name]) != 1 for name in scales):
        raise ValueError(f"{' or '.join(sorted(scales))} is no number")
    if scales:
        values = values * attributes.get("scale_factor", 1.0) + attributes.get("add_offset", 0.0)
    return np.asarray(values)


def _text(attributes: Mapping[str, Any], name: str) -> str:
    value = attributes.get(name, "")
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
