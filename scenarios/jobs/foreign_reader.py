"""Reads files from anywhere in a separate process, so that a damaged file can crash only that process.

One flipped byte can make the HDF5 library crash, loop without end or ask for all memory.
"""

import math
import resource
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, suppress
from importlib import import_module
from multiprocessing import current_process
from pathlib import Path
from typing import Any, TypeVar

import h5py

from hmtb_twin import TwinError
from scenarios.files.errors import ScenarioError
from scenarios.jobs.executor import one_process
from sysid import SysidError

Result = TypeVar("Result")

MOST_MEMORY = 3 * 2**30
"""Bytes that the reading process may take for a file; records have 2 GiB at most."""


class ForeignReader(AbstractContextManager["ForeignReader"]):
    """Reads what is in files; a reading process that hangs or crashes is replaced.

    Args:
        patience: Time for a file, s; a record takes hundredths of one.
    """

    def __init__(self, patience: float = 60.0) -> None:
        self._patience = patience
        self._pool: ProcessPoolExecutor | None = None

    def __exit__(self, *_: object) -> None:
        self._end()

    def call(self, function: Callable[..., Result], path: Path, *arguments: Any) -> Result:
        """Call a function of a module in the reading process.

        Args:
            function: Called with the further arguments.
            path: The file that it reads, for messages.
            *arguments: Arguments of the function.

        Raises:
            ScenarioError: The file cannot be read, reading it does not end, or takes more than `MOST_MEMORY`.
        """
        try:
            if getattr(current_process(), "_inheriting", False):  # runs a user's script again, and may start none
                return function(*arguments)
            if self._pool is None:
                self._pool = one_process()
            return self._pool.submit(_limited, function, *arguments).result(self._patience)
        except (TwinError, SysidError) as error:
            raise ScenarioError(str(error)) from error
        except ScenarioError:
            raise
        except BrokenProcessPool:
            self._end()
            raise ScenarioError(f"{path}: reading it crashed: it is damaged") from None
        except TimeoutError:
            self._end()
            raise ScenarioError(f"{path}: reading it did not end within {self._patience:g} s: it is damaged") from None
        except MemoryError:
            raise ScenarioError(f"{path}: it takes more than {MOST_MEMORY / 2**30:g} GiB of memory") from None
        except Exception as error:  # whatever a damaged file raises inside the library
            raise ScenarioError(repr(error)[:200]) from error

    def _end(self) -> None:
        if self._pool is not None:
            for process in (self._pool._processes or {}).values():
                process.kill()
            self._pool.shutdown()
        self._pool = None


def check_readable(paths: Iterable[Path]) -> None:
    """Read all numbers and attributes of HDF5 files, all messages of MCAP files, before this process reads them.

    Raises:
        ScenarioError: Reading crashes, does not end, or takes too much memory.
    """
    with ForeignReader() as reader:
        for path in paths:
            if path.suffix == ".mcap" or h5py.is_hdf5(path):
                reader.call(_touch, path, path)


def _touch(path: Path) -> None:
    if path.suffix == ".mcap":
        with suppress(ModuleNotFoundError, ValueError, OSError), path.open("rb") as stream:
            reader = import_module("mcap.reader").make_reader(stream)
            deque(reader.iter_messages(), maxlen=0)
        return
    with suppress(OSError, RuntimeError, ValueError, TypeError, KeyError), h5py.File(path, "r") as file:
        found: list[h5py.HLObject] = [file]
        # a function that returns anything but None would end the visit
        file.visititems(lambda _, entry: found.append(entry))
        for entry in found:
            dict(entry.attrs)
            if isinstance(entry, h5py.Dataset):
                if math.prod(entry.chunks or ()) * entry.dtype.itemsize > MOST_MEMORY // 4:
                    raise MemoryError  # HDF5 does not tell a lack of memory for a packed chunk from damage
                entry[()]


def _limited(function: Callable[..., Result], *arguments: Any) -> Result:
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = MOST_MEMORY if soft == resource.RLIM_INFINITY else min(soft, MOST_MEMORY)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, hard))
    return function(*arguments)
