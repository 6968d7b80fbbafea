"""A process with its descendants: started, watched for time and memory, and killed as a whole."""

import contextlib
import ctypes
import os
import secrets
import select
import signal
import subprocess
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import psutil

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "VECLIB")}
"""One thread each, so that processor times of estimators compare."""

FIRST_LOOK, LONGEST_LOOK = 0.02, 0.1
"""Pauses between looks at the memory, s: most requests end before the first, long ones cost little."""

MOST_PRINTED = 2**20
"""Bytes of a single line of output that are kept, and of unexpected output that is skipped."""

MOST_LOGGED = 2**26
"""Bytes of printed text that are kept: an endless loop that prints would fill the disk."""

TAIL = 1200
"""Bytes of the end of its printed text that a reason may quote."""

KILLING = 5.0
"""Time that killed processes have to vanish, s."""

MARK = "HMTB_ESTIMATOR"
"""Variable of the environment by which descendants are found that have left their session and lost their parent."""

_LIBC = ctypes.CDLL(None)
_PARENT_DEATH_SIGNAL = 1
"""Of Linux's prctl: a signal that comes when the parent dies, also when that is killed."""


class Reply(NamedTuple):
    """Reaction of a process to a request.

    Attributes:
        end: `line` (it answered), `exit` (it ended, or closed its output), `hang` or `memory`.
        line: The answer.
        wall: Time until then, s.
        seconds: Processor time of all its processes until then, s.
        peak_bytes: Largest memory of all its processes that was seen, bytes.
    """

    end: str
    line: str
    wall: float
    seconds: float
    peak_bytes: int


class WatchedProcess:
    """A process in a session of its own; what it prints goes to a file.

    Args:
        command: Program and arguments.
        folder: Working folder.
        log: File for its standard error, and for its standard output where it does not talk.
        talks: Whether requests and answers go over its standard input and output.
        environment: Variables added to those of this process.

    Raises:
        OSError: It cannot be started.
    """

    def __init__(
        self, command: Sequence[str], folder: Path, log: Path, *, talks: bool, environment: Mapping[str, str]
    ) -> None:
        self._log, self._buffer = log, bytearray()
        self._over: tuple[int, float] | None = None
        self._mark = secrets.token_hex(8)
        log.write_bytes(b"")
        # Appending, so that the file can be truncated while the process writes to it.
        with log.open("ab") as printed:
            self._popen = subprocess.Popen(
                command,
                cwd=folder,
                env={**os.environ, **ONE_THREAD, **environment, MARK: self._mark},
                stdin=subprocess.PIPE if talks else subprocess.DEVNULL,
                stdout=subprocess.PIPE if talks else printed,
                stderr=printed,
                bufsize=0,
                start_new_session=True,
                # It takes no lock, so that other threads do not matter here.
                preexec_fn=_die_with_parent,
            )
        self._tree = [psutil.Process(self._popen.pid)]
        # A process descriptor is readable when the process has ended: no polling, and its processor time is kept.
        self._life = os.pidfd_open(self._popen.pid)
        self._poll = select.poll()
        self._poll.register(self._life, select.POLLIN)
        self._output = -1
        if self._popen.stdout is not None:
            self._output = self._popen.stdout.fileno()
            os.set_blocking(self._output, False)
            self._poll.register(self._output, select.POLLIN)

    def exchange(self, request: str, words: Collection[str], *, seconds: float, memory_bytes: float) -> Reply:
        """Send a line and wait for an answer. After anything but a `line` the process is of no use.

        Args:
            request: The line; empty for none.
            words: First words of an answer; other lines are ignored.
            seconds: Time limit, s.
            memory_bytes: Memory limit of the process with its descendants, bytes.
        """
        begun, used, peak = time.monotonic(), self._processor_seconds(), 0
        if request and self._popen.stdin is not None:
            os.truncate(self._log, 0)
            # What came without a request answers nothing.
            with contextlib.suppress(BlockingIOError):
                os.read(self._output, MOST_PRINTED)
            self._buffer.clear()
            with contextlib.suppress(BrokenPipeError):
                self._popen.stdin.write(request.encode() + b"\n")
        look, pause, end, line = begun + FIRST_LOOK, FIRST_LOOK, "", ""
        while not end:
            left = min(look, begun + seconds) - time.monotonic()
            ready = dict(self._poll.poll(max(0.0, 1000.0 * left)))
            if self._output in ready:
                end, line = self._answer(words)
            elif self._life in ready:
                end = "exit"
            now = time.monotonic()
            if not end and now >= begun + seconds:
                end = "hang"
            elif not end and now >= look:
                if os.path.getsize(self._log) > MOST_LOGGED:
                    os.truncate(self._log, 0)
                self._look()
                peak = max(peak, self._memory(memory_bytes))
                end = "memory" if peak > memory_bytes else ""
                pause = min(1.5 * pause, LONGEST_LOOK)
                look = now + pause
        wall, spent = time.monotonic() - begun, max(self._processor_seconds() - used, 0.0)
        return Reply(end, line, wall, spent, max(peak, self._memory(memory_bytes)))

    def memory(self) -> int:
        """Memory of the process with its descendants now, bytes."""
        self._look()
        return self._memory(float("inf"))

    def printed(self) -> str:
        """The end of what it printed since the last request."""
        with self._log.open("rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL))
            return file.read().decode("utf-8", "replace")

    def kill(self, grace: float = 0.0) -> tuple[int, float]:
        """Kill it with all its descendants.

        Args:
            grace: Time that it has to end by itself, s.

        Returns:
            Exit code, negative for a signal, and processor time with that of the children that it waited for, s.
        """
        if self._over is not None:
            return self._over
        select.select([self._life], [], [], grace)
        until = time.monotonic() + KILLING
        while time.monotonic() < until:
            self._look()
            marked = (p for p in psutil.process_iter() if _ask(p, lambda p: p.environ().get(MARK), "") == self._mark)
            self._tree = [*self._tree, *(process for process in marked if process not in self._tree)]
            # The group at once, so that what forks all the time does not outrun this.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)
            for process in self._tree:
                _ask(process, psutil.Process.kill, None)
            if not any(map(_runs, self._tree)):
                break
            time.sleep(0.002)
        _, status, usage = os.wait4(self._popen.pid, 0)
        self._popen.returncode = os.waitstatus_to_exitcode(status)
        self._over = self._popen.returncode, usage.ru_utime + usage.ru_stime
        os.close(self._life)
        for pipe in filter(None, (self._popen.stdin, self._popen.stdout)):
            pipe.close()
        return self._over

    def _answer(self, words: Collection[str]) -> tuple[str, str]:
        """Read what there is: how the exchange ends, if it does, and the answer."""
        chunk = os.read(self._output, 2**16)
        if not chunk or len(self._buffer) > MOST_PRINTED:
            return "exit", ""
        *lines, self._buffer = (self._buffer + chunk).split(b"\n")
        for line in lines:
            text = line.decode("utf-8", "replace").strip()
            if text.partition(" ")[0] in words:
                return "line", text
        return "", ""

    def _look(self) -> None:
        """Look for descendants; those seen before count also when their parent has gone."""
        root, *earlier = self._tree
        seen = {*earlier, *_ask(root, lambda one: one.children(recursive=True), ())}
        self._tree = [root, *filter(_runs, seen)]

    def _memory(self, limit: float) -> int:
        """Resident memory, bytes; above the limit shared pages are counted once, which is exact and slow."""
        total: int = sum(_ask(process, lambda one: one.memory_info().rss, 0) for process in self._tree)
        return total if total <= limit else sum(_ask(p, lambda p: p.memory_full_info().pss, 0) for p in self._tree)

    def _processor_seconds(self) -> float:
        def seconds(process: psutil.Process) -> float:
            times = process.cpu_times()
            # The clock of another process counts nanoseconds; the tables of the system hundredths of a second.
            return float(times.children_user + times.children_system + time.clock_gettime((~process.pid << 3) | 2))

        return sum(_ask(process, seconds, 0.0) for process in self._tree)


def _die_with_parent() -> None:
    _LIBC.prctl(_PARENT_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)


def _ask(process: psutil.Process, question: Callable[[psutil.Process], Any], default: Any) -> Any:
    """A property of a process; the default where it has ended, or is not ours."""
    try:
        return question(process)
    except (psutil.Error, OSError):
        return default


def _runs(process: psutil.Process) -> bool:
    return bool(_ask(process, lambda one: one.is_running() and one.status() != psutil.STATUS_ZOMBIE, False))
