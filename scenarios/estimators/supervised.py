"""A process in a session of its own, talked to over pipes, watched, and ended with all that came of it."""

import os
import select
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass

from scenarios.estimators import process_tree, shared_memory_left
from scenarios.estimators.pipes import Pipes, read
from scenarios.estimators.wire import WireError
from scenarios.files.printable import one_line

TAIL = 4000
"""Bytes of what it printed last that are kept."""

TOLD = 300
"""Characters of them that are told."""

FIRST_LOOK, LONGEST_LOOK = 0.02, 0.1
"""Time between looks at its memory, s: soon at first, then rarer."""

LOOKS = 5
"""After so many looks it is looked for what has come of it: that means reading of every process there is."""


UNASKED = 0.1
"""How long what comes unasked is read before a request, s."""


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
    """A process of an estimator, watched.

    Args:
        pid: Its number.
        pipes: To it.
        members: Tells the processes that run: it, and all that came of it.
        finish: Ends them all; returns the exit code, or None where that is lost, and processor time, s.
    """

    def __init__(
        self,
        pid: int,
        pipes: Pipes,
        members: Callable[[], list[int]],
        finish: Callable[[], tuple[int | None, float]],
    ) -> None:
        self.pid, self._pipes, self._find, self._finish = pid, pipes, members, finish
        self._tail = bytearray()
        self._members = [pid]
        self._over = False
        self._shared_before, self._shared = shared_memory_left.names(), set[str]()
        self.exit_code: int | None = None
        self.usage_seconds = float("nan")
        self._life = os.pidfd_open(pid)
        pipes.ours.append(self._life)

    @property
    def alive(self) -> bool:
        """Whether the process still runs."""
        return not self._over and not select.select([self._life], [], [], 0.0)[0]

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
        for end in (self._pipes.reply, self._pipes.printed):
            if end >= 0:
                poll.register(end, select.POLLIN)
        poll.register(self._life, select.POLLIN)
        if rest:
            poll.register(self._pipes.request, select.POLLOUT)

        def outcome(end: str, why: str = "") -> Exchange:
            wall, spent = time.monotonic() - begun, self._processor_seconds() - used
            most = max(peak, process_tree.resident(self._members))
            return Exchange(end, bytes(reply), wall, most, spent, why)

        while True:
            now = time.monotonic()
            if now >= begun + seconds:
                return outcome("hang")
            events = dict(poll.poll(1000.0 * max(0.0, min(look, begun + seconds) - now)))
            if self._pipes.printed in events and not self._keep_tail():
                poll.unregister(self._pipes.printed)
            if self._pipes.request in events:
                rest = self._send(rest)
                if not rest:
                    poll.unregister(self._pipes.request)
            if self._pipes.reply in events:
                more = read(self._pipes.reply)
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
                    self._members = self._find()
                    self._shared |= shared_memory_left.held(self._members)
                looks += 1
                held = process_tree.resident(self._members)
                if held > memory_bytes:
                    held = process_tree.resident_once(self._members)
                peak = max(peak, held)
                if held > memory_bytes:
                    return outcome("memory")
                pause = min(1.5 * pause, LONGEST_LOOK)
                look = time.monotonic() + pause

    def tail(self, mended: Callable[[str], str] = str) -> str:
        """The last of what it printed, on one line.

        Args:
            mended: What becomes of the text before it is cut to its last characters.
        """
        self._keep_tail()
        return mended(one_line(self._tail.decode("utf-8", "replace")))[-TOLD:]

    def forget_tail(self) -> None:
        """Leave behind what was printed so far."""
        self._keep_tail()
        self._tail.clear()

    def forget_replies(self) -> None:
        """Leave behind what has come unasked."""
        until = time.monotonic() + UNASKED
        while self._pipes.reply >= 0 and read(self._pipes.reply) and time.monotonic() < until:
            pass

    def end(self, grace: float = 0.0) -> None:
        """End it and all that came of it; its exit code and processor time are known then.

        Args:
            grace: How long it may take to end by itself, s.
        """
        if self._over:
            return
        select.select([self._life], [], [], grace)
        self._shared |= shared_memory_left.held(self._find())
        self.exit_code, self.usage_seconds = self._finish()
        self._over = True
        # What was there before it began belongs to others.
        shared_memory_left.remove(self._shared - self._shared_before)
        self._keep_tail()
        self._pipes.close()

    def how_it_ended(self) -> str:
        """In words, once it has."""
        code = self.exit_code
        if code is None:
            return "nobody saw how" if self._over else "still running"
        if code >= 0:
            return f"exit code {code}"
        try:
            return f"signal {signal.Signals(-code).name}"
        except ValueError:
            return f"signal {-code}"

    def _processor_seconds(self) -> float:
        """Of the process, which may just have died, and of what was last seen to have come of it, s."""
        return process_tree.processor_seconds(list({self.pid, *self._members}))

    def _send(self, rest: memoryview) -> memoryview:
        try:
            return rest[os.write(self._pipes.request, rest) :]
        except BlockingIOError:
            return rest
        except OSError:
            # It has closed its end; what comes of that is seen at the other pipes.
            return rest[len(rest) :]

    def _keep_tail(self) -> bool:
        """Take what was printed; False where nothing can come any more."""
        if self._pipes.printed < 0:
            return False
        more = read(self._pipes.printed)
        self._tail += more
        del self._tail[:-TAIL]
        return bool(more)
