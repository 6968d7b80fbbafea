"""MATLAB files byte by byte, right and wrong ones."""

import struct
import zlib

HEAD = b"MATLAB 5.0".ljust(124) + b"\x00\x01IM"
"""Head of a little-endian file of version 5."""

DOUBLE, CELL, TEXT = 6, 1, 4
"""Classes of arrays."""


def part(kind: int, values: bytes) -> bytes:
    """Write a data element of a MATLAB file: type, length, bytes, zeros up to a multiple of eight."""
    return struct.pack("<II", kind, len(values)) + values + bytes(-len(values) % 8)


def variable(name: str, values: bytes, kind: int = DOUBLE, dims: tuple[int, ...] = (1, 1), flags: int = 0) -> bytes:
    """Write a variable of parts that hold its values."""
    start = part(6, struct.pack("<II", kind | flags, 0)) + part(5, struct.pack(f"<{len(dims)}i", *dims))
    return part(14, start + part(1, name.encode()) + values)


def nested(levels: int, name: str = "y") -> bytes:
    """Write cells in cells around a number."""
    inside = variable("", part(9, bytes(8)))
    for _ in range(levels - 1):
        inside = variable("", inside, CELL)
    return variable(name, inside, CELL)


def packed(content: bytes) -> bytes:
    """Compress a variable as files of version 7 have it."""
    stored = zlib.compress(content)
    return struct.pack("<II", 15, len(stored)) + stored
