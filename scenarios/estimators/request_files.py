"""Files of a request: the record and the task for the estimator, the model from it."""

import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import numpy as np
from scipy.io import savemat

from hmtb_twin.files.netcdf import Contents, Variable, read_netcdf
from scenarios.estimators.named_numbers import NAMES, Numbers, real_numbers
from scenarios.estimators.outcome import NoModelError
from scenarios.estimators.task import PROTOCOL, Task
from sysid import IOData
from sysid.records.mat_variables import read_variables

FILES = {
    "data": "data.nc",
    "mat": "data.mat",
    "csv": "data.csv",
    "npz": "data.npz",
    "task": "task.json",
    "model": "model",
}
"""Files of a request by placeholder; the estimator adds the ending of the model."""

MOST_BYTES = 2**26
"""No model file is larger: 100 states take 2 MB as text."""

_RECORD = ("dt", "window", "missing", "intersample")
_LABELS = ("input_names", "output_names", "input_units", "output_units")
_TASK = ("structure", "most_order", "seed")


def write_request(folder: Path, data: IOData, task: Task, formats: Collection[str]) -> None:
    """Write a record and a task.

    Names and units of channels are left out, and so is the name of the record: they would tell which problem it is.
    """
    blank = IOData(data.u, data.y, data.dt, intersample=data.intersample, window=data.window, missing=data.missing)
    for name in formats:
        FORMATS[name](folder / FILES[name], blank)
    table: dict[str, object] = {"protocol": PROTOCOL}
    table |= {"samples": len(blank), "inputs": blank.nu, "outputs": blank.ny}
    table |= {name: getattr(blank, name) for name in (*_RECORD, *_LABELS)}
    table |= {name: getattr(task, name) for name in _TASK}
    table |= {"orders": dict(task.orders), "frequencies": task.frequencies.tolist()}
    (folder / FILES["task"]).write_text(json.dumps(table, indent=1, allow_nan=False), encoding="utf-8")


def read_request(record: Path, task: Path) -> tuple[IOData, Task]:
    """Read a record (NumPy) and a task as `write_request` wrote them."""
    table = json.loads(task.read_text(encoding="utf-8"))
    # Without pickle, which could run code.
    with np.load(record, allow_pickle=False) as arrays:
        data = IOData(arrays["u"], arrays["y"], **{name: table[name] for name in _RECORD})
    frequencies = np.array(table["frequencies"], dtype=np.float64)
    return data, Task(orders=table["orders"], frequencies=frequencies, **{name: table[name] for name in _TASK})


def write_model(stem: Path, model: Numbers) -> None:
    """Write named numbers of a model as JSON, which keeps every bit of them; the stem is the path without ending."""
    contents = json.dumps({name: values.tolist() for name, values in model.items()})
    stem.with_name(f"{stem.name}.json").write_text(contents, encoding="utf-8")


def read_model(folder: Path) -> Numbers:
    """Read the one model file in a folder: `model.json`, `model.mat` or `model.nc`.

    Raises:
        NoModelError: There is none, or several, or it cannot be read.
    """
    files = [path for ending in _READERS if (path := folder / f"{FILES['model']}{ending}").is_file()]
    if len(files) != 1:
        names = ", ".join(path.name for path in files) or "no model file"
        raise NoModelError(f"{names} written, expected {{model}} with .json, .mat or .nc behind it")
    path = files[0]
    # Before it is read: anyone may have written it.
    if (size := path.stat().st_size) > MOST_BYTES:
        raise NoModelError(f"{path.name} has {size} bytes, expected at most {MOST_BYTES}")
    try:
        values = _READERS[path.suffix](path)
    except (OSError, ValueError, RecursionError) as error:
        # Reasons are counted over requests, so they name no folder.
        reason = str(error).replace(str(path), path.name)
        raise NoModelError(f"cannot read {path.name}: {reason}") from error
    return real_numbers(values)


def _read_json(path: Path) -> dict[str, object]:
    # Whole numbers of any length become floats: what is too large is infinite and reported as such.
    table = json.loads(path.read_text(encoding="utf-8"), parse_int=float)
    if not isinstance(table, dict):
        raise ValueError("it holds no JSON object, expected dt and a model by names")
    return table


def _read_netcdf(path: Path) -> dict[str, object]:
    contents = read_netcdf(path, only=NAMES)
    values: dict[str, object] = {name: variable.values for name, variable in contents.variables.items()}
    # The sampling time may be an attribute as well as a variable.
    if "dt" in contents.attributes:
        values["dt"] = contents.attributes["dt"]
    return values


_READERS: dict[str, Callable[[Path], Mapping[str, object]]] = {
    ".json": _read_json,
    ".mat": lambda path: read_variables(path, NAMES),
    ".nc": _read_netcdf,
}


def _write_netcdf(path: Path, data: IOData) -> None:
    """The record as NetCDF4, with names of channels as coordinates."""
    variables = {
        "time": Variable(("time",), data.time, {"units": "s"}),
        "u": Variable(("time", "input"), data.u, {"long_name": "inputs"}),
        "y": Variable(("time", "output"), data.y, {"long_name": "outputs"}),
        "input": Variable(("input",), np.array(data.input_names), {}),
        "output": Variable(("output",), np.array(data.output_names), {}),
    }
    attributes = {"dt": data.dt, "window": data.window, "intersample": data.intersample}
    path.write_bytes(Contents(variables, attributes).to_bytes())


def _write_csv(path: Path, data: IOData) -> None:
    """A line of names, `time,u1,...,y1,...`, and a line per sample, all digits that count."""
    header = ",".join(["time", *(data.input_names or ()), *(data.output_names or ())])
    # As text each number has the digits that give back its bits.
    table = np.column_stack((data.time, data.u, data.y))
    np.savetxt(path, table, fmt="%s", delimiter=",", header=header, comments="", encoding="ascii")


def _write_mat(path: Path, data: IOData) -> None:
    """The record as a MATLAB file of version 7."""
    variables = {"u": data.u, "y": data.y, "dt": data.dt, "time": data.time[:, None], "window": float(data.window)}
    savemat(path, variables, do_compression=True, oned_as="column")


FORMATS: dict[str, Callable[[Path, IOData], None]] = {
    "data": _write_netcdf,
    "mat": _write_mat,
    "csv": _write_csv,
    "npz": lambda path, data: np.savez(path, u=data.u, y=data.y, dt=data.dt, window=data.window),
}
"""Writers of the record by placeholder: NetCDF4, MATLAB version 7, text, NumPy."""
