"""A process and all that came of it, as Linux tells of them: their memory, their time, their end."""

import contextlib
import os
import signal
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

PAGE = os.sysconf("SC_PAGE_SIZE")
TICK = 1.0 / os.sysconf("SC_CLK_TCK")

MARK = "HMTB_SANDBOX"
"""Variable of the environment by which processes are known that have left their session."""

PATIENCE = 5.0
"""How long the system may take to end processes, s."""


@dataclass(frozen=True)
class Relative:
    """A process.

    Attributes:
        pid: Its number.
        parent: That of its parent.
        session: That of its session.
        dead: Whether only its exit code is left.
    """

    pid: int
    parent: int
    session: int
    dead: bool


def family(root: int, *, apart: Collection[int] = ()) -> list[int]:
    """A process, its descendants and all processes of its session, as far as they run.

    Args:
        root: The process.
        apart: Descendants that are left out with all that came of them.
    """
    everyone = [found for pid in _pids() if (found := _look(pid)) is not None]
    members = {found.pid for found in everyone if found.pid == root or found.session == root}
    grown = True
    while grown:
        more = {found.pid for found in everyone if found.parent in members} - members - set(apart)
        members |= more
        grown = bool(more)
    return [found.pid for found in everyone if found.pid in members and not found.dead]


def marked(mark: str) -> list[int]:
    """Processes in whose environment a mark stands."""
    wanted = f"{MARK}={mark}".encode()
    return [pid for pid in _pids() if wanted in _read(pid, "environ").split(b"\0")]


def resident(pids: list[int]) -> int:
    """Memory of processes, bytes; what they share counts once for each."""
    return sum(PAGE * int(fields[1]) for pid in pids if len(fields := _read(pid, "statm").split()) > 1)


def resident_once(pids: list[int]) -> int:
    """Memory of processes, bytes; what they share counts once. Slower than `resident`."""
    total = 0
    for pid in pids:
        lines = _read(pid, "smaps_rollup").splitlines()
        told = [line.split() for line in lines if line.startswith(b"Pss:")]
        # A system that does not tell it has the larger figure.
        total += 1024 * int(told[0][1]) if told else resident([pid])
    return total


def processor_seconds(pids: list[int]) -> float:
    """Processor time of processes, and of their children that have ended, s."""
    total = 0.0
    for pid in pids:
        fields = _read(pid, "stat").rpartition(b")")[2].split()
        if len(fields) > 14:
            total += TICK * (int(fields[13]) + int(fields[14]))
            try:
                # The clock of another process: to the nanosecond, where `stat` counts hundredths of a second.
                total += time.clock_gettime((~pid << 3) | 2)
            except OSError:
                total += TICK * (int(fields[11]) + int(fields[12]))
    return total


def end_all(find: Callable[[], set[int]], group: int) -> None:
    """End processes until none is found any more.

    Args:
        find: Tells their numbers.
        group: Group of processes that is ended with them; 0: none.
    """
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        left = find()
        with contextlib.suppress(ProcessLookupError):
            # At one blow, so that what forks all the time does not outrun this.
            if group:
                os.killpg(group, signal.SIGKILL)
        for pid in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if not left:
            return
        time.sleep(0.002)


def _pids() -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]


def _look(pid: int) -> Relative | None:
    # The name of the program, in brackets, may itself hold brackets and spaces.
    fields = _read(pid, "stat").rpartition(b")")[2].split()
    if len(fields) < 4:
        return None
    return Relative(pid, int(fields[1]), int(fields[3]), fields[0] in (b"Z", b"X"))


def _read(pid: int, name: str) -> bytes:
    """A file of /proc; empty where the process is gone or not ours."""
    try:
        with open(f"/proc/{pid}/{name}", "rb") as file:
            return file.read()
    except OSError:
        return b""
