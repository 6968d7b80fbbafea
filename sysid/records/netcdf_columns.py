"""Columns of numbers in NetCDF4 files, which are HDF5 files."""

from pathlib import Path
from typing import Any

import numpy as np

from sysid.records.errors import SysidError
from sysid.records.hdf5_files import check_size, items_of, opened
from sysid.records.time_stamps import Column

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""Beginning of the name of an array that only states the length of a dimension."""


def netcdf_columns(file: Path) -> tuple[dict[str, Column], dict[str, str]]:
    """Read variables (N,) or (N, k) by name, an attribute `dt` among them, and their units.

    Raises:
        SysidError: Another format, a damaged file, too many numbers.
    """
    import h5py

    with opened(file, "not a NetCDF4 file, or a damaged one") as whole:
        arrays = {
            name: one
            for name, one in items_of(whole)
            if isinstance(one, h5py.Dataset)
            and one.dtype.kind in "biuf"
            and one.ndim <= 2
            and not _text(one.attrs.get("NAME", "")).startswith(NO_VARIABLE)
        }
        check_size(file, arrays.values())
        columns = {name: _values(one) for name, one in arrays.items()}
        units = {name: _text(one.attrs.get("units", "")) for name, one in arrays.items()}
        if "dt" not in columns and "dt" in whole.attrs:
            dt = whole.attrs["dt"]
            if isinstance(dt, str):
                raise SysidError(f"{file.name}: attribute dt is the text {dt!r}; expected a number")
            columns["dt"] = np.atleast_1d(np.asarray(dt, dtype=float))
    return columns, units


def _values(array: Any) -> Column:
    """Numbers with their scale and offset; those that mark a missing sample as NaN."""
    values, attributes = np.atleast_1d(array[()]), array.attrs
    for marker in {"_FillValue", "missing_value"} & set(attributes):
        lost = values == attributes[marker]
        values = np.where(lost, np.nan, values) if lost.any() else values
    if scales := {"scale_factor", "add_offset"} & set(attributes):
        if any(np.size(attributes[name]) != 1 for name in scales):
            raise ValueError(f"{' or '.join(sorted(scales))} is no number")
        values = values * attributes.get("scale_factor", 1.0) + attributes.get("add_offset", 0.0)
    return np.asarray(values)


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
