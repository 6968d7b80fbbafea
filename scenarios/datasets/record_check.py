"""Check the file of a record; reading processes import this module, so it imports next to nothing."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin.files.netcdf import Attribute, Contents, read_netcdf
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.variables import GIVEN, WINDOW


def file_problems(path: Path, hashes: Mapping[str, str], changed: bool, record: tuple[Any, ...] | None) -> list[str]:
    """Compare the arrays of a file with the index, and check the metadata of a record.

    Args:
        path: The file.
        hashes: Hashes of its arrays in the index.
        changed: Whether the hash of the whole file differs.
        record: Further arguments of `record_problems`; None for other files.
    """
    contents, problems = read_netcdf(path), list[str]()
    if differ := contents.differing(hashes):
        several = len(differ) > 1
        problems.append(f"array{'s' * several} {', '.join(differ)} differ{'' if several else 's'} from the index")
    elif changed:
        problems.append("its arrays are those of the index: the file was written anew, or only its description changed")
    return problems if record is None else [*problems, *record_problems(contents, *record)]


def record_problems(
    contents: Contents, attributes: Mapping[str, Any], joints: object, samples: int | None, withheld: int | None
) -> Iterator[str]:
    """Check the metadata of a record.

    Args:
        contents: The record.
        attributes: Its attributes by index and spec; what they do not say is None.
        joints: Names of its inputs and outputs, by the index.
        samples: Its length by the spec; None if the spec is not in this copy.
        withheld: Samples of the window behind which outputs are withheld; None where they are not.

    Yields:
        One line for each problem.
    """
    variables, stated = contents.variables, _plain(contents.attributes)
    for key, value in attributes.items():
        if value is not None and stated.get(key) != value:
            yield f"attribute {key} is {stated.get(key)!r}, expected {value!r}"
    sample = variables["sample"].values if "sample" in variables else np.zeros(0)
    if sample.dtype != np.int64 or not np.array_equal(sample, np.arange(sample.size)):
        yield "sample does not count 0, 1, 2, ... in whole numbers"
    elif "t" not in variables or not np.array_equal(variables["t"].values, sample / SAMPLE_RATE):
        yield f"t is not the time of each sample, sample / {SAMPLE_RATE} s"
    if samples is not None and sample.shape != (samples,):
        yield f"sample has shape {list(sample.shape)}, expected {samples} samples"
    for name, role in (("u", "input"), ("y", "output")):
        along = WINDOW if withheld is not None and name == "y" else "sample"
        wanted = {"dims": [along, role], "dtype": "float64", "units": "rad", "role": role, "names": joints}
        facts: dict[str, Any] = {}
        if name in variables:
            one = variables[name]
            facts = {**_plain(one.attributes), "dims": list(one.dims), "dtype": str(one.values.dtype)}
        if role in variables:
            facts["names"] = variables[role].values.ravel()[:100].tolist()  # a hostile file may have any number
        if wrong := [key for key in wanted if facts.get(key) != wanted[key]]:
            yield f"{name} has the {wrong[0]} {facts.get(wrong[0], 'none')}, expected {wanted[wrong[0]]}"
    for name, one in variables.items():
        facts = _plain(one.attributes)
        if withheld is not None and "sample" in one.dims and name not in GIVEN:
            yield f"{name} is given for all samples, and should be withheld behind the window"
        if withheld is not None and WINDOW in one.dims and len(one.values) != withheld:
            yield f"{name} has {len(one.values)} samples of the window, expected {withheld}"
        if facts.get("role") == "truth":
            yield f"{name} is truth, which belongs into files of its own"
        if one.values.dtype.kind != "U" and not facts.get("units"):
            yield f"{name} has no unit"


def _plain(attributes: Mapping[str, Attribute]) -> dict[str, Any]:
    return {key: one.tolist() if isinstance(one, np.ndarray) else one for key, one in attributes.items()}
