"""A process in a session of its own, talked to over pipes, watched, and ended with all that came of it."""

import os
import select
import signal
import subprocess
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.bench_contract import process_tree
from scenarios.bench_contract.wire import WireError

TAIL = 4000
"""Bytes of what it printed last that are kept."""

TOLD = 300
"""Characters of them that are told."""

READ = 1 << 18
FIRST_LOOK, LONGEST_LOOK = 0.02, 0.1
"""Time between looks at its memory, s: soon at first, then rarer."""

LOOKS = 5
"""After so many looks it is looked for what has come of it: that means reading of every process there is."""

ONE_THREAD = {
    name: "1"
    for name in (
        *("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"),
        *("NUMEXPR_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"),
    )
}
"""With one thread each, times of estimators compare."""


@dataclass(frozen=True)
class Exchange:
    """What came of a request.

    Attributes:
        end: `answered`, `ended` (the process died or closed its pipe), `hang`, `memory`, or `garbage`.
        reply: What came.
        wall: Time that it took, s.
        peak_bytes: The most memory that was seen, bytes.
        seconds: Processor time that it took, s.
        why: Of garbage: what was wrong.
    """

    end: str
    reply: bytes
    wall: float
    peak_bytes: int
    seconds: float
    why: str = ""


class Supervised:
    """A process of an estimator.

    Args:
        command: Program and arguments; `{request}` and `{reply}` become the numbers of its pipes.
        folder: In which it runs.
        environment: Added to this process's own.
        channel: `pipes` of its own, `standard` input and output, or `none`.

    Raises:
        OSError: It cannot be started.
    """

    def __init__(
        self, command: Sequence[str], *, folder: Path, environment: Mapping[str, str], channel: str = "pipes"
    ) -> None:
        self._mark = uuid.uuid4().hex
        self._tail = bytearray()
        self._ends: list[int] = []
        self.exit_code: int | None = None
        self.usage_seconds = float("nan")
        request, theirs_request = self._pipe(ours_writes=True) if channel != "none" else (-1, -1)
        reply, theirs_reply = self._pipe(ours_writes=False) if channel != "none" else (-1, -1)
        tail, theirs_tail = self._pipe(ours_writes=False)
        theirs = [end for end in (theirs_request, theirs_reply, theirs_tail) if end >= 0]
        numbers = {"{request}": str(theirs_request), "{reply}": str(theirs_reply)}
        standard = channel == "standard"
        try:
            self._process = subprocess.Popen(
                [numbers.get(word, word) for word in command] if channel == "pipes" else list(command),
                stdin=theirs_request if standard else subprocess.DEVNULL,
                stdout=theirs_reply if standard else theirs_tail,
                stderr=theirs_tail,
                cwd=folder,
                env={**os.environ, **ONE_THREAD, **environment, process_tree.MARK: self._mark},
                pass_fds=(theirs_request, theirs_reply) if channel == "pipes" else (),
                start_new_session=True,
            )
        except BaseException:
            self._close_pipes()
            raise
        finally:
            for end in theirs:
                os.close(end)
        self._request, self._reply, self._printed = request, reply, tail
        self._members = [self._process.pid]
        self._life = os.pidfd_open(self._process.pid)
        self._ends.append(self._life)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def exchange(
        self, request: bytes, finished: Callable[[bytearray], bool], *, seconds: float, memory_bytes: int
    ) -> Exchange:
        """Send a request and wait for what comes of it. After all but `answered` the process is of no use.

        Args:
            request: What is sent.
            finished: Whether a reply is complete; raises `WireError` where it never will be.
            seconds: How long to wait, s.
            memory_bytes: What the process and all that came of it may hold.
        """
        begun, used = time.monotonic(), self._processor_seconds()
        reply, rest, peak = bytearray(), memoryview(request), 0
        look, pause, looks = begun + FIRST_LOOK, FIRST_LOOK, 0
        poll = select.poll()
        for end in (self._reply, self._printed):
            if end >= 0:
                poll.register(end, select.POLLIN)
        poll.register(self._life, select.POLLIN)
        if rest:
            poll.register(self._request, select.POLLOUT)

        def outcome(end: str, why: str = "") -> Exchange:
            wall, spent = time.monotonic() - begun, self._processor_seconds() - used
            most = max(peak, process_tree.resident(self._members))
            return Exchange(end, bytes(reply), wall, most, spent, why)

        while True:
            now = time.monotonic()
            if now >= begun + seconds:
                return outcome("hang")
            events = dict(poll.poll(1000.0 * max(0.0, min(look, begun + seconds) - now)))
            if self._printed in events and not self._keep_tail():
                poll.unregister(self._printed)
            if self._request in events:
                rest = self._send(rest)
                if not rest:
                    poll.unregister(self._request)
            if self._reply in events:
                more = _read(self._reply)
                reply += more
                try:
                    if more and finished(reply):
                        return outcome("answered")
                except WireError as error:
                    return outcome("garbage", str(error))
                if not more:
                    return outcome("ended")
            elif self._life in events:
                self._keep_tail()
                return outcome("ended")
            if time.monotonic() >= look:
                if looks % LOOKS == 0:
                    self._members = process_tree.family(self.pid)
                looks += 1
                held = process_tree.resident(self._members)
                if held > memory_bytes:
                    held = process_tree.resident_once(self._members)
                peak = max(peak, held)
                if held > memory_bytes:
                    return outcome("memory")
                pause = min(1.5 * pause, LONGEST_LOOK)
                look = time.monotonic() + pause

    def tail(self) -> str:
        """The last of what it printed, on one line."""
        self._keep_tail()
        text = self._tail.decode("utf-8", "replace")
        return " ".join("".join(c if c.isprintable() else " " for c in text).split())[-TOLD:]

    def forget_tail(self) -> None:
        """Leave behind what was printed so far."""
        self._keep_tail()
        self._tail.clear()

    def end(self, grace: float = 0.0) -> None:
        """End it and all that came of it; its exit code and processor time are known then.

        Args:
            grace: How long it may take to end by itself, s.
        """
        if self.exit_code is not None:
            return
        select.select([self._life], [], [], grace)
        # Until it is waited for its number stays its own, and its exit code what it was if it has ended by itself.
        process_tree.end_all(self._process.pid, self._mark)
        _, status, usage = os.wait4(self._process.pid, 0)
        self.exit_code = self._process.returncode = os.waitstatus_to_exitcode(status)
        self.usage_seconds = usage.ru_utime + usage.ru_stime
        self._keep_tail()
        self._close_pipes()

    def how_it_ended(self) -> str:
        """In words, once it has."""
        code = self.exit_code
        if code is None:
            return "still running"
        if code >= 0:
            return f"exit code {code}"
        try:
            return f"signal {signal.Signals(-code).name}"
        except ValueError:
            return f"signal {-code}"

    def _processor_seconds(self) -> float:
        """Of the process, which may just have died, and of what was last seen to have come of it, s."""
        return process_tree.processor_seconds(list({self.pid, *self._members}))

    def _pipe(self, *, ours_writes: bool) -> tuple[int, int]:
        """A pipe: our end, which never waits, and theirs."""
        reads, writes = os.pipe()
        ours, theirs = (writes, reads) if ours_writes else (reads, writes)
        os.set_blocking(ours, False)
        self._ends.append(ours)
        return ours, theirs

    def _send(self, rest: memoryview) -> memoryview:
        try:
            return rest[os.write(self._request, rest) :]
        except BlockingIOError:
            return rest
        except OSError:
            # It has closed its end; what comes of that is seen at the other pipes.
            return rest[len(rest) :]

    def _keep_tail(self) -> bool:
        """Take what was printed; False where nothing can come any more."""
        if self._printed not in self._ends:
            return False
        more = _read(self._printed)
        self._tail += more
        del self._tail[:-TAIL]
        return bool(more)

    def _close_pipes(self) -> None:
        while self._ends:
            os.close(self._ends.pop())


def _read(end: int) -> bytes:
    """What has come; empty where nothing has or can."""
    try:
        return os.read(end, READ)
    except OSError:
        return b""
