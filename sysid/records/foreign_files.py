"""The process that reads files from elsewhere, HDF5 and MATLAB: `reading_process` starts it and asks it.

One flipped byte can make the HDF5 library or SciPy's reader crash, loop without end or ask for all memory. So they run
in this process, which has limits, and hand over arrays; no other process parses such files. It is run as a script, by
its path, because `import sysid` would take longer than most files.

A request is a line of JSON with the name of a function and its arguments. The answer is a line of JSON as well, then
the bytes of its arrays: nothing that comes from a file is ever unpickled.
"""

import ctypes
import json
import math
import os
import resource
import signal
import struct
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

MOST_MEMORY = 3 * 2**30
"""Bytes that reading a file may take; records have 2 GiB at most."""

MOST_ADDRESSES = MOST_MEMORY + 2**30
"""Bytes of addresses: libraries, and files that are mapped, take more than they fill."""

REFERENCES = ("DIMENSION_LIST", "REFERENCE_LIST")
"""Attributes of HDF5 that refer to other arrays: they hold addresses, no numbers."""

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

ARRAY, CELLS, BYTES = "\0array", "\0cells", "\0bytes"
"""Keys of JSON that stand for an array, for an array of arrays and for bytes; no name in a file holds a zero."""


def is_hdf5(file: Path) -> bool:
    """Whether a file is HDF5, by its signature: at 0, or behind 512, 1024 ... bytes of others [HDF5, sec. II.A]."""
    size, start = file.stat().st_size, 0
    with file.open("rb") as stream:
        while start < size:
            stream.seek(start)
            if stream.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                return True
            start = 2 * start or 512
    return False


def hdf5_listing(path: str, attributes: Sequence[str], nested: bool) -> list[dict[str, Any]]:
    """List what an HDF5 file holds, without reading its numbers.

    Args:
        path: The file.
        attributes: Names of the attributes of arrays to list.
        nested: Whether to enter groups. Those of MATLAB's own, whose names begin with #, and sparse matrices are not
            entered, and no group twice, because links can lead in circles.

    Returns:
        For each item its `name`, within groups as `log/u`, and what it `holds`: "array"; "link"; "elsewhere" for
        arrays that are stored outside the file; "other". For arrays also their `shape`, `kind` of numbers as in NumPy,
        `bytes` and `attributes`.
    """
    import h5py

    with h5py.File(path, "r") as file:
        entered = {file["/"]} if nested else None
        return list(_items(file, "", attributes, entered))


def _items(group: Any, prefix: str, attributes: Sequence[str], entered: set[Any] | None) -> Iterator[dict[str, Any]]:
    import h5py

    for name in group:
        item = {"name": f"{prefix}{name}", "holds": "other"}
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            yield item | {"holds": "link"}
            continue
        stored = group[name]
        if isinstance(stored, h5py.Dataset):
            yield item | _array(stored, attributes)
            continue
        yield item
        if entered is None or not isinstance(stored, h5py.Group) or name.startswith("#") or stored in entered:
            continue
        entered.add(stored)
        if "MATLAB_sparse" not in stored.attrs:
            yield from _items(stored, f"{prefix}{name}/", attributes, entered)


def _array(stored: Any, attributes: Sequence[str]) -> dict[str, Any]:
    """Describe a data set of HDF5: its shape, kind, size and attributes, or that its values are not in this file."""
    if stored.external or stored.is_virtual:
        return {"holds": "elsewhere"}
    if stored.shape is None:
        return {"holds": "other"}
    kind = "V" if stored.dtype.names else stored.dtype.kind
    return {
        "holds": "array",
        "shape": stored.shape,
        "kind": kind,
        "bytes": stored.nbytes,
        "attributes": _attributes(stored, attributes),
    }


def hdf5_contents(
    path: str, names: Sequence[str], attributes: Sequence[str] | None, dimensions: bool
) -> list[dict[str, Any]]:
    """Read arrays of an HDF5 file.

    Args:
        path: The file.
        names: Names of the arrays as `hdf5_listing` has them; "/" is the file itself.
        attributes: Names of the attributes to read; None reads all.
        dimensions: Whether to read the names of the axes.

    Returns:
        For each name its `attributes`, and of arrays also the `values`, texts as Unicode, and `dimensions`: the names
        of the arrays that belong to the axes, None where the file has none.
    """
    import h5py

    contents = []
    with h5py.File(path, "r") as file:
        for name in names:
            stored = file[name]
            content: dict[str, Any] = {"attributes": _attributes(stored, attributes)}
            if isinstance(stored, h5py.Dataset):
                content["values"] = _values(stored)
                content["dimensions"] = _dimensions(file, stored) if dimensions else None
            contents.append(content)
    return contents


def _attributes(stored: Any, names: Sequence[str] | None) -> dict[str, Any]:
    import h5py

    attributes: dict[str, Any] = {}
    for name in stored.attrs if names is None else names:
        if name in REFERENCES or name not in stored.attrs:
            continue
        value = stored.attrs[name]
        if isinstance(value, h5py.Empty):
            value = ""
        # Scalars travel as arrays, which keep their type: a scale in float32 makes other products than one in float64.
        attributes[name] = value if isinstance(value, str | bytes) else _texts_as_unicode(np.asarray(value))
    return attributes


def _values(stored: Any) -> Any:
    # HDF5 does not tell a lack of memory for a packed chunk from damage.
    if math.prod(stored.chunks or ()) * stored.dtype.itemsize > MOST_MEMORY // 4:
        raise MemoryError
    return _texts_as_unicode(np.asarray(stored[...]))


def _texts_as_unicode(values: Any) -> Any:
    """Convert an array of texts, which h5py reads as objects, to Unicode; return other arrays as they are."""
    if values.dtype.kind != "O":
        return values
    texts = []
    for element in values.ravel():
        texts.append(element.decode() if isinstance(element, bytes) else str(element))
    return np.array(texts).reshape(values.shape)


def _dimensions(file: Any, stored: Any) -> list[str] | None:
    if "DIMENSION_LIST" not in stored.attrs:
        return None
    return [str(file[scales[0]].name).removeprefix("/") for scales in stored.attrs["DIMENSION_LIST"]]


def matlab_listing(path: str) -> list[tuple[str, tuple[int, ...], str]]:
    """List the variables of a MATLAB file of version 7.2 or older: name, shape and class."""
    from scipy.io import whosmat
    from scipy.io.matlab import matfile_version

    version, _ = matfile_version(path, appendmat=False)
    if version > 1:
        raise ValueError("this one has version 7.3")
    if version == 1:
        _check_length(path)
    return [(name, shape, kind) for name, shape, kind in whosmat(path, appendmat=False)]


def _check_length(path: str) -> None:
    """Refuse a file that ends within a variable: SciPy does not notice it of a variable that is not read."""
    end = os.path.getsize(path)
    with open(path, "rb") as stream:
        head = stream.read(128)
        order = "<" if head.endswith(b"IM") else ">"
        while (start := stream.tell()) < end:
            _, size = struct.unpack(f"{order}II", stream.read(8))
            if start + 8 + size > end:
                raise ValueError(f"a variable of {size} bytes ends {start + 8 + size - end} bytes behind the file")
            stream.seek(size, os.SEEK_CUR)


def matlab_contents(path: str, names: Collection[str]) -> dict[str, Any]:
    """Read variables of such a file: numbers, texts, and cells of both; cells within cells are left out."""
    from scipy.io import loadmat

    stored = loadmat(path, variable_names=list(names), appendmat=False)
    return {name: values for name, values in stored.items() if name in names and _is_plain(values)}


def _is_plain(values: Any) -> bool:
    if not isinstance(values, np.ndarray):
        return False
    cells = values.ravel() if values.dtype.kind == "O" else [values]
    return all(isinstance(cell, np.ndarray) and cell.dtype.kind in "biufcU" for cell in cells)


def numpy_contents(path: str) -> dict[str, Any]:
    """Read the arrays of numbers in an .npz file; those of Python objects, which would run code, are left out."""
    with np.load(path, allow_pickle=False) as archive:
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise ValueError("a single array without a name")
        arrays = {}
        for name in archive.files:
            try:
                values = archive[name]
            except ValueError as error:
                # The only error of a sound file; damage inside it has other words.
                if "allow_pickle" not in str(error):
                    raise
                continue
            if values.dtype.kind in "biufc":
                arrays[name] = values
        return arrays


def encoded(answer: Mapping[str, Any]) -> tuple[bytes, list[Any]]:
    """Write an answer as a line in which keys stand for its arrays; list these arrays in the sequence of the line."""
    arrays: list[Any] = []

    def stand_in(value: Any) -> dict[str, Any]:
        if isinstance(value, bytes):
            return {BYTES: value.decode("latin-1")}
        values = np.asarray(value)
        if values.dtype.kind == "O":
            return {CELLS: list(values.ravel()), "shape": values.shape}
        if values.dtype.kind not in "biufcSU":
            raise TypeError(f"an array of type {values.dtype}, expected numbers or texts")
        arrays.append(values)
        # MATLAB has columns first: sums over arrays in another sequence would differ in their last bits.
        order = "F" if values.flags.f_contiguous and not values.flags.c_contiguous else "C"
        return {ARRAY: values.dtype.str, "shape": values.shape, "order": order}

    return json.dumps(answer, default=stand_in).encode() + b"\n", arrays


def decoded(line: bytes, stream: IO[bytes]) -> Any:
    """Read an answer; the bytes of its arrays follow in the stream.

    Raises:
        EOFError: The stream ends before.
    """

    def restored(node: dict[str, Any]) -> Any:
        # Inner objects come first, in the sequence of the line, which is that of the arrays.
        if BYTES in node:
            return node[BYTES].encode("latin-1")
        if CELLS in node:
            cells = np.empty(len(node[CELLS]), object)
            cells[:] = node[CELLS]
            return cells.reshape(node["shape"])
        if ARRAY not in node:
            return node
        values = np.empty(node["shape"], node[ARRAY], node["order"])
        content = values.reshape(-1, order="A").view(np.uint8)
        if stream.readinto(content) != content.size:  # type: ignore[attr-defined]
            raise EOFError
        return values if values.ndim else values[()]

    return json.loads(line, object_hook=restored)


PR_SET_PDEATHSIG = 1
"""Option of Linux's `prctl`: the signal that a process gets when the thread that started it ends."""


def end_with_parent(parent: int) -> None:
    """Let the system kill this process when the one that started it ends, however busy this one is.

    Otherwise it would notice the end of its input only after the file that it is reading. The signal follows the
    thread that started it, which is right here: each thread has a reading process, and nobody else asks it.
    Other systems than Linux have no such signal.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
    # The parent may have ended before it could be asked for.
    if os.getppid() != parent:
        sys.exit()


def answer_requests() -> None:
    """Answer requests from the input until it ends."""
    for limited, most in ((resource.RLIMIT_DATA, MOST_MEMORY), (resource.RLIMIT_AS, MOST_ADDRESSES)):
        soft, hard = resource.getrlimit(limited)
        resource.setrlimit(limited, (most if soft == resource.RLIM_INFINITY else min(soft, most), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Ctrl-C goes to all processes at a terminal; this one ends when its input does.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    with os.fdopen(os.dup(1), "wb") as answers:
        # What libraries print is no answer.
        os.dup2(2, 1)
        for line in sys.stdin.buffer:
            request = json.loads(line)
            sys.path[:] = request["sys.path"]
            os.chdir(request["folder"])
            # The alarm ends this process also within a library that loops, and where nobody waits for it any more.
            signal.setitimer(signal.ITIMER_REAL, request["patience"])
            head, arrays = _answer(request["function"], request["arguments"])
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            answers.write(head)
            for values in arrays:
                answers.write(values.ravel(order="A").view(np.uint8))
            answers.flush()
            # The next file may need all memory that is allowed.
            del head, arrays


def _answer(name: str, arguments: Sequence[Any]) -> tuple[bytes, list[Any]]:
    try:
        module, _, function = name.partition(":")
        owner = sys.modules[__name__] if module == "sysid.records.foreign_files" else import_module(module)
        return encoded({"result": getattr(owner, function)(*arguments)})
    except MemoryError:
        return encoded({"error": "memory"})
    except ModuleNotFoundError as error:
        return encoded({"error": "package", "reason": error.name})
    except Exception as error:  # what libraries raise on damaged files follows no rule
        is_ours = type(error).__module__.partition(".")[0] in ("sysid", "hmtb_twin", "scenarios")
        kind = "refusal" if is_ours else "damage"
        return encoded({"error": kind, "reason": str(error) or type(error).__name__})


if __name__ == "__main__":
    end_with_parent(int(sys.argv[1]))
    answer_requests()
