"""Arrays of HDF5 files, which stand in the file itself and are not too large."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.records.errors import SysidError
from sysid.records.foreign_files import hdf5_contents, hdf5_listing
from sysid.records.reading_process import UnreadableError, read_apart

MOST_NUMBERS = 2**28
"""Numbers of a file, 2 GiB as float64: packed zeros of a small file can claim more than there is memory."""


class ListedArray(NamedTuple):
    """An array of a file, before its numbers are read.

    Attributes:
        name: Its name, within groups as `log/u`.
        shape: Its shape.
        kind: Kind of its numbers, as in NumPy: "f", "i", ...
        attributes: Those of its attributes that were asked for.
    """

    name: str
    shape: tuple[int, ...]
    kind: str
    attributes: dict[str, Any]


class StoredArray(NamedTuple):
    """Numbers of an array, and those of its attributes that were asked for."""

    values: NDArray[Any]
    attributes: dict[str, Any]


def list_arrays(file: Path, damaged: str, attributes: Sequence[str], *, nested: bool) -> list[ListedArray]:
    """List the arrays of a file; those in groups too, if `nested`.

    Args:
        file: The file.
        damaged: What another format or a damaged file is, for errors.
        attributes: Names of the attributes to list.
        nested: Whether to list arrays in groups too.

    Raises:
        SysidError: The file is damaged, or links or arrays lead to other files.
    """
    try:
        items = read_apart(hdf5_listing, file, list(attributes), nested)
    except UnreadableError as error:
        raise SysidError(f"{file.name}: {damaged} ({error})") from error
    for item in items:
        if item["holds"] in ("link", "elsewhere"):
            name = item["name"].rpartition("/")[2]
            raise SysidError(f"{file.name}: {damaged} ({name!r} may lead to another file; expected arrays in this one)")
    arrays = []
    for item in items:
        if item["holds"] == "array":
            arrays.append(ListedArray(item["name"], tuple(item["shape"]), item["kind"], item["attributes"]))
    return arrays


def read_arrays(
    file: Path, damaged: str, arrays: Sequence[ListedArray], attributes: Sequence[str]
) -> tuple[list[StoredArray], dict[str, Any]]:
    """Read numbers and attributes of arrays, and the same attributes of the file itself.

    Raises:
        SysidError: The file is damaged, or holds more than `MOST_NUMBERS`.
    """
    numbers = sum(int(np.prod(array.shape, dtype=object)) for array in arrays)
    if numbers > MOST_NUMBERS:
        raise SysidError(f"{file.name}: arrays of {numbers} numbers, expected at most {MOST_NUMBERS}")
    names = ["/", *(array.name for array in arrays)]
    try:
        whole_file, *contents = read_apart(hdf5_contents, file, names, list(attributes), False)
    except UnreadableError as error:
        raise SysidError(f"{file.name}: {damaged} ({error})") from error
    stored = [StoredArray(np.asarray(content["values"]), content["attributes"]) for content in contents]
    return stored, whole_file["attributes"]
