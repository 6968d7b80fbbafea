"""Columns of numbers in NetCDF4 files, which are HDF5 files."""

from pathlib import Path
from typing import Any

import numpy as np

from sysid.records.arguments import shortened
from sysid.records.errors import SysidError
from sysid.records.hdf5_heaps import check_heaps, items_of
from sysid.records.time_stamps import Column

MOST_NUMBERS = 2**28
"""Numbers of a file, 2 GiB as float64: packed zeros of a small file can claim more than there is memory."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""Beginning of the name of an array that only states the length of a dimension."""


def netcdf_columns(file: Path) -> tuple[dict[str, Column], dict[str, str]]:
    """Read variables (N,) or (N, k) by name, an attribute `dt` among them, and their units.

    Raises:
        SysidError: Another format, a damaged file, too many numbers.
    """
    import h5py

    try:
        check_heaps(file)
        with h5py.File(file) as whole:
            arrays = {
                name: one
                for name, one in items_of(whole)
                if isinstance(one, h5py.Dataset)
                and one.dtype.kind in "biuf"
                and one.ndim <= 2
                and not _text(one.attrs.get("NAME", "")).startswith(NO_VARIABLE)
            }
            if (numbers := sum(array.size for array in arrays.values())) > MOST_NUMBERS:
                raise SysidError(f"{file.name}: arrays of {numbers} numbers, expected at most {MOST_NUMBERS}")
            columns = {name: _values(one) for name, one in arrays.items()}
            units = {name: _text(one.attrs.get("units", "")) for name, one in arrays.items()}
            if "dt" not in columns and "dt" in whole.attrs:
                dt = whole.attrs["dt"]
                if isinstance(dt, str):
                    raise SysidError(f"{file.name}: attribute dt is the text {dt!r}; expected a number")
                columns["dt"] = np.atleast_1d(np.asarray(dt, dtype=float))
    except SysidError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        text = shortened(str(error), 200)
        raise SysidError(f"{file.name}: not a NetCDF4 file, or a damaged one ({text})") from error
    return columns, units


def _values(array: Any) -> Column:
    """Numbers with their scale and offset; those that mark a missing sample as NaN."""
    values, attributes = np.atleast_1d(array[()]), array.attrs
    for marker in {"_FillValue", "missing_value"} & set(attributes):
        lost = values == attributes[marker]
        values = np.where(lost, np.nan, values) if lost.any() else values
    if {"scale_factor", "add_offset"} & set(attributes):
        values = values * attributes.get("scale_factor", 1.0) + attributes.get("add_offset", 0.0)
    return np.asarray(values)


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
