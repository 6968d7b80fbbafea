"""Read NetCDF files that may be damaged in a process of its own, which may be lost.

One flipped byte can make the HDF5 library crash or loop without end.
"""

from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Variable, read_netcdf
from scenarios.jobs.executor import one_process

MOST_NAMES = 1000
"""Texts of an array that are returned."""


class NetcdfReader(AbstractContextManager["NetcdfReader"]):
    """Reads what is in files; a reading process that hangs or crashes is replaced.

    Args:
        patience: Time for a file, s; a record takes hundredths of one.
    """

    def __init__(self, patience: float = 60.0) -> None:
        self._patience = patience
        self._pool: ProcessPoolExecutor | None = None

    def __exit__(self, *_: object) -> None:
        self._end()

    def describe(self, path: Path) -> dict[str, Any]:
        """Describe a file; see the function `describe`.

        Raises:
            ScenarioError: It cannot be read, or reading it does not end.
        """
        if self._pool is None:
            self._pool = one_process()
        try:
            return self._pool.submit(describe, path).result(self._patience)
        except ScenarioError:
            raise
        except BrokenProcessPool:
            self._end()
            raise ScenarioError(f"{path}: reading it crashed: it is damaged") from None
        except TimeoutError:
            self._end()
            raise ScenarioError(f"{path}: reading it did not end within {self._patience:g} s: it is damaged") from None
        except Exception as error:  # whatever a damaged file raises inside the library
            raise ScenarioError(repr(error)[:200]) from error

    def _end(self) -> None:
        if self._pool is not None:
            for process in (self._pool._processes or {}).values():
                process.kill()
            self._pool.shutdown()
        self._pool = None


def describe(path: Path) -> dict[str, Any]:
    """Describe a file.

    Args:
        path: The file.

    Returns:
        `arrays`: hash of each array of numbers by name; `attributes`; `variables`: by name `dims`, `shape`, `dtype`,
        `attributes`, `names` if it holds texts, and `counts`, whether it counts up from 0.

    Raises:
        ScenarioError: It cannot be read.
    """
    contents = read_netcdf(path)
    return {
        "arrays": contents.array_hashes(),
        "attributes": {key: _plain(value) for key, value in contents.attributes.items()},
        "variables": {name: _variable(variable) for name, variable in contents.variables.items()},
    }


def _variable(variable: Variable) -> dict[str, Any]:
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
