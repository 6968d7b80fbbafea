"""The metadata of a record, held against the index and the spec."""

from collections.abc import Iterator, Mapping
from typing import Any

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.data_set import GIVEN, WINDOW
from scenarios.datasets.experiment_file import FORMAT
from scenarios.datasets.layout import LICENSE
from scenarios.datasets.spec import DataSetSpec

SIGNALS = {"u": ("input", "sample", "input"), "y": ("output", "sample", "output")}
"""Role and dimensions of what an analyst identifies from."""


def record_problems(
    found: Mapping[str, Any], entry: Mapping[str, Any], spec: DataSetSpec | None, samples: int | None
) -> Iterator[str]:
    """What is wrong with the metadata of a record.

    Args:
        found: What is in its file; see `glance`.
        entry: What the index says of it.
        spec: The spec; None where it is kept apart.
        samples: Its length by the spec; None likewise.
    """
    attributes, variables = found["attributes"], found["variables"]
    expected = {
        "format": FORMAT,
        "experiment": entry["name"],
        "part": entry.get("part"),
        "arm": entry.get("arm"),
        "sampling_time_numerator": 1,
        "sampling_time_denominator": SAMPLE_RATE,
        "sampling_time_unit": "s",
        "intersample": "zoh",
        "license": LICENSE,
        **({} if entry.get("seed") is None else {"seed": entry["seed"]}),
        **({} if spec is None else {"data_set": spec.label, "initialisation_window": spec.window}),
    }
    for key, value in expected.items():
        if attributes.get(key) != value:
            yield f"attribute {key} is {attributes.get(key)!r}, expected {value!r}"
    sample = variables.get("sample", {"counts": False, "shape": [0], "dtype": "none"})
    if not sample["counts"] or sample["dtype"] != "int64":
        yield "sample does not count 0, 1, 2, ... in whole numbers"
    if samples is not None and sample["shape"] != [samples]:
        yield f"sample has shape {sample['shape']}, expected {samples} samples"
    withheld = spec is not None and spec.withheld and entry.get("part") == "test"
    if spec is not None and withheld:
        yield from _given_problems(variables, spec.window)
    for name, (role, *dims) in SIGNALS.items():
        along = [WINDOW, *dims[1:]] if withheld and name == "y" else dims
        yield from _signal_problems(name, role, along, variables)
        if role in variables and variables[role]["names"] != entry.get("joints"):
            yield f"{role} names {variables[role]['names']}, expected {entry.get('joints')}"
    for name, variable in variables.items():
        told = variable["attributes"]
        if told.get("role") == "truth":
            yield f"{name} is truth, which belongs into files of its own"
        if variable["dtype"] != "text" and not told.get("units"):
            yield f"{name} has no unit"


def _given_problems(variables: Mapping[str, Any], window: int) -> Iterator[str]:
    """What a scored record tells that should be withheld."""
    for name, variable in variables.items():
        if "sample" in variable["dims"] and name not in GIVEN:
            yield f"{name} is given for all samples, and should be withheld behind the window"
        if WINDOW in variable["dims"] and variable["shape"][0] != window:
            yield f"{name} has {variable['shape'][0]} samples of the window, expected {window}"


def _signal_problems(name: str, role: str, dims: list[str], variables: Mapping[str, Any]) -> Iterator[str]:
    if name not in variables or role not in variables:
        yield f"{name} or the names of its channels, {role}, are missing"
        return
    variable = variables[name]
    if variable["dims"] != dims or variable["dtype"] != "float64":
        yield f"{name} is {variable['dtype']} along {variable['dims']}, expected float64 along {dims}"
    told = {key: variable["attributes"].get(key) for key in ("units", "role")}
    if told != {"units": "rad", "role": role}:
        yield f"{name} has units and role {told}, expected rad and {role}"
