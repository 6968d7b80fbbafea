"""Read NetCDF files that may be damaged in a process of its own, which may be lost.

One flipped byte can make the HDF5 library crash or loop without end.
"""

from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Variable, read_netcdf

PATIENCE = 60.0
"""Time for a file, s; a record takes hundredths of one."""

MOST_NAMES = 1000
"""Texts of an array that are returned."""


class NetcdfReader:
    """Reads what is in files; a reading process that hangs or crashes is replaced.

    Args:
        patience: Time for a file, s.
    """

    def __init__(self, patience: float = PATIENCE) -> None:
        self._patience = patience
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None

    def __enter__(self) -> "NetcdfReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def describe(self, path: Path) -> dict[str, Any]:
        """Describe a file; see the function `describe`.

        Raises:
            ScenarioError: It cannot be read, or reading it does not end.
        """
        pipe = self._pipe or self._start()
        try:
            pipe.send(path)
            answer = pipe.recv() if pipe.poll(self._patience) else None
        except (EOFError, OSError):
            self._end()
            raise ScenarioError(f"{path}: reading it crashed: it is damaged") from None
        if answer is None:
            self._end()
            raise ScenarioError(f"{path}: reading it did not end within {self._patience:g} s: it is damaged")
        if isinstance(answer, str):
            raise ScenarioError(answer)
        description: dict[str, Any] = answer
        return description

    def _start(self) -> Connection:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        return self._pipe

    def _end(self) -> None:
        if self._process is not None and self._pipe is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
        self._process = self._pipe = None


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


def _serve(pipe: Connection) -> None:
    """Answer paths with descriptions, or with the reason why a file cannot be read."""
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while True:
            path = pipe.recv()
            try:
                pipe.send(describe(path))
            except ScenarioError as error:
                pipe.send(str(error))
            except Exception as error:  # whatever a damaged file raises inside the library
                pipe.send(repr(error)[:200])
