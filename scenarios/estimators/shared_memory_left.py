"""Shared memory by name: what a process that was ended has left of it stays in memory until somebody removes it."""

import contextlib
import os
import stat
from collections.abc import Collection, Iterable
from pathlib import Path

PLACE = Path("/dev/shm")


def names() -> frozenset[str]:
    """What there is, by name."""
    try:
        return frozenset(os.listdir(PLACE))
    except OSError:
        return frozenset()


def held(pids: Iterable[int]) -> set[str]:
    """Names of what processes have open."""
    found = set()
    for pid in pids:
        with contextlib.suppress(OSError):
            for end in os.listdir(f"/proc/{pid}/fd"):
                with contextlib.suppress(OSError):
                    path = os.readlink(f"/proc/{pid}/fd/{end}")
                    if os.path.dirname(path) == str(PLACE):
                        found.add(os.path.basename(path))
    return found


def remove(some: Collection[str]) -> None:
    """Remove what is ours and what no process has open or mapped any more.

    Args:
        some: Names.
    """
    if not some:
        return
    pids = [int(name) for name in os.listdir("/proc") if name.isdigit()]
    used = held(pids)
    for name in set(some) - used:
        path = PLACE / name
        with contextlib.suppress(OSError):
            status = path.lstat()
            mine = stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid()
            if mine and not any(_maps(pid, str(path)) for pid in pids):
                path.unlink()


def _maps(pid: int, path: str) -> bool:
    try:
        return path.encode() in Path(f"/proc/{pid}/maps").read_bytes()
    except OSError:
        return False
