"""What becomes of a process when its parent dies: it ends too, or is left to one of ours, and somebody watches it."""

import contextlib
import ctypes
import os
import signal

_PARENT_DEATH_SIGNAL = 1
"""Of Linux's prctl: a signal that comes with the end of the parent's thread that started this process."""

_SUBREAPER = 36
"""Of Linux's prctl: orphans become children of this process, not of the first of the system."""

_LIBC = ctypes.CDLL(None)
"""Loaded before any fork: after one, in a process with threads, it could not be."""


def die_with_parent(parent: int) -> None:
    """Let this process be killed when its parent ends.

    Args:
        parent: Number of the parent, which may be gone by now.
    """
    with contextlib.suppress(OSError, AttributeError):
        _LIBC.prctl(_PARENT_DEATH_SIGNAL, int(signal.SIGKILL), 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)


def take_orphans() -> None:
    """Let orphans among the descendants of this process become its children, not those of the first of the system."""
    with contextlib.suppress(OSError, AttributeError):
        _LIBC.prctl(_SUBREAPER, 1, 0, 0, 0)
