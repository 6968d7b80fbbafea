"""Check the file of a record; reading processes import this module, so it imports next to nothing."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin.files.netcdf import Attribute, Contents, Variable, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.variables import GIVEN, WINDOW


def file_problems(path: Path, hashes: Mapping[str, str], changed: bool, record: tuple[Any, ...] | None) -> list[str]:
    """List what differs from the index in the arrays of a file and, for a record, what `record_problems` finds.

    Args:
        path: The file.
        hashes: Hashes of its arrays in the index.
        changed: Whether the hash of the whole file differs.
        record: Further arguments of `record_problems`; None for other files.

    Returns:
        One line for each problem.
    """
    contents = read_netcdf(path)
    problems: list[str] = []
    if differing := contents.differing(hashes):
        several = len(differing) > 1
        noun, verb = ("arrays", "differ") if several else ("array", "differs")
        problems.append(f"{noun} {', '.join(differing)} {verb} from the index")
    elif changed:
        problems.append("its arrays are those of the index: the file was written anew, or only its description changed")
    if record is None:
        return problems
    return [*problems, *record_problems(contents, *record)]


def record_problems(
    contents: Contents, attributes: Mapping[str, Any], joints: object, samples: int | None, withheld: int | None
) -> Iterator[str]:
    """Compare attributes, times and channels of a record with index and spec; look for truth and withheld outputs.

    Args:
        contents: The record.
        attributes: Its attributes by index and spec; what they do not say is None.
        joints: Names of its inputs and outputs, by the index.
        samples: Its length by the spec; None if the spec is not in this copy.
        withheld: Samples of the window behind which outputs are withheld; None where they are not.

    Yields:
        One line for each problem.
    """
    stated = _with_lists(contents.attributes)
    for key, value in attributes.items():
        if value is not None and stated.get(key) != value:
            yield f"attribute {key} is {stated.get(key)!r}, expected {value!r}"
    yield from _time_problems(contents.variables, samples)
    for name, role in (("u", "input"), ("y", "output")):
        dim = WINDOW if withheld is not None and name == "y" else "sample"
        expected = {"dims": [dim, role], "dtype": "float64", "units": "rad", "role": role, "names": joints}
        actual = _channel_description(contents.variables, name, role)
        if wrong := [key for key in expected if actual.get(key) != expected[key]]:
            yield f"{name} has the {wrong[0]} {actual.get(wrong[0], 'none')}, expected {expected[wrong[0]]}"
    for name, variable in contents.variables.items():
        if withheld is not None:
            yield from _withholding_problems(name, variable, withheld)
        described = _with_lists(variable.attributes)
        if described.get("role") == "truth":
            yield f"{name} is truth, which belongs into files of its own"
        if variable.values.dtype.kind != "U" and not described.get("units"):
            yield f"{name} has no unit"


def _time_problems(variables: Mapping[str, Variable], samples: int | None) -> Iterator[str]:
    """Check the sample numbers, the sample times and the length of the record."""
    sample = variables["sample"].values if "sample" in variables else np.zeros(0)
    if sample.dtype != np.int64 or not np.array_equal(sample, np.arange(sample.size)):
        yield "sample does not count 0, 1, 2, ... in whole numbers"
    # To the last bit: a record is written with the same division.
    elif "t" not in variables or not np.array_equal(variables["t"].values, sample / SAMPLE_RATE):
        yield f"t is not the time of each sample, sample / {SAMPLE_RATE} s"
    if samples is not None and sample.shape != (samples,):
        yield f"sample has shape {list(sample.shape)}, expected {samples} samples"


def _channel_description(variables: Mapping[str, Variable], name: str, role: str) -> dict[str, Any]:
    """Return attributes, dimensions, data type and channel names of `u` or `y`; what the file lacks is left out."""
    description: dict[str, Any] = {}
    if name in variables:
        variable = variables[name]
        dtype = str(variable.values.dtype)
        description = {**_with_lists(variable.attributes), "dims": list(variable.dims), "dtype": dtype}
    if role in variables:
        description["names"] = variables[role].values.ravel()[:100].tolist()  # a hostile file may have any number
    return description


def _withholding_problems(name: str, variable: Variable, window: int) -> Iterator[str]:
    """Check that a variable holds no withheld outputs, and that its part of the window has the right length."""
    if "sample" in variable.dims and name not in GIVEN:
        yield f"{name} is given for all samples, and should be withheld behind the window"
    if WINDOW in variable.dims and len(variable.values) != window:
        yield f"{name} has {len(variable.values)} samples of the window, expected {window}"


def _with_lists(attributes: Mapping[str, Attribute]) -> dict[str, Any]:
    """Return attributes with arrays turned into lists: `==` of arrays is element by element."""
    plain: dict[str, Any] = {}
    for name, value in attributes.items():
        plain[name] = value.tolist() if isinstance(value, np.ndarray) else value
    return plain
