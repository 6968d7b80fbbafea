"""Input-output records: checks, files, filtering and resampling."""

from sysid.records.data import IOData
from sysid.records.errors import SysidError, SysidWarning
from sysid.records.filtering import keep_band, prefilter, resample
from sysid.records.frames import from_dataframe, from_xarray
from sysid.records.importers import read_csv, read_experiments, read_log, read_mat, read_netcdf, read_npz

__all__ = [
    "IOData",
    "SysidError",
    "SysidWarning",
    "from_dataframe",
    "from_xarray",
    "keep_band",
    "prefilter",
    "read_csv",
    "read_experiments",
    "read_log",
    "read_mat",
    "read_netcdf",
    "read_npz",
    "resample",
]
