"""NetCDF4 files: their contents, how they are read, and how they are written."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import numpy as np

from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.files.errors import TwinError, system_reason
from hmtb_twin.files.hashes import array_hash
from hmtb_twin.files.netcdf_variable import NO_VARIABLE
from hmtb_twin.files.netcdf_variable import Attribute as Attribute
from hmtb_twin.files.netcdf_variable import Variable as Variable
from sysid.records.foreign_files import hdf5_contents, hdf5_listing
from sysid.records.reading_process import UnreadableError, read_apart

MOST_BYTES = 2**31
"""Arrays of one file together; more is no record of an experiment."""

BOOKKEEPING = frozenset(
    {
        *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"),
        *("_NCProperties", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict"),
    }
)
"""Attributes of HDF5 that make up the structure of NetCDF4."""


@dataclass(frozen=True)
class Contents:
    """Variables of a file by name, and attributes of the whole."""

    variables: Mapping[str, Variable]
    attributes: Mapping[str, Attribute]

    def array_hashes(self) -> dict[str, str]:
        """Hash of every array of numbers, by name; names of channels are no numbers."""
        arrays = {name: variable.values for name, variable in self.variables.items()}
        return {name: array_hash(values) for name, values in arrays.items() if values.dtype.kind in "biufc"}

    def differing(self, hashes: Mapping[str, str | None]) -> list[str]:
        """Names, sorted, of the arrays whose hash is another one, or that stand on one side alone."""
        return sorted({name for name, _ in hashes.items() ^ self.array_hashes().items()})

    def to_bytes(self) -> bytes:
        """Write the file in memory.

        Raises:
            TwinError: Two variables disagree about a dimension, or a variable is no NetCDF variable.
        """
        # reading happens in a process of its own: whoever only reads does not wait for h5py
        from hmtb_twin.files.netcdf_writer import netcdf_bytes

        sizes: dict[str, int] = {}
        for name, variable in self.variables.items():
            if variable.values.dtype.kind not in "iufU":
                raise TwinError(f"{name} is of type {variable.values.dtype}, expected real numbers or texts")
            for dim, size in zip(variable.dims, variable.values.shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise TwinError(f"{name} has {size} along {dim}, others have {sizes[dim]}")
        for name in sizes.keys() & self.variables.keys():
            if self.variables[name].dims != (name,):
                raise TwinError(f"{name} is a dimension, expected its variable to run along itself alone")
        return netcdf_bytes(sizes, self.variables, self.attributes)


def read_netcdf(path: Path, *, only: Collection[str] | None = None) -> Contents:
    """Read a file, and nothing but that file, in the process that reads files from elsewhere.

    Args:
        path: The file.
        only: Names of the variables to read; all by default.

    Raises:
        TwinError: It is missing, no NetCDF4 file or damaged; it refers to other files; or it is too large.
    """
    if path.exists() and not path.is_file():
        # Reading from a pipe would never end.
        raise TwinError(f"{path} is no ordinary file, expected NetCDF4")
    try:
        # h5netcdf takes five times as long as h5py, mostly for attributes.
        arrays = read_apart(hdf5_listing, path, ["NAME"], False)
        _check(arrays, path)
        names = [array["name"] for array in arrays if _is_variable(array)]
        if only is not None:
            names = [name for name in names if name in only]
        of_file, *contents = read_apart(hdf5_contents, path, ["/", *names], None, True)
        variables: dict[str, Variable] = {}
        for name, content in zip(names, contents, strict=True):
            # A scalar comes as a number.
            values = np.asarray(content["values"])
            variables[name] = Variable(_dimensions(name, content), values, _attributes(content))
        return Contents(variables, _attributes(of_file))
    except FileNotFoundError:
        raise TwinError(f"no file {path}: expected NetCDF4") from None
    except PermissionError as error:
        raise TwinError(f"cannot read {path}: {system_reason(error)}") from error
    except TwinError:
        raise
    except (UnreadableError, OSError, ValueError) as error:
        raise TwinError(f"{path} is not a NetCDF4 file, or a damaged one ({error})") from error


def contents_of(file: bytes) -> Contents:
    """Read a file that is in memory; `TwinError` as of `read_netcdf`."""
    with NamedTemporaryFile(suffix=".nc") as stream:
        stream.write(file)
        stream.flush()
        return read_netcdf(Path(stream.name))


def stated_format(path: Path) -> str:
    """Format that a NetCDF4 file names in its attribute `format`; empty if it names none or is no such file."""
    try:
        (of_file,) = read_apart(hdf5_contents, path, ["/"], ["format"], False)
    except (UnreadableError, OSError):
        return ""
    return _text(of_file["attributes"].get("format", ""))


def variable_names(path: Path) -> list[str]:
    """Names of the arrays of a NetCDF4 file, dimensions among them.

    Raises:
        UnreadableError: It is no such file, or damaged.
    """
    return [array["name"] for array in read_apart(hdf5_listing, path, [], False)]


def read_format(path: str | Path, kind: str, version: str, required: Collection[str]) -> Contents:
    """Read a file of one of our formats.

    Args:
        path: The file.
        kind: Kind of the file in messages, such as "joint log".
        version: Attribute `format` of the file.
        required: Variables that it must hold.

    Raises:
        TwinError: The file is missing, damaged, or of another kind.
    """
    path = Path(path)
    if not path.exists():
        raise TwinError(f"no file {path}: expected a {kind}, NetCDF4")
    contents = read_netcdf(path)
    names = contents.variables
    if contents.attributes.get("format") != version or any(name not in names for name in required):
        raise TwinError(
            f"{path} is no {kind}: expected format {version!r} with {', '.join(required)}; "
            f"found {', '.join(names) or 'nothing'}"
        )
    return contents


def write_format(path: str | Path, kind: str, contents: Contents) -> Path:
    """Write a file whole or not at all, and return its path.

    Raises:
        TwinError: The file cannot be written.
    """
    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        raise TwinError(f"cannot write the {kind} {path}: it is a folder, or its folder does not exist")
    try:
        # The file is made in memory: HDF5 crashes on a disk that is full.
        write_whole(path, contents.to_bytes())
    except (OSError, ValueError, TypeError) as error:
        reason = system_reason(error) if isinstance(error, OSError) else error
        raise TwinError(f"cannot write the {kind} {path}: {reason}") from error
    return path


def _check(arrays: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Refuse links to other files, and arrays that claim to fill the memory: HDF5 packs zeros well."""
    size = 0
    for array in arrays:
        if array["holds"] == "link":
            raise TwinError(f"{path}: {array['name']!r} is a link; expected arrays that stand in the file itself")
        if array["holds"] != "array":
            raise TwinError(f"{path}: {array['name']!r} is no array that stands in the file itself")
        size += array["bytes"]
    if size > MOST_BYTES:
        raise TwinError(f"{path}: arrays of {size} bytes given, expected at most {MOST_BYTES}")


def _is_variable(array: Mapping[str, Any]) -> bool:
    return not _text(array["attributes"].get("NAME", "")).startswith(NO_VARIABLE)


def _dimensions(name: str, content: Mapping[str, Any]) -> tuple[str, ...]:
    """Dimensions of a variable: HDF5 refers to their arrays."""
    axes = np.ndim(content["values"])
    if content["dimensions"] is not None:
        return tuple(content["dimensions"])
    if axes > 1:
        raise ValueError(f"{name} has {axes} axes without names")
    return (name,) if axes else ()


def _attributes(content: Mapping[str, Any]) -> dict[str, Attribute]:
    """Attributes that users wrote, without those of the format itself."""
    return {key: _python_value(value) for key, value in content["attributes"].items() if key not in BOOKKEEPING}


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _python_value(value: object) -> Attribute:
    """Attribute as a number or text of Python; an array of several numbers stays one."""
    if isinstance(value, np.ndarray):
        return _python_value(value.ravel()[0]) if value.size == 1 else value
    if isinstance(value, np.integer):
        return int(value)
    return float(value) if isinstance(value, float | np.floating) else _text(value)
