"""MATLAB files of version 5: bus records, and matrices from other programs."""

from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.io import loadmat, savemat, whosmat

from hmtb_twin.files.atomic_write import replacing
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    # Imported late otherwise: processes of estimators read matrices here, and load no physics.
    from hmtb_twin.bus.record import BusRecord

FORMAT = "hmtb mat record 1"
"""Marks the records of this version, in their variable `format`."""

MOST_NUMBERS = 2**27
"""No matrix has more numbers: a small file can claim to unpack to any size."""


def read_mat_numbers(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Read matrices by name; those that are not in the file are left out.

    Args:
        path: The file, version 7 or older, from anywhere.
        names: Names of the matrices.

    Raises:
        ScenarioError: It is no such file, or damaged, or has matrices of an absurd size.
    """
    try:
        shapes = {name: shape for name, shape, _ in whosmat(path) if name in names}
        if large := [name for name, shape in shapes.items() if prod(shape) > MOST_NUMBERS]:
            raise ValueError(f"{large[0]} of shape {shapes[large[0]]} given, expected at most {MOST_NUMBERS} numbers")
        matrices = loadmat(path, variable_names=list(names))
    except Exception as error:  # what SciPy's reader raises on bytes that are no such file follows no rule
        raise ScenarioError(f"cannot read {path}: {error}; expected a file of save(..., '-v7')") from error
    return {name: np.asarray(matrices[name]) for name in names if name in matrices}


def write_mat(record: "BusRecord", path: Path) -> Path:
    """Write a record: channels, `dt`, `time`, and names and units as structures; NaN is a lost sample."""
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
    """Whether a .mat file is a record of ours; false for files that cannot be read at all."""
    try:
        return _text(loadmat(path, variable_names=["format"], simplify_cells=True).get("format", "")) == FORMAT
    except Exception:  # whatever SciPy raises on a damaged or foreign file
        return False


def read_mat(path: Path) -> "BusRecord":
    """Read a file that `write_mat` wrote; `ScenarioError` on another, and on a damaged one."""
    from hmtb_twin.bus.record import CHANNELS, BusRecord

    if not is_ours(path):
        raise ScenarioError(f"{path.name} is no MATLAB record of ours: it lacks a variable 'format' that says so")
    try:
        content = loadmat(path, simplify_cells=True)
        channels = [np.asarray(content[c], float).reshape(-1, len(names)) for c, (names, _) in CHANNELS.items()]
        axes = tuple(map(str, np.atleast_1d(content["excited"])))
        return BusRecord.from_columns(_text(content["name"]), float(content["dt"]), axes, np.column_stack(channels))
    except Exception as error:  # as above
        raise ScenarioError(f"{path.name}: a damaged MATLAB file of ours ({error})") from error


def _text(value: object) -> str:
    return "".join(map(str, np.atleast_1d(np.asarray(value))))
