"""Reading of HDF5 files: some damage makes the HDF5 library loop without end, some links lead to other files."""

import mmap
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sysid.records.arguments import shortened
from sysid.records.errors import SysidError

HEAP = b"GCOL\x01\x00\x00\x00"  # signature of a global heap and its version
HEAD, OBJECT = 16, 16  # bytes before the objects of a global heap, and before the contents of each [HDF5, sec. III.E]

MOST_NUMBERS = 2**28
"""Numbers of a file, 2 GiB as float64: packed zeros of a small file can claim more than there is memory."""


@contextmanager
def opened(file: Path, damaged: str) -> Iterator[Any]:
    """Open an HDF5 file; `damaged` says in errors what another format or a damaged file is."""
    import h5py

    try:
        check_heaps(file)
        with h5py.File(file) as whole:
            yield whole
    except SysidError:
        raise
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        raise SysidError(f"{file.name}: {damaged} ({shortened(str(error), 200)})") from error


def check_size(file: Path, arrays: Iterable[Any]) -> None:
    """Refuse arrays of too many numbers."""
    if (numbers := sum(array.size for array in arrays)) > MOST_NUMBERS:
        raise SysidError(f"{file.name}: arrays of {numbers} numbers, expected at most {MOST_NUMBERS}")


def check_heaps(file: Path) -> None:
    """Check the global heaps of an HDF5 file, which hold its texts: objects must fill each heap to its end.

    Raises:
        ValueError: They do not: the HDF5 library would read on for ever.
    """
    with file.open("rb") as stream:
        if not stream.read(1):
            return
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            at = content.find(HEAP)
            while at >= 0:
                _check_heap(content, at)
                at = content.find(HEAP, at + 1)


def items_of(group: Any) -> Iterator[tuple[str, Any]]:
    """Names and contents of an HDF5 group; links and arrays that lead to other files are refused.

    Raises:
        ValueError: A soft or an external link, or an array that is stored elsewhere.
    """
    import h5py

    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            item = group[name]
            if not isinstance(item, h5py.Dataset) or not (item.external or item.is_virtual):
                yield name, item
                continue
        raise ValueError(f"{name!r} may lead to another file; expected arrays in this one")


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
