"""Files from elsewhere are read in another process, which has limits of time, memory and addresses."""

import json
import os
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from signal import SIGALRM
from typing import IO, Any, TypeVar, cast

from sysid.records import foreign_files
from sysid.records.arguments import shortened
from sysid.records.errors import SysidError
from sysid.records.foreign_files import MOST_MEMORY, decoded
from sysid.records.optional import needs_package

Result = TypeVar("Result")

PATIENCE = 60.0
"""Time for a file, s; a record takes hundredths of one."""

LONGEST_REASON = 200
"""Characters of a library's error, which quotes names as they stand in the file."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Numerical libraries reserve addresses for each thread; reading needs one."""


class UnreadableError(ValueError):
    """A file that cannot be read; the text is the reason, for the message of the reader of its format."""


def read_apart(function: Callable[..., Result], file: Path, *arguments: object) -> Result:
    """Call a function of a module with a file in the reading process.

    Each thread has a reading process, which starts with its first file, because starting takes longer than most files.

    Args:
        function: It takes the path as text and the further arguments.
        file: The file.
        *arguments: Numbers, texts and lists.

    Raises:
        UnreadableError: The file is damaged, takes too long or too much memory, or ends the process that reads it.
        SysidError: What the function raises, and a package that is missing.
        OSError: The file is missing or cannot be opened.
    """
    if file.is_file() or not file.exists():
        file.open("rb").close()  # what the system refuses is no damage of the file
    process: _ReadingProcess = getattr(_OF_THREAD, "process", None) or _ReadingProcess()
    # It is used again only if all went well: damage in one file may have left it in any state.
    _OF_THREAD.process = None
    answer = process.ask(f"{function.__module__}:{function.__qualname__}", str(file), *arguments)
    if "result" in answer:
        _OF_THREAD.process = process
        return cast(Result, answer["result"])
    match answer["error"]:
        case "memory":
            raise UnreadableError(f"it takes more than {MOST_MEMORY / 2**30:g} GiB of memory")
        case "package":
            # Readers of logs name their packages themselves; all others are in one extra.
            raise SysidError(f"{file.name}: reading it {needs_package(answer['reason'], 'files')}")
        case "refusal":
            raise SysidError(answer["reason"])
    raise UnreadableError(shortened(answer["reason"], LONGEST_REASON))


class _ReadingProcess:
    """A process that runs `foreign_files`; it ends with this object, at the latest at the end of this process."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            # -P keeps the folder of the script, whose files are named like modules of others, off the path.
            [sys.executable, "-P", foreign_files.__file__, str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | ONE_THREAD,
        )
        weakref.finalize(self, _end, self._process, os.getpid())

    def ask(self, function: str, *arguments: object) -> dict[str, Any]:
        """Call a function in the reading process; if that process dies, return an error in place of the result."""
        requests, answers = cast(IO[bytes], self._process.stdin), cast(IO[bytes], self._process.stdout)
        request = {
            "function": function,
            "arguments": arguments,
            "patience": PATIENCE,
            "folder": _working_folder(),
            "sys.path": [str(folder) for folder in sys.path],
        }
        try:
            requests.write(json.dumps(request).encode() + b"\n")
            requests.flush()
            return cast(dict[str, Any], decoded(answers.readline(), answers))
        except (OSError, EOFError, ValueError):  # of an answer that ends early, nothing is used
            self._process.kill()
            if self._process.wait() == -SIGALRM:
                return {"error": "damage", "reason": f"reading it did not end within {PATIENCE:g} s"}
            return {"error": "damage", "reason": "reading it crashed"}


def _working_folder() -> str:
    """The working folder, or the root of all where it was deleted: no path relative to it leads to a file then."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return os.sep


def _end(process: "subprocess.Popen[bytes]", owner: int) -> None:
    """End a reading process; a fork of the process that owns it only lets go of its pipes."""
    if os.getpid() == owner:
        process.kill()
        process.wait()
    process.poll()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()


def _forget() -> None:
    """Two processes that write to one reading process would get each other's answers."""
    _OF_THREAD.process = None


_OF_THREAD = threading.local()
os.register_at_fork(after_in_child=_forget)
