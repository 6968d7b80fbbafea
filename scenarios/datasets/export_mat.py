"""Records as MATLAB files of version 5."""

import io

from scenarios.datasets.data_record import sampling_time
from scenarios.datasets.netcdf import Contents
from scenarios.errors import ScenarioError

LARGEST = 2**31 - 2**10
"""Bytes of a variable that version 5 of the format can hold, with room for its head."""

_HEAD = b"MATLAB 5.0 MAT-file, a record of a data set of the HMTB twin"
_HEAD_LENGTH = 116


def mat(contents: Contents) -> bytes:
    """Write a record as a .mat file: `u`, `y`, `dt` and the other variables, (N, n), names of channels as cells.

    `units` and `about` are structures: the unit of each variable, and all attributes of the record.

    Args:
        contents: What the file of the record holds.

    Raises:
        ScenarioError: A variable that is larger than the format allows.
    """
    from scipy.io import savemat

    for name, variable in contents.variables.items():
        if variable.values.nbytes > LARGEST:
            raise ScenarioError(
                f"{name} has {variable.values.nbytes / 2**30:.3g} GiB, a .mat file of version 5 holds less than 2 per "
                "variable; MATLAB reads the data set's own .nc files of any size by ncread, and Parquet by parquetread"
            )
    units: dict[str, object] = {"dt": "s"}
    variables: dict[str, object] = {"dt": float(sampling_time(contents))}
    for name, variable in contents.variables.items():
        if variable.values.dtype.kind == "U":
            variables[f"{name}_names"] = variable.values.astype(object)
        else:
            variables[name] = variable.values
            units[name] = str(variable.attributes["units"])
    variables |= {"units": units, "about": dict(contents.attributes)}
    target = io.BytesIO()
    savemat(target, variables, oned_as="column", do_compression=True, long_field_names=True)
    made = target.getvalue()
    # The head is a text with the time of day; equal records give equal files.
    return _HEAD.ljust(_HEAD_LENGTH) + made[_HEAD_LENGTH:]
