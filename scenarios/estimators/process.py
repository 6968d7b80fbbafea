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
from typing import Any

import psutil

from scenarios.estimators.outcome import MODEL, EstimatorOutcome

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

GRACE, KILLING = 0.5, 5.0
"""Time that a process has to end after it has closed its output, and that killed processes have to vanish, s."""

MARK = "HMTB_ESTIMATOR"
"""Variable of the environment by which descendants are found that have left their session and lost their parent."""

_LIBC = ctypes.CDLL(None)


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
        self._log, self._buffer, self._grace = log, bytearray(), 0.0
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

    def exchange(
        self, request: str, words: Collection[str], *, seconds: float, memory_bytes: float
    ) -> EstimatorOutcome:
        """Send a line and wait for an answer. After anything but an answer the process is of no use.

        Args:
            request: The line; empty for none.
            words: First words of an answer; other lines are ignored.
            seconds: Time limit, s.
            memory_bytes: Memory limit of the process with its descendants, bytes.

        Returns:
            `MODEL` with the answer for its reason; `crash`: it ended, or closed its output; `hang` or `memory`.
        """
        begun, used_before = time.monotonic(), self._processor_seconds()
        if request and self._popen.stdin is not None:
            self._forget_earlier_output()
            with contextlib.suppress(BrokenPipeError):
                self._popen.stdin.write(request.encode() + b"\n")
        # The clock begins before the request is written: a process that does not read it hangs.
        kind, line, peak = self._wait(words, begun, begun + seconds, memory_bytes)
        # One that has closed its output may be about to end with a code of its own.
        self._grace = GRACE if kind == "crash" else 0.0
        wall, used = time.monotonic() - begun, max(self._processor_seconds() - used_before, 0.0)
        return EstimatorOutcome(kind, line, used, wall, max(peak, self._memory(memory_bytes)))

    def _forget_earlier_output(self) -> None:
        """Empty log and pipe: what came without a request answers nothing."""
        self._empty_log()
        with contextlib.suppress(BlockingIOError):
            os.read(self._output, MOST_PRINTED)
        self._buffer.clear()

    def _empty_log(self) -> None:
        with contextlib.suppress(OSError):
            os.truncate(self._log, 0)

    def _logged(self) -> int:
        """Bytes that the process has printed; 0 where it has removed the file."""
        with contextlib.suppress(OSError):
            return os.path.getsize(self._log)
        return 0

    def _wait(self, words: Collection[str], begun: float, deadline: float, memory_bytes: float) -> tuple[str, str, int]:
        """Kind of the outcome, the answer, and the largest memory that was seen at regular looks."""
        next_look, pause, peak = begun + FIRST_LOOK, FIRST_LOOK, 0
        while True:
            remaining = min(next_look, deadline) - time.monotonic()
            ready = dict(self._poll.poll(max(0.0, 1000.0 * remaining)))
            if self._output in ready:
                kind, line = self._read_answer(words)
                if kind:
                    return kind, line, peak
            elif self._life in ready:
                return "crash", "", peak
            time_now = time.monotonic()
            if time_now >= deadline:
                return "hang", "", peak
            if time_now >= next_look:
                if self._logged() > MOST_LOGGED:
                    self._empty_log()
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
        try:
            with self._log.open("rb") as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - TAIL))
                return file.read().decode("utf-8", "replace")
        except OSError:  # the estimator may have removed the folder, or put anything there
            return ""

    def limit_data(self, beyond: int) -> None:
        """Let the process allocate so many bytes beyond what it has: what goes beyond raises MemoryError in Python."""
        process = self._tree[0]
        # RLIMIT_DATA counts private writable memory; RLIMIT_AS would count mapped code and files too.
        limit = _ask(process, lambda p: p.memory_info().data, 0) + beyond
        _ask(process, lambda p: p.rlimit(psutil.RLIMIT_DATA, (limit, limit)), None)

    def kill(self) -> tuple[int, float]:
        """Kill it with all its descendants, once.

        Returns:
            Exit code, negative for a signal, and processor time with that of the children that it waited for, s.
        """
        select.select([self._life], [], [], self._grace)
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
        os.close(self._life)
        for pipe in filter(None, (self._popen.stdin, self._popen.stdout)):
            pipe.close()
        return self._popen.returncode, usage.ru_utime + usage.ru_stime

    def _read_answer(self, words: Collection[str]) -> tuple[str, str]:
        """Read what the process has printed: kind of outcome and answer, both empty while there is none."""
        chunk = os.read(self._output, 2**16)
        # A process that closes its output can answer nothing any more, nor can one whose line never ends.
        if not chunk or len(self._buffer) > MOST_PRINTED:
            return "crash", ""
        # What stands behind the last end of line is the beginning of the next line.
        *lines, self._buffer = (self._buffer + chunk).split(b"\n")
        for encoded in lines:
            line = encoded.decode("utf-8", "replace").strip()
            if line.partition(" ")[0] in words:
                return MODEL, line
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
    # PR_SET_PDEATHSIG: Linux sends the signal when the parent dies, also when that is killed.
    _LIBC.prctl(1, int(signal.SIGKILL), 0, 0, 0)


def _ask(process: psutil.Process, question: Callable[[psutil.Process], Any], default: Any) -> Any:
    """A property of a process; the default where it has ended, or is not ours."""
    try:
        return question(process)
    except (psutil.Error, OSError):
        return default


def _runs(process: psutil.Process) -> bool:
    return bool(_ask(process, lambda p: p.is_running() and p.status() != psutil.STATUS_ZOMBIE, False))
