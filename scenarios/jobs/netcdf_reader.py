"""Reads NetCDF files in a separate process, so that a damaged file can crash only that process.

One flipped byte can make the HDF5 library crash or loop without end.
"""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from multiprocessing import current_process
from pathlib import Path
from typing import Any, TypeVar

from hmtb_twin import TwinError
from hmtb_twin.files.netcdf import read_netcdf
from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import one_process

Result = TypeVar("Result")


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

    def apply(self, function: Callable[..., Result], path: Path, *arguments: Any) -> Result:
        """Call a function of a module with the contents of a file.

        Args:
            function: Called with the contents and the further arguments, in the reading process.
            path: The file.
            *arguments: Further arguments of the function.

        Raises:
            ScenarioError: The file cannot be read, or reading it does not end.
        """
        try:
            if getattr(current_process(), "_inheriting", False):  # runs a user's script again, and may start none
                return _apply(function, path, arguments)
            if self._pool is None:
                self._pool = one_process()
            return self._pool.submit(_apply, function, path, arguments).result(self._patience)
        except TwinError as error:
            raise ScenarioError(str(error)) from error
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


def _apply(function: Callable[..., Result], path: Path, arguments: tuple[Any, ...]) -> Result:
    return function(read_netcdf(path), *arguments)
