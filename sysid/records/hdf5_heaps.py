"""Check of HDF5 files before the HDF5 library reads them: some damage makes it loop without end."""

import mmap
import struct
from pathlib import Path

HEAP = b"GCOL\x01\x00\x00\x00"
"""Signature of a global heap and its version."""

HEAD, OBJECT = 16, 16
"""Bytes before the objects of a global heap, and before the contents of each [HDF5, sec. III.E]."""


def check_heaps(file: Path) -> None:
    """Check that the objects of each global heap, which hold texts, follow each other to its end.

    Raises:
        ValueError: They do not.
    """
    with file.open("rb") as stream:
        if not stream.read(1):
            return
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            at = content.find(HEAP)
            while at >= 0:
                _check_heap(content, at)
                at = content.find(HEAP, at + 1)


def _check_heap(content: mmap.mmap, start: int) -> None:
    if start + HEAD > len(content):
        return
    (size,) = struct.unpack_from("<Q", content, start + 8)
    at, end = start + HEAD, min(start + size, len(content))
    while at + OBJECT <= end:
        index, _, length = struct.unpack_from("<HH4xQ", content, at)
        # Index 0 is free space up to the end, its head included.
        if index == 0 and length < OBJECT:
            raise ValueError(f"a heap of texts has free space of {length} bytes")
        at += length if index == 0 else OBJECT + length + -length % 8
