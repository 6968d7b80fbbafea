"""A record and what is asked of it, as fields and numbers."""

from collections.abc import Mapping
from typing import Any

from scenarios.estimators.task import PROTOCOL, Task
from sysid import IOData
from sysid.records.arrays import FloatArray


def task_fields(task: Task) -> dict[str, Any]:
    """What is asked, as JSON has it."""
    return {
        "protocol": PROTOCOL,
        "structure": task.structure,
        "orders": dict(task.orders),
        "most_order": task.most_order,
        "frequencies": task.frequencies.tolist(),
        "seed": task.seed,
    }


def request(data: IOData, task: Task) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Fields and arrays of a request."""
    record = {
        "dt": data.dt,
        "input_names": data.input_names,
        "output_names": data.output_names,
        "input_units": data.input_units,
        "output_units": data.output_units,
        "intersample": data.intersample,
        "window": data.window,
        "start": data.start,
        "name": data.name,
        "missing": data.missing,
    }
    fields = {"task": {**task_fields(task), "frequencies": []}, "record": record}
    return fields, {"u": data.u, "y": data.y, "frequencies": task.frequencies}


def requested(fields: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> tuple[IOData, Task]:
    """The record and the task of a request."""
    told, record = fields["task"], fields["record"]
    task = Task(told["structure"], told["orders"], told["most_order"], arrays["frequencies"], told["seed"])
    data = IOData(
        arrays["u"],
        arrays["y"],
        record["dt"],
        input_names=tuple(record["input_names"]),
        output_names=tuple(record["output_names"]),
        input_units=tuple(record["input_units"]),
        output_units=tuple(record["output_units"]),
        intersample=record["intersample"],
        window=record["window"],
        start=record["start"],
        name=record["name"],
        missing=record["missing"],
    )
    return data, task
