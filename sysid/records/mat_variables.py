"""Numbers and texts in MATLAB files: SciPy decodes them once every length in them has been checked."""

import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from math import prod
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import shortened, shown
from sysid.records.errors import SysidError

MOST_NUMBERS = 2**27
"""Numbers of all variables that are read, 1 GiB as float64: a small file can claim to unpack to any size."""

MOST_TEXT, MOST_CELLS = 2**16, 2**8
"""Bytes of a text or of a cell array, and cells: larger ones hold no names of channels."""

LONGEST_REASON = 200  # characters of an error of SciPy's, which quotes names as they stand in the file
HEAD, TAG = 128, 8  # bytes before the first variable, and before the contents of each part
LONGEST_START = 4096  # bytes that hold the class, dimensions and name of any variable

INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
NUMBER_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
TEXT_TYPES = (1, 2, 4, 16, 17, 18)
"""Types of stored data, with the bytes of a number [MathWorks2019, ch. 1]."""

CELLS, TEXT, NUMBERS = 1, 4, range(6, 16)
COMPLEX = 1 << 11
"""Classes of arrays in a MATLAB file, and the flag of complex ones [MathWorks2019, ch. 1]."""

MOST_DIMS = 32  # dimensions of an array, at most; SciPy has room for as many


class _Start(NamedTuple):
    """Class, dimensions and name of a variable, and where its values begin."""

    kind: int
    is_complex: bool
    dims: tuple[int, ...]
    name: str
    end: int

    @property
    def numbers(self) -> int:
        """Numbers or cells; dimensions of zero count as one, which keeps the product of the others in bounds."""
        return prod(max(size, 1) for size in self.dims) * (2 if self.is_complex else 1)


def read_variables(file: Path, names: Collection[str] | None = None) -> dict[str, NDArray[np.generic]]:
    """Read dense numbers, short texts and cell arrays of both, at least 2-D, by name; None reads all numbers.

    SciPy's reader trusts the types, lengths and depths that a file states, and ends the process where they are wrong.
    Here it gets a copy of the file, of version 7.2 or older and from anywhere, that holds only variables whose parts
    are of known types, lie within each other and match the dimensions; other variables are left out. Files of version 4
    have no such parts; SciPy reads them in Python.

    Raises:
        SysidError: It is no such file, or damaged, or holds more than `MOST_NUMBERS`.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import matfile_version

    try:
        content = file.read_bytes()
        version, _ = matfile_version(BytesIO(content))
        if version > 1:
            raise ValueError("this one has version 7.3")
        stored = loadmat(_checked(content, names) if version else BytesIO(content))
    except Exception as error:  # what SciPy raises on damaged files of version 4 follows no rule
        reason = shortened(str(error), LONGEST_REASON) or type(error).__name__
        raise SysidError(
            f"{file.name}: not a .mat file of version 7.2 or older, which MATLAB writes by save -v7 ({reason})"
        ) from error
    return {
        name: value
        for name, value in stored.items()
        if isinstance(value, np.ndarray) and (value.dtype.kind in "biufc" if names is None else name in names)
    }


def _checked(content: bytes, names: Collection[str] | None) -> BytesIO:
    """Copy the variables that are wanted, unpacked and checked, to a file of their own."""
    order = "<" if content[HEAD - 2 : HEAD] == b"IM" else ">"
    stream, total = BytesIO(), 0
    # Zeros in the beginning would mean version 4.
    stream.write(b" " * (HEAD - 4) + content[HEAD - 4 : HEAD])
    for kind, stored in _elements(memoryview(content), order):
        start = _start(_unpacked(kind, stored, order, LONGEST_START), order)
        if start is None or not start.name or (start.kind not in NUMBERS if names is None else start.name not in names):
            continue
        total += start.numbers
        if total > MOST_NUMBERS:
            what = f"{shown(start.name)} of shape {shown(start.dims)}"
            raise ValueError(f"{total} numbers in {what} and before it, expected at most {MOST_NUMBERS}")
        # What stands before the values, the values, their one or two tags; texts and cells have a limit of their own.
        room = 2 * LONGEST_START + 8 * start.numbers + (0 if start.kind in NUMBERS else MOST_TEXT)
        data = _unpacked(kind, stored, order, room)
        # A text or a cell array that fills the room is too long.
        is_whole = start.kind in NUMBERS or len(data) < room
        if is_whole and _end_of_values(data, start, order) is not None:
            stream.write(struct.pack(f"{order}II", MATRIX, len(data)))
            stream.write(data)
    stream.seek(0)
    return stream


def _elements(content: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield the type and the bytes of each variable."""
    at = HEAD
    while at < len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        at += TAG + size
        if at > len(content):
            raise ValueError(f"a variable of {size} bytes ends {at - len(content)} bytes behind the file")
        yield kind, content[at - size : at]


def _unpacked(kind: int, stored: memoryview, order: str, most: int) -> memoryview:
    """Contents of a variable, unpacked if they are compressed; the first ones, where they are longer than `most`."""
    if kind == COMPRESSED:
        unpacker = zlib.decompressobj()
        kind, size = struct.unpack(f"{order}II", unpacker.decompress(stored, TAG))
        # A limit of 0 would mean none.
        unpacked = unpacker.decompress(unpacker.unconsumed_tail, min(size, most) + 1)
        if len(unpacked) > size:
            raise ValueError(f"a variable unpacks to more than the {size} bytes that it states")
        stored = memoryview(unpacked)
    if kind != MATRIX:
        raise ValueError(f"a variable of type {kind}, expected {MATRIX}")
    return stored[:most]


def _part(data: memoryview, at: int, order: str) -> tuple[int, memoryview, int]:
    """Type and bytes of the part of a variable that begins at a byte, and where the next part begins."""
    kind, size = struct.unpack_from(f"{order}II", data, at)
    first, end = at + TAG, at + TAG + size + -size % 8
    if kind >> 16:  # up to four bytes stand within the tag
        kind, size = kind & 0xFFFF, kind >> 16
        first, end = at + TAG // 2, at + TAG
        if size > TAG // 2:
            raise ValueError(f"{size} bytes within a tag, expected at most {TAG // 2}")
    if first + size > len(data):
        raise ValueError(f"a part of {size} bytes ends behind its variable")
    return kind, data[first : first + size], end


def _start(data: memoryview, order: str) -> _Start | None:
    """Read what stands before the values of a variable; None if it is of a kind that is left out."""
    kind, flags, at = _part(data, 0, order)
    if kind != UINT32 or len(flags) != 8:
        raise ValueError("a variable without flags")
    (bits,) = struct.unpack_from(f"{order}I", flags)
    if bits & 0xFF not in (CELLS, TEXT, *NUMBERS):
        return None
    kind, stored, at = _part(data, at, order)
    dims = struct.unpack(f"{order}{len(stored) // 4}i", stored)
    if kind not in (INT32, UINT32) or not 2 <= len(dims) <= MOST_DIMS or min(dims) < 0:
        raise ValueError(f"a variable of dimensions {shown(dims)}, expected 2 to {MOST_DIMS} of them, none negative")
    kind, name, at = _part(data, at, order)
    if kind not in (INT8, UTF8):
        raise ValueError(f"the name of a variable has type {kind}, expected {INT8}")
    return _Start(bits & 0xFF, bool(bits & COMPLEX), dims, bytes(name).decode("latin-1"), at)


def _end_of_values(data: memoryview, start: _Start, order: str) -> int | None:
    """Check the values of a variable and find their end; None if they are left out.

    Raises:
        ValueError: Their types or lengths do not fit.
    """
    at = start.end
    if start.kind == TEXT:
        kind, _, at = _part(data, at, order)
        if kind not in TEXT_TYPES:
            raise ValueError(f"text {shown(start.name)} of type {kind}, expected one of {TEXT_TYPES}")
        return at if start.numbers <= MOST_TEXT else None
    if start.kind == CELLS:
        return _end_of_cells(data, start, order)
    for _ in range(2 if start.is_complex else 1):
        kind, values, at = _part(data, at, order)
        if kind not in NUMBER_SIZES or len(values) != prod(start.dims) * NUMBER_SIZES[kind]:
            raise ValueError(
                f"{shown(start.name)} has {len(values)} bytes of type {kind} for {shown(start.dims)} numbers"
            )
    return at


def _end_of_cells(data: memoryview, start: _Start, order: str) -> int | None:
    """Check cells of numbers and texts likewise; others are left out, because SciPy follows any depth."""
    at = start.end
    if start.numbers > MOST_CELLS:
        return None
    for _ in range(prod(start.dims)):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        cell = data[at + TAG : at + TAG + size]
        at += TAG + size
        if kind != MATRIX or len(cell) != size:
            raise ValueError(f"{shown(start.name)} has a damaged cell")
        inside = _start(cell, order) if size else None
        if size and (inside is None or inside.kind == CELLS or (end := _end_of_values(cell, inside, order)) is None):
            return None
        # SciPy looks for the next cell where the values of this one end.
        if size and end != size:
            raise ValueError(f"{shown(start.name)} has a cell of {size} bytes whose values take {end}")
    return at
