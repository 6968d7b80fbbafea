"""A limit on what a process holds, set from within."""

import contextlib
import resource
from pathlib import Path


def limit_memory(more: int) -> None:
    """Let this process have no more data than it has now and some bytes: what goes beyond raises MemoryError."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        held = [
            line.split() for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmData")
        ]
        limit = 1024 * int(held[0][1]) + more
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
