"""A record and what is asked of it as files, for programs in any language."""

import json
from collections.abc import Collection
from pathlib import Path

import numpy as np

from scenarios.estimators.record_on_wire import task_fields
from scenarios.estimators.task import Task
from scenarios.files.netcdf import Contents, Variable
from sysid import IOData

FORMATS = {"data": "data.nc", "mat": "data.mat", "csv": "data.csv"}
"""Names of the record's files, by the placeholder that stands for each: NetCDF4, MATLAB version 7, text."""

TASK_FILE = "task.json"


def write_task(folder: Path, data: IOData, task: Task, formats: Collection[str]) -> None:
    """Write a record and what is asked of it.

    Args:
        folder: Where.
        data: The record.
        task: What is asked.
        formats: Some of `FORMATS`.
    """
    makers = {"data": _netcdf, "csv": _csv}
    for name in formats:
        path = folder / FORMATS[name]
        if name == "mat":
            _write_mat(path, data)
        else:
            path.write_bytes(makers[name](data))
    (folder / TASK_FILE).write_text(json.dumps(task_table(data, task), indent=1, allow_nan=False), encoding="utf-8")


def task_table(data: IOData, task: Task) -> dict[str, object]:
    """What `task.json` says: the task, and what there is to know of the record."""
    return {
        **task_fields(task),
        "dt": data.dt,
        "samples": len(data),
        "inputs": data.nu,
        "outputs": data.ny,
        "window": data.window,
        "missing": data.missing,
        "intersample": data.intersample,
        "input_names": list(data.input_names or ()),
        "output_names": list(data.output_names or ()),
        "input_units": list(data.input_units or ()),
        "output_units": list(data.output_units or ()),
    }


def _netcdf(data: IOData) -> bytes:
    names = {"input": data.input_names, "output": data.output_names}
    variables = {
        "time": Variable(("time",), data.time, {"units": "s"}),
        "u": Variable(("time", "input"), data.u, {"long_name": "inputs"}),
        "y": Variable(("time", "output"), data.y, {"long_name": "outputs"}),
        **{name: Variable((name,), np.array(labels), {}) for name, labels in names.items()},
    }
    return Contents(variables, {"dt": data.dt, "window": data.window, "intersample": data.intersample}).to_bytes()


def _csv(data: IOData) -> bytes:
    """A line of names, `time,u1,...,y1,...`, and a line per sample, all digits that count."""
    names = ["time", *(f"u{j + 1}" for j in range(data.nu)), *(f"y{i + 1}" for i in range(data.ny))]
    table = np.column_stack((data.time, data.u, data.y))
    lines = [",".join(names), *(",".join(map(repr, row)) for row in table.tolist())]
    return ("\n".join(lines) + "\n").encode("ascii")


def _write_mat(path: Path, data: IOData) -> None:
    from scipy.io import savemat

    variables = {"u": data.u, "y": data.y, "dt": data.dt, "time": data.time[:, None], "window": float(data.window)}
    savemat(path, variables, do_compression=True, oned_as="column")
