"""Bus records as MATLAB files of version 5."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hmtb_twin.files.atomic_write import replacing
from scenarios.files.errors import ScenarioError
from sysid.records.errors import SysidError
from sysid.records.mat_variables import read_variables

if TYPE_CHECKING:
    # Imported late otherwise: processes of estimators read matrices here, and load no physics.
    from hmtb_twin.bus.record import BusRecord

FORMAT = "hmtb mat record 1"
"""Marks the records of this version, in their variable `format`."""


def write_mat(record: "BusRecord", path: Path) -> Path:
    """Write a record: channels, `dt`, `time`, and names and units as structures; NaN is a lost sample."""
    from scipy.io import savemat

    from hmtb_twin.bus.record import CHANNELS

    names: dict[str, object] = {"time": "time"}
    units: dict[str, object] = {"time": "s", "dt": "s"}
    for channel, (channel_names, channel_units) in CHANNELS.items():
        # An array of objects becomes cells: one of texts would be padded with blanks to one length.
        names[channel] = np.array(channel_names, dtype=object)
        units[channel] = np.array(channel_units, dtype=object)
    variables: dict[str, object] = {
        "format": FORMAT,
        "name": record.name,
        "excited": np.array(record.axes, dtype=object),
        "dt": record.dt,
        "time": record.time,
        **{channel: getattr(record, channel) for channel in CHANNELS},
        "names": names,
        "units": units,
    }
    with replacing(path) as partial, partial.open("wb") as file:
        savemat(file, variables, oned_as="column")
    return path


def is_ours(path: Path) -> bool:
    """Whether a .mat file is a record of ours; false for files that cannot be read at all."""
    try:
        return _text(read_variables(path, ("format",)).get("format", "")) == FORMAT
    except SysidError:
        return False


def read_mat(path: Path) -> "BusRecord":
    """Read a file that `write_mat` wrote; `ScenarioError` on another, and on a damaged one."""
    from hmtb_twin.bus.record import CHANNELS, BusRecord

    if not is_ours(path):
        raise ScenarioError(f"{path.name} is no MATLAB record of ours: it lacks a variable 'format' that says so")
    try:
        content = read_variables(path, ("name", "dt", "excited", *CHANNELS))
        # MATLAB has no vectors: a record of one sample or one column comes back in another shape.
        channels = [
            np.asarray(content[channel], float).reshape(-1, len(names)) for channel, (names, _) in CHANNELS.items()
        ]
        axes = tuple(_text(axis) for axis in content["excited"].ravel())
        return BusRecord.from_columns(_text(content["name"]), content["dt"].item(), axes, np.column_stack(channels))
    except (LookupError, TypeError, ValueError) as error:
        raise ScenarioError(f"{path.name}: a damaged MATLAB file of ours ({error})") from error


def _text(value: object) -> str:
    return "".join(map(str, np.atleast_1d(np.asarray(value))))
