"""Bus records as MATLAB files of version 5."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenarios.files.atomic_write import replacing
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from hmtb_twin.bus.record import BusRecord

FORMAT = "hmtb mat record 1"
"""Marks the files of this version, in their variable `format`."""


def write_mat(record: "BusRecord", path: Path) -> Path:
    """Write variables `dt`, `time`, `commanded`, `measured`, `wrench`, `status`, `saturated`.

    `names` and `units` are structures with one cell array per variable; NaN is a sample that was lost.

    Args:
        record: The record.
        path: The file.

    Returns:
        The path.

    Raises:
        ScenarioError: The file cannot be written.
    """
    from scipy.io import savemat

    from hmtb_twin.bus.record import CHANNELS

    variables: dict[str, object] = {
        "format": FORMAT,
        "name": record.name,
        "excited": np.array(record.axes, dtype=object),
        "dt": record.dt,
        "time": record.time,
        **{channel: getattr(record, channel) for channel in CHANNELS},
        "names": {"time": "time", **{c: np.array(names, dtype=object) for c, (names, _) in CHANNELS.items()}},
        "units": {"time": "s", "dt": "s", **{c: np.array(units, dtype=object) for c, (_, units) in CHANNELS.items()}},
    }
    with replacing(path) as partial, partial.open("wb") as file:
        savemat(file, variables, oned_as="column")
    return path


def is_ours(path: Path) -> bool:
    """Whether a .mat file is one of ours; false for files that cannot be read at all."""
    from scipy.io import loadmat

    try:
        return _text(loadmat(path, variable_names=["format"], simplify_cells=True).get("format", "")) == FORMAT
    except Exception:  # whatever a damaged or foreign file makes of scipy
        return False


def read_mat(path: Path) -> "BusRecord":
    """Read a file that `write_mat` wrote.

    Args:
        path: The file.

    Returns:
        The record, to the last bit.

    Raises:
        ScenarioError: A damaged file.
    """
    from scipy.io import loadmat

    from hmtb_twin.bus.record import CHANNELS, BusRecord

    try:
        content = loadmat(path, simplify_cells=True)
        parts = {c: np.asarray(content[c], float).reshape(-1, len(names)) for c, (names, _) in CHANNELS.items()}
        return BusRecord.from_columns(
            _text(content["name"]),
            float(content["dt"]),
            tuple(map(str, np.atleast_1d(content["excited"]))),
            np.column_stack([parts[channel] for channel in CHANNELS]),
        )
    except Exception as error:  # scipy's reader fails in many ways
        raise ScenarioError(f"{path.name}: a damaged MATLAB file of ours ({error})") from error


def _text(value: object) -> str:
    return "".join(map(str, np.atleast_1d(np.asarray(value))))
