"""Files in which programs write their model: JSON, .mat or NetCDF4, numbers alone."""

import json
import stat
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.estimators.model_names import NAMES
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.shapes import real
from scenarios.files.errors import ScenarioError
from scenarios.files.mat_numbers import read_mat_numbers
from scenarios.files.netcdf import read_netcdf

NAN = float("nan")

MODEL_STEM = "model"
"""Name of the file that a program writes, without its ending."""

MOST_BYTES = 2**26
"""No file of a model is larger."""

MOST_JSON = 2**22
"""No text of a model is larger: it is read where there is no limit of time or memory."""

MOST_AXES = 8
"""Lists within lists in a text, at most."""


def find_model(folder: Path) -> Path:
    """The one file of a model in a folder: `model.json`, `model.mat` or `model.nc`.

    Raises:
        NoModelError: There is none, or several, or something that is no ordinary file of a sensible size.
    """
    found = [path for ending in READERS if (path := folder / f"{MODEL_STEM}{ending}").exists() or path.is_symlink()]
    if len(found) != 1:
        given = ", ".join(path.name for path in found) or "no file of a model"
        raise NoModelError("malformed", f"{given} written, expected {{model}} with .json, .mat or .nc behind it")
    status = found[0].lstat()
    if not stat.S_ISREG(status.st_mode):
        raise NoModelError("malformed", f"{found[0].name} is no ordinary file")
    most = MOST_JSON if found[0].suffix == ".json" else MOST_BYTES
    if status.st_size > most:
        raise NoModelError(
            "malformed", f"{found[0].name} has {status.st_size} bytes, expected a model of at most {most}"
        )
    return found[0]


def read_model_numbers(path: Path) -> dict[str, NDArray[np.float64]]:
    """The numbers of a model; see `scenarios.estimators.model_names.NAMES`.

    Args:
        path: The file.

    Raises:
        NoModelError: It cannot be read, or holds something else.
    """
    try:
        return READERS[path.suffix](path)
    except NoModelError:
        raise
    except ScenarioError as error:
        # The folder changes with every request and tells nobody anything.
        raise NoModelError("malformed", str(error).replace(str(path), path.name)) from error


def _read_json(path: Path) -> dict[str, NDArray[np.float64]]:
    try:
        # a whole number of any length: what is too large is infinite, and told as that
        table = json.loads(path.read_text(encoding="utf-8"), parse_int=float)
    except (OSError, ValueError, RecursionError) as error:
        raise NoModelError("malformed", f"cannot read {path.name}: {error}") from error
    if not isinstance(table, dict):
        raise NoModelError("malformed", f"{path.name} holds no JSON object, expected dt and a model by names")
    unknown = sorted(table.keys() - set(NAMES))
    if unknown:
        raise NoModelError(
            "malformed", f"{path.name}: unknown {unknown[0][:50]!r}, expected some of {', '.join(NAMES)}"
        )
    return {name: _json_numbers(name, value) for name, value in table.items() if value is not None}


def _json_numbers(name: str, value: object) -> NDArray[np.float64]:
    """Numbers of JSON; null within them is NaN, as JSON cannot say that."""
    if isinstance(value, list):
        value = _nan_for_null(name, value, MOST_AXES)
    return real(name, value) if not (isinstance(value, list) and not value) else np.zeros(0)


def _nan_for_null(name: str, value: list[object], axes: int) -> list[object]:
    if axes == 0:
        raise NoModelError("malformed", f"{name} has lists within lists, more than {MOST_AXES} deep, expected a matrix")
    return [_nan_for_null(name, x, axes - 1) if isinstance(x, list) else (NAN if x is None else x) for x in value]


def _read_mat(path: Path) -> dict[str, NDArray[np.float64]]:
    return {name: real(name, values) for name, values in read_mat_numbers(path, NAMES).items()}


def _read_netcdf(path: Path) -> dict[str, NDArray[np.float64]]:
    contents = read_netcdf(path, only=NAMES)
    found = {name: variable.values for name, variable in contents.variables.items()}
    if "dt" in contents.attributes:
        found["dt"] = np.asarray(contents.attributes["dt"])
    return {name: real(name, values) for name, values in found.items()}


READERS: dict[str, Callable[[Path], dict[str, NDArray[np.float64]]]] = {
    ".json": _read_json,
    ".mat": _read_mat,
    ".nc": _read_netcdf,
}
"""Readers by the ending of the file."""
