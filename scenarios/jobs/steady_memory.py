"""Memory that goes back to the system when a chunk is done, so that a build of any size needs what one chunk needs."""

import ctypes
from functools import cache


@cache
def steady_memory() -> bool:
    """Ask the C library for blocks of memory that can be given back, for the rest of the process.

    glibc raises its threshold as larger blocks come free, and puts what is smaller on a heap in which the models of one
    chunk leave holes that those of the next do not fill: a fleet of 1,000 arms took half as much memory again as one of
    100. Other C libraries are left as they are.

    Returns:
        Whether it was done.
    """
    try:
        # M_MMAP_THRESHOLD, -3: blocks of 128 KiB and more, where glibc begins too, go back when they are free.
        return bool(ctypes.CDLL(None).mallopt(-3, 128 * 1024))
    except (OSError, AttributeError, TypeError):
        return False
