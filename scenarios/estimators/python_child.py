"""Child process that serves a Python function as a program that stays: files in, a model file out.

`python -m scenarios.estimators.python_child TARGET HOME MEMORY_BYTES`; the protocol is in docs/estimator-protocol.md.
"""

import contextlib
import importlib
import json
import os
import resource
import sys
import sysconfig
import traceback
from collections.abc import Callable
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import module_from_spec
from operator import attrgetter
from pathlib import Path
from typing import Any, cast

import sysid
from scenarios.estimators.outcome import REFUSED, NoModelError
from scenarios.estimators.request_files import read_request, write_model
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import PROTOCOL

LONGEST_REASON = 500
"""Characters of an error text that are passed on."""

SCIPY = ("fft", "linalg", "optimize", "signal", "stats")
"""Parts of SciPy that `sysid` loads on first use: the first request would be charged with their time and memory."""

LIBRARIES = (*(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")), str(Path(sysid.__file__).parent))
"""Folders whose lines are named in an error only where the estimator has none of its own."""


def main(target: str, home: str, memory_bytes: str) -> int:
    """Load the function, say `ready`, and answer one line per request until standard input ends."""
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w", buffering=1, errors="backslashreplace")
    # What the function prints goes to the log: on standard output it would be taken for an answer.
    os.dup2(2, 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for part in SCIPY:
        importlib.import_module(f"scipy.{part}")
    try:
        function = load(target, Path(home))
    # Loading a module may raise anything, SystemExit too.
    except BaseException as error:
        answers.write(f"error {describe(error)}\n")
        return 1
    _limit_memory(int(memory_bytes))
    answers.write(f"ready {PROTOCOL}\n")
    for line in requests:
        answers.write(f"{_answer(function, json.loads(line))}\n")
    return 0


def load(target: str, home: Path) -> Callable[..., Any]:
    """Import a function.

    Args:
        target: `module:function` or `path/to/file.py:function`.
        home: Folder in which the module or file is looked for first.

    Raises:
        ImportError: There is none; and whatever the module raises.
    """
    place, _, name = target.rpartition(":")
    if not place or not name:
        raise ImportError(f"{target!r} given, expected module:function or path/to/file.py:function")
    path = home / place
    sys.path.insert(0, str(path.parent if path.suffix == ".py" else home))
    if path.suffix != ".py":
        module = importlib.import_module(place)
    elif not path.is_file():
        raise ImportError(f"no file {str(path)!r}")
    else:
        # A file may have the name of an installed module.
        label = path.stem if path.stem not in sys.modules else f"estimator_{path.stem}"
        loader = SourceFileLoader(label, str(path))
        module = module_from_spec(ModuleSpec(label, loader, origin=str(path)))
        sys.modules[label] = module
        loader.exec_module(module)
    try:
        function = attrgetter(name)(module)
    except AttributeError as error:
        own = [n for n, v in vars(module).items() if getattr(v, "__module__", "") == module.__name__ and callable(v)]
        others = ", ".join(sorted(n for n in own if not n.startswith("_"))[:12])
        raise ImportError(f"{place} has no {name!r}; it has {others or 'no functions'}") from error
    if not callable(function):
        raise ImportError(f"{target} is of type {type(function).__name__}, expected a function")
    return cast(Callable[..., Any], function)


def describe(error: BaseException) -> str:
    """An error in one line: kind, text, and the line of the estimator's own files that raised it."""
    try:
        reason = str(error)
    except Exception:
        reason = "its text cannot be printed"
    text = " ".join(f"{type(error).__name__}: {reason}".strip(": \n").split())[:LONGEST_REASON]
    frames = [
        f for f in traceback.extract_tb(error.__traceback__) if f.filename != __file__ and "importlib" not in f[0]
    ]
    own = [frame for frame in frames if not frame.filename.startswith(LIBRARIES)] or frames
    return text + (f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else "")


def _answer(function: Callable[..., Any], paths: dict[str, str]) -> str:
    data, task = read_request(Path(paths["npz"]), Path(paths["task"]))
    begun = _processor_seconds()
    try:
        value = function(data, task)
        seconds = _processor_seconds() - begun
        write_model(Path(paths["model"]), numbers_of(value, data, task))
    except NotImplementedError as error:
        return f"{REFUSED} {describe(error)}"
    except NoModelError as error:
        return f"{error.kind} {' '.join(str(error).split())}"
    except MemoryError as error:
        return f"memory {describe(error)}"
    # SystemExit and KeyboardInterrupt are the function's own as well.
    except BaseException as error:
        return f"error {describe(error)}"
    return f"done {seconds!r}"


def _processor_seconds() -> float:
    """Processor time of this process, all its threads, and its children that have ended, s."""
    usage = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in usage)


def _limit_memory(more: int) -> None:
    """Let this process allocate so many bytes beyond what it has: what goes beyond raises MemoryError."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        status = Path("/proc/self/status").read_text().splitlines()
        held = 1024 * int(next(line.split()[1] for line in status if line.startswith("VmData")))
        resource.setrlimit(resource.RLIMIT_DATA, (held + more, held + more))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
