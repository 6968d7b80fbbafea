"""Child process that serves a Python function as a program that stays: files in, a model file out.

`python -m scenarios.estimators.python_child TARGET HOME`; the protocol is in docs/estimator-protocol.md.
"""

import importlib
import inspect
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
from types import ModuleType
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


def main(target: str, home: str) -> int:
    """Load the function, say `ready`, and answer one line per request until standard input ends."""
    requests, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w", buffering=1, errors="backslashreplace")
    # What the function prints goes to the log: on standard output it would be taken for an answer.
    os.dup2(2, 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for module in SCIPY:
        importlib.import_module(f"scipy.{module}")
    try:
        function = load(target, Path(home))
    # Loading a module may raise anything, SystemExit too.
    except BaseException as error:
        answers.write(f"error {describe(error)}\n")
        return 1
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
    module_name, _, function_name = target.rpartition(":")
    if not module_name or not function_name:
        raise ImportError(f"{target!r} given, expected module:function or path/to/file.py:function")
    path = home / module_name
    if path.suffix == ".py":
        sys.path.insert(0, str(path.parent))
        module = _load_file(path)
    else:
        sys.path.insert(0, str(home))
        module = importlib.import_module(module_name)
    try:
        function = attrgetter(function_name)(module)
    except AttributeError as error:
        functions = ", ".join(_public_functions(module)[:12]) or "no functions"
        raise ImportError(f"{module_name} has no {function_name!r}; it has {functions}") from error
    if not callable(function):
        raise ImportError(f"{target} is of type {type(function).__name__}, expected a function")
    return cast(Callable[..., Any], function)


def _load_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise ImportError(f"no file {str(path)!r}")
    # A file may have the name of an installed module.
    label = path.stem if path.stem not in sys.modules else f"estimator_{path.stem}"
    loader = SourceFileLoader(label, str(path))
    module = module_from_spec(ModuleSpec(label, loader, origin=str(path)))
    # Registered before it runs, as an import does: dataclasses and pickle look their module up.
    sys.modules[label] = module
    loader.exec_module(module)
    return module


def _public_functions(module: ModuleType) -> list[str]:
    """Functions and classes that the module defines itself."""
    members = inspect.getmembers(module, lambda value: getattr(value, "__module__", "") == module.__name__)
    return [name for name, value in members if callable(value) and not name.startswith("_")]


def describe(error: BaseException) -> str:
    """An error in one line: kind, text, and the line of the estimator's own files that raised it."""
    try:
        reason = str(error)
    except Exception:
        reason = "its text cannot be printed"
    message = " ".join(f"{type(error).__name__}: {reason}".strip(": \n").split())[:LONGEST_REASON]
    trace = traceback.extract_tb(error.__traceback__)
    frames = [frame for frame in trace if frame.filename != __file__ and "importlib" not in frame.filename]
    frames = [frame for frame in frames if not frame.filename.startswith(LIBRARIES)] or frames
    if not frames:
        return message
    return f"{message} ({Path(frames[-1].filename).name}, line {frames[-1].lineno})"


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
    usages = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
