"""What a NetCDF file holds, told in a line of JSON by a process of its own.

A damaged file can make the library that reads it hang or crash: one flipped byte is enough for a loop without end.
Whoever checks files looks at them through this process, which may be lost.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Variable, read_netcdf

MOST_NAMES = 1000
"""Texts of an array that are told."""


def glance(path: Path) -> dict[str, Any]:
    """Read a file and say what is in it.

    Args:
        path: The file.

    Returns:
        `arrays`: hash of each array of numbers by name; `attributes`; `variables`: by name `dims`, `shape`, `dtype`,
        `attributes`, `names` where it holds texts, and whether it counts up from 0.

    Raises:
        ScenarioError: It cannot be read.
    """
    contents = read_netcdf(path)
    return {
        "arrays": contents.array_hashes(),
        "attributes": {key: _plain(value) for key, value in contents.attributes.items()},
        "variables": {name: _told(variable) for name, variable in contents.variables.items()},
    }


def _told(variable: Variable) -> dict[str, Any]:
    values = variable.values
    texts = values.dtype.kind == "U"
    return {
        "dims": list(variable.dims),
        "shape": list(values.shape),
        "dtype": "text" if texts else str(values.dtype),
        "attributes": {key: _plain(value) for key, value in variable.attributes.items()},
        "names": values.ravel()[:MOST_NAMES].tolist() if texts else [],
        "counts": values.ndim == 1 and values.dtype.kind in "iu" and bool((values == np.arange(len(values))).all()),
    }


def _plain(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray) else value


def answer(line: str) -> str:
    """The answer to a path, JSON for JSON: what is in the file, or why it cannot be read."""
    try:
        return json.dumps(glance(Path(json.loads(line))), default=str)
    # Whatever a hostile file raises inside the library: it is a file that cannot be read.
    except (ScenarioError, Exception) as error:
        return json.dumps({"error": str(error) if isinstance(error, ScenarioError) else repr(error)[:200]})


def main() -> None:
    """Answer paths, a line each, until there are no more."""
    for line in sys.stdin:
        sys.stdout.write(answer(line) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
