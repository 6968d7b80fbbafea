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
        self._ended: tuple[int, float] | None = None
        self._mark = secrets.token_hex(8)
        log.write_bytes(b"")
        # Appending, so that the file can be truncated while the process writes to it.
        with log.open("ab") as printed:
            requests, answers = (subprocess.PIPE, subprocess.PIPE) if talks else (subprocess.DEVNULL, printed)
            self._popen = subprocess.Popen(
                command,
                cwd=folder,
                env={**os.environ, **ONE_THREAD, **environment, MARK: self._mark},
                stdin=requests,
                stdout=answers,
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
        begun, used_before = time.monotonic(), self._processor_seconds()
        if request and self._popen.stdin is not None:
            self._forget_earlier_output()
            with contextlib.suppress(BrokenPipeError):
                self._popen.stdin.write(request.encode() + b"\n")
        # The clock begins before the request is written: a process that does not read it hangs.
        end, line, peak = self._wait(words, begun, begun + seconds, memory_bytes)
        wall, used = time.monotonic() - begun, max(self._processor_seconds() - used_before, 0.0)
        return Reply(end, line, wall, used, max(peak, self._memory(memory_bytes)))

    def _forget_earlier_output(self) -> None:
        """Empty log and pipe: what came without a request answers nothing."""
        os.truncate(self._log, 0)
        with contextlib.suppress(BlockingIOError):
            os.read(self._output, MOST_PRINTED)
        self._buffer.clear()

    def _wait(self, words: Collection[str], begun: float, deadline: float, memory_bytes: float) -> tuple[str, str, int]:
        """How the exchange ends, the answer, and the largest memory that was seen at regular looks."""
        next_look, pause, peak = begun + FIRST_LOOK, FIRST_LOOK, 0
        while True:
            remaining = min(next_look, deadline) - time.monotonic()
            ready = dict(self._poll.poll(max(0.0, 1000.0 * remaining)))
            if self._output in ready:
                end, line = self._read_answer(words)
                if end:
                    return end, line, peak
            elif self._life in ready:
                return "exit", "", peak
            time_now = time.monotonic()
            if time_now >= deadline:
                return "hang", "", peak
            if time_now >= next_look:
                if os.path.getsize(self._log) > MOST_LOGGED:
                    os.truncate(self._log, 0)
                self._find_descendants()
                peak = max(peak, self._memory(memory_bytes))
                if peak > memory_bytes:
                    return "memory", "", peak
                pause = min(1.5 * pause, LONGEST_LOOK)
                next_look = time_now + pause

    def memory(self) -> int:
        """Memory of the process with its descendants now, bytes."""
        self._find_descendants()
        return self._memory(float("inf"))

    def printed(self) -> str:
        """End of the text that the estimator's process has printed since the last request."""
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
        if self._ended is not None:
            return self._ended
        select.select([self._life], [], [], grace)
        deadline = time.monotonic() + KILLING
        while time.monotonic() < deadline:
            self._find_descendants()
            self._find_marked()
            # The group at once, so that what forks all the time does not outrun this.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)
            for process in self._tree:
                _ask(process, psutil.Process.kill, None)
            # A killed process may have forked before it died: look again until none runs.
            if not any(map(_runs, self._tree)):
                break
            time.sleep(0.002)
        # wait4 alone tells the processor time of children that the process has waited for.
        _, status, usage = os.wait4(self._popen.pid, 0)
        self._popen.returncode = os.waitstatus_to_exitcode(status)
        self._ended = self._popen.returncode, usage.ru_utime + usage.ru_stime
        os.close(self._life)
        for pipe in filter(None, (self._popen.stdin, self._popen.stdout)):
            pipe.close()
        return self._ended

    def _read_answer(self, words: Collection[str]) -> tuple[str, str]:
        """Read what has been printed: how the exchange ends, if it does, and the answer."""
        chunk = os.read(self._output, 2**16)
        # A process that closes its output can answer nothing any more, nor can one whose line never ends.
        if not chunk or len(self._buffer) > MOST_PRINTED:
            return "exit", ""
        # What stands behind the last end of line is the beginning of the next line.
        *lines, self._buffer = (self._buffer + chunk).split(b"\n")
        for encoded in lines:
            line = encoded.decode("utf-8", "replace").strip()
            if line.partition(" ")[0] in words:
                return "line", line
        return "", ""

    def _find_descendants(self) -> None:
        """Look for descendants; those seen before count also when their parent has gone."""
        root, *earlier = self._tree
        descendants = {*earlier, *_ask(root, lambda process: process.children(recursive=True), ())}
        # Those that have ended go: their numbers may be those of other processes soon.
        self._tree = [root, *filter(_runs, descendants)]

    def _find_marked(self) -> None:
        """Look for processes that have left the session and lost their parent: they still have the mark."""
        for process in psutil.process_iter():
            environment = _ask(process, psutil.Process.environ, {})
            if environment.get(MARK) == self._mark and process not in self._tree:
                self._tree.append(process)

    def _memory(self, limit: float) -> int:
        """Resident memory, bytes; above the limit shared pages are counted once, which is exact and slow."""
        resident: int = sum(_ask(process, lambda p: p.memory_info().rss, 0) for process in self._tree)
        if resident <= limit:
            return resident
        return sum(_ask(process, lambda p: p.memory_full_info().pss, 0) for process in self._tree)

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
    return bool(_ask(process, lambda p: p.is_running() and p.status() != psutil.STATUS_ZOMBIE, False))
