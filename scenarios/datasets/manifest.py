"""What was done of a build so far: JSON lines, only ever appended to.

A line names an experiment by its place in the plan, or a piece of a stage. Each ends with a checksum of its own: what
a crash or a disk has spoilt counts for nothing, and the work is done anew. Lines stay on the disk; in memory is where
each begins, so that a plan of any size weighs little.
"""

import errno
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np

from scenarios.files.atomic_write import replacing

NONE = -1
"""Where nothing is known of an experiment."""


def line_of(entry: Mapping[str, Any]) -> bytes:
    """The line that holds an entry, its checksum in it."""
    text = json.dumps(entry, sort_keys=True, allow_nan=False)
    return f'{text[:-1]}, "sum": "{_checksum(text)}"}}\n'.encode()


def entry_of(line: bytes) -> dict[str, Any] | None:
    """The entry that a line holds; None where it is no line, or a spoilt one."""
    try:
        entry = json.loads(line)
        given = entry.pop("sum")
        whole = line.endswith(b"\n") and _checksum(json.dumps(entry, sort_keys=True, allow_nan=False)) == given
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return entry if whole and _makes_sense(entry) else None


def _makes_sense(entry: Mapping[str, Any]) -> bool:
    """Whether an entry is one of an experiment, or one of a piece: a checksum alone can be made for anything."""
    if ("number" in entry) == ("stage" in entry):
        return False
    if "number" in entry:
        number, about = entry["number"], entry.get("about")
        # A truth value is a number to Python.
        named = type(number) is int and number >= 0 and isinstance(about, dict) and isinstance(about.get("name"), str)
    else:
        named = isinstance(entry["stage"], str) and isinstance(entry.get("piece"), str)
    files = entry.get("files")
    sums = isinstance(files, dict) and all(isinstance(value, str) for value in files.values())
    arrays = entry.get("arrays", {})
    hashed = isinstance(arrays, dict) and all(isinstance(value, dict) for value in arrays.values())
    return named and sums and hashed


def _checksum(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:16]


class Manifest:
    """The manifest of a build, open.

    Args:
        path: The file; made where there is none. A last line that a crash cut off is cut off whole.
        size: How many experiments the plan has.

    Raises:
        OSError: The file cannot be read or written.
    """

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._experiments = np.full(size, NONE, dtype=np.int64)
        self._pieces: dict[tuple[str, str], int] = {}
        self._end = 0
        path.touch()
        if not path.is_file():
            raise FileExistsError(errno.EEXIST, "no ordinary file", str(path))
        self._reader = self._scanned()

    def __enter__(self) -> "Manifest":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.close()

    @property
    def done(self) -> int:
        """How many experiments are noted."""
        return int(np.count_nonzero(self._experiments != NONE))

    @property
    def left(self) -> Iterator[int]:
        """Places in the plan of experiments that are not noted, in order."""
        return (int(number) for number in np.flatnonzero(self._experiments == NONE))

    def noted(self) -> Iterator[dict[str, Any]]:
        """Entries of experiments that are noted, in the order of the plan."""
        return (self._at(int(offset)) for offset in self._experiments if offset != NONE)

    def experiment(self, number: int) -> dict[str, Any] | None:
        """The entry of an experiment, None where none is noted."""
        offset = int(self._experiments[number])
        return None if offset == NONE else self._at(offset)

    def piece(self, stage: str, piece: str) -> dict[str, Any] | None:
        """The entry of a piece of a stage, None where none is noted."""
        offset = self._pieces.get((stage, piece))
        return None if offset is None else self._at(offset)

    def pieces(self) -> Iterator[dict[str, Any]]:
        """Entries of the pieces that are noted."""
        return (self._at(offset) for offset in self._pieces.values())

    def forget(self, entry: Mapping[str, Any]) -> None:
        """Take an entry for not noted, because its files are not what it says; the work will be done anew."""
        if "number" in entry:
            self._experiments[entry["number"]] = NONE
        else:
            del self._pieces[entry["stage"], entry["piece"]]

    def append(self, entries: Sequence[Mapping[str, Any]]) -> None:
        """Append entries and see them on the disk.

        Raises:
            OSError: They cannot be written; none of them is noted then.
        """
        lines = [line_of(entry) for entry in entries]
        with self._path.open("r+b") as stream:
            # Where a write before failed, half a line may stand.
            stream.truncate(self._end)
            stream.seek(self._end)
            stream.writelines(lines)
            stream.flush()
            os.fsync(stream.fileno())
        for entry, line in zip(entries, lines, strict=True):
            self._note(entry, self._end)
            self._end += len(line)

    def put_in_order(self, pieces: Sequence[tuple[str, str]]) -> None:
        """Write the manifest anew, a line per entry: experiments in the order of the plan, then pieces.

        Args:
            pieces: Stage and name of those that are noted, in their order.

        Raises:
            OSError: It cannot be written; the old one stays.
        """
        with replacing(self._path, durable=True) as partial, partial.open("wb") as stream:
            of_pieces = (self._at(self._pieces[piece]) for piece in pieces)
            for entry in chain(self.noted(), of_pieces):
                stream.write(line_of(entry))
        self._reader.close()
        self._end, self._pieces = 0, {}
        self._reader = self._scanned()

    def _at(self, offset: int) -> dict[str, Any]:
        self._reader.seek(offset)
        entry = entry_of(self._reader.readline())
        if entry is None:
            raise OSError(0, "a line has changed while the data set was being built", str(self._path))
        return entry

    def _scanned(self) -> BinaryIO:
        """Note what stands in the file, cut off half a line at its end, and open the file to look lines up."""
        with self._path.open("r+b") as stream:
            for line in stream:
                if not line.endswith(b"\n"):
                    stream.truncate(self._end)
                    break
                entry = entry_of(line)
                if entry is not None:
                    self._note(entry, self._end)
                self._end += len(line)
        return self._path.open("rb")

    def _note(self, entry: Mapping[str, Any], offset: int) -> None:
        if "stage" in entry:
            self._pieces[entry["stage"], entry["piece"]] = offset
        elif entry["number"] < len(self._experiments):
            self._experiments[entry["number"]] = offset
