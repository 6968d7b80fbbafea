"""Columns of numbers in NetCDF4 files."""

from pathlib import Path

import numpy as np

from sysid.records.arguments import shortened
from sysid.records.errors import SysidError
from sysid.records.time_stamps import Column

MOST_NUMBERS = 2**28
"""Numbers of a file, 2 GiB as float64: packed zeros of a small file can claim more than there is memory."""


def netcdf_columns(file: Path) -> tuple[dict[str, Column], dict[str, str]]:
    """Read variables (N,) or (N, k) by name, an attribute `dt` among them, and their units.

    Raises:
        SysidError: Another format, a damaged file, too many numbers.
    """
    import h5py
    import xarray as xr

    try:
        with h5py.File(file) as whole:
            # h5py detects a damaged file here and closes it; xarray would leave it half open, and reads coordinates at
            # once, however many numbers they claim.
            _ = dict(whole["/"].attrs)
            arrays = [one for one in whole.values() if isinstance(one, h5py.Dataset) and one.dtype.kind in "biuf"]
            if (numbers := sum(array.size for array in arrays)) > MOST_NUMBERS:
                raise SysidError(f"{file.name}: arrays of {numbers} numbers, expected at most {MOST_NUMBERS}")
        with xr.open_dataset(file, engine="h5netcdf", decode_times=False) as stored:
            columns = {
                str(name): np.atleast_1d(variable.values)
                for name, variable in stored.variables.items()
                if variable.dtype.kind in "biuf" and variable.ndim <= 2
            }
            units = {str(name): str(variable.attrs.get("units", "")) for name, variable in stored.variables.items()}
            if "dt" not in columns and "dt" in stored.attrs:
                if isinstance(stored.attrs["dt"], str):
                    raise SysidError(f"{file.name}: attribute dt is the text {stored.attrs['dt']!r}; expected a number")
                columns["dt"] = np.atleast_1d(np.asarray(stored.attrs["dt"], dtype=float))
    except SysidError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        raise SysidError(f"{file.name}: not a NetCDF4 file, or a damaged one ({shortened(str(error), 200)})") from error
    return columns, units
