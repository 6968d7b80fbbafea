"""Memory that goes back to the system when a chunk is done, so that a build of any size needs what one chunk needs."""

import ctypes
import sys
from functools import cache

THRESHOLD = 128 * 1024
"""Blocks from this size on are given back to the system when they are free, bytes; where glibc begins, too."""

_MMAP_THRESHOLD = -3
"""M_MMAP_THRESHOLD of mallopt(3)."""


@cache
def steady_memory() -> bool:
    """Ask the C library for blocks of memory that can be given back, for the rest of the process.

    glibc raises its threshold as larger blocks come free, and puts what is smaller on a heap in which the models of one
    chunk leave holes that those of the next do not fill: a fleet of 1,000 arms took half as much memory again as one of
    100. Other C libraries are left as they are.

    Returns:
        Whether it was done.
    """
    if not sys.platform.startswith("linux"):
        return False
    try:
        return bool(ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, THRESHOLD))
    except (OSError, AttributeError):
        return False
