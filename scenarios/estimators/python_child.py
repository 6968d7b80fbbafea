"""The process in which a Python estimator runs: told of a record over a pipe, it calls the function and answers.

Whatever the function prints goes elsewhere. Nothing that it returns is run anywhere else: numbers alone leave.
"""

import contextlib
import importlib
import importlib.util
import os
import resource
import socket
import sys
import sysconfig
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import sysid
from scenarios.estimators.memory_limit import limit_memory
from scenarios.estimators.no_model import NoModelError
from scenarios.estimators.nursery import FORK, NUMBER, WAIT
from scenarios.estimators.outcome import REFUSED
from scenarios.estimators.parent_death import die_with_parent, take_orphans
from scenarios.estimators.process_tree import end_all, family
from scenarios.estimators.record_on_wire import requested
from scenarios.estimators.returned import numbers_of
from scenarios.estimators.task import Task
from scenarios.estimators.wire import receive, send, unpack
from sysid import IOData
from sysid.records.arrays import FloatArray

TOLD = 500
"""Characters of an error that are told."""

LONGEST_PATH = 2**14

LIBRARIES = (*(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")), str(Path(sysid.__file__).parent))
"""Folders whose lines an error is told of only where it has none of the estimator's own."""


def bear(control: socket.socket) -> None:
    """Fork a process for each request to, until there are no more; see `Nursery`.

    Args:
        control: Over which requests come: the folder to run in with three pipes, or a process to wait for.
    """
    take_orphans()
    this = os.getpid()
    while True:
        message, pipes, _, _ = socket.recv_fds(control, LONGEST_PATH, 3)
        if not message:
            # The bench is gone: so is everything here.
            end_all(lambda: set(family(os.getpid())) - {os.getpid()}, 0)
            return
        if message.startswith(WAIT):
            _, status = os.waitpid(NUMBER.unpack(message[len(WAIT) :])[0], 0)
            control.sendall(NUMBER.pack(status))
            continue
        pid = os.fork()
        if pid == 0:
            control.close()
            die_with_parent(this)
            _live(os.fsdecode(message[len(FORK) :]), *pipes)
        for end in pipes:
            os.close(end)
        control.sendall(NUMBER.pack(pid))


def _live(folder: str, request: int, reply: int, printed: int) -> NoReturn:
    """Be the process of an estimator."""
    code = 1
    try:
        os.setsid()
        take_orphans()
        os.chdir(folder)
        for standard in (1, 2):
            os.dup2(printed, standard)
        os.close(printed)
        serve(request, reply)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        with contextlib.suppress(BaseException):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def serve(request: int, reply: int) -> None:
    """Load a function, say so, and answer requests until there are no more.

    Args:
        request: Number of the pipe from which requests come.
        reply: Number of the pipe for replies.
    """
    this = os.getpid()
    fields, _ = unpack(receive(request))
    sys.argv = [fields["target"]]
    try:
        function = load(fields["target"], Path(fields["home"]))
    # Whatever happens while somebody's module is loaded, SystemExit too.
    except BaseException as error:
        send(reply, {"kind": "no_target", "why": _told(error)})
        return
    limit_memory(fields["memory_bytes"])
    send(reply, {"kind": "ready"})
    while message := receive(request):
        fields, arrays = unpack(message)
        answer = answered(function, fields, arrays)
        if os.getpid() != this:
            # It forked, and this is the copy.
            os._exit(0)
        send(reply, *answer)


def load(target: str, home: Path) -> Callable[..., Any]:
    """Find a function.

    Args:
        target: `module:function` or `path/to/file.py:function`.
        home: Folder in which the module or file is looked for.

    Raises:
        ImportError: There is none; and whatever the module raises.
    """
    place, _, name = target.rpartition(":")
    if not place or not name:
        raise ImportError(f"{target!r} given, expected module:function or path/to/file.py:function")
    if place.endswith(".py"):
        path = home / place
        if not path.is_file():
            raise ImportError(f"no file {str(path)!r}")
        sys.path.insert(0, str(path.parent))
        known = path.stem if path.stem not in sys.modules else f"estimator_{path.stem}"
        spec = importlib.util.spec_from_file_location(known, path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{str(path)!r} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[known] = module
        spec.loader.exec_module(module)
    else:
        sys.path.insert(0, str(home))
        module = importlib.import_module(place)
    found: Any = module
    for part in name.split("."):
        if not hasattr(found, part):
            own = [
                n for n, v in vars(module).items() if getattr(v, "__module__", "") == module.__name__ and callable(v)
            ]
            others = ", ".join(sorted(n for n in own if not n.startswith("_"))[:12])
            raise ImportError(f"{place} has no {name!r}; it has {others or 'no functions'}")
        found = getattr(found, part)
    if not callable(found):
        raise ImportError(f"{target} is of type {type(found).__name__}, expected a function")
    function: Callable[..., Any] = found
    return function


def answered(
    function: Callable[..., Any], fields: Mapping[str, Any], arrays: Mapping[str, FloatArray]
) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Call a function with a record; fields and arrays of the reply."""
    data, task = requested(fields, arrays)
    _forget_peak()
    begun, wall = processor_seconds(), time.monotonic()
    outcome, value = _called(function, data, task)
    outcome |= {
        "seconds": processor_seconds() - begun,
        "wall": time.monotonic() - wall,
        "peak_bytes": _peak(),
    }
    if outcome["kind"] != "returned":
        return outcome, {}
    try:
        return outcome, numbers_of(value, data, task)
    except NoModelError as error:
        return outcome | {"kind": error.kind, "why": str(error)[:TOLD]}, {}
    except MemoryError as error:
        return outcome | {"kind": "memory", "why": _told(error)}, {}
    # What it returned may do anything when it is looked at.
    except BaseException as error:
        return outcome | {"kind": "malformed", "why": f"what it returned cannot be read: {_told(error)}"[:TOLD]}, {}


def _called(function: Callable[..., Any], data: IOData, task: Task) -> tuple[dict[str, Any], object]:
    try:
        return {"kind": "returned", "why": ""}, function(data, task)
    except NotImplementedError as error:
        return {"kind": REFUSED, "why": _told(error)}, None
    except MemoryError as error:
        return {"kind": "memory", "why": _told(error)}, None
    # SystemExit and KeyboardInterrupt are its own as well.
    except BaseException as error:
        return {"kind": "error", "why": _told(error)}, None


def processor_seconds() -> float:
    """Processor time of this process, all its threads, and its children that have ended, s."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


def _forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    """The most memory since it was last forgotten, bytes."""
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _told(error: BaseException) -> str:
    """An error in a line: kind, text, and where in the estimator's own files."""
    try:
        text = f"{type(error).__name__}: {error}".strip(": \n")
        frames = traceback.extract_tb(error.__traceback__)
        here = [frame for frame in frames if frame.filename != __file__ and "importlib" not in frame.filename]
        own = [frame for frame in here if not frame.filename.startswith(LIBRARIES)] or here
        where = f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
        return " ".join(text.split())[:TOLD] + where
    # Its text may itself be a function of the estimator's.
    except BaseException:
        return "an error that cannot say what it is"


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as bench:
        bear(bench)
