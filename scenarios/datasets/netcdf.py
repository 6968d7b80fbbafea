"""NetCDF4 files whose bytes depend on what they hold alone."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import h5py
import numpy as np

from scenarios.datasets.hashes import array_hash
from scenarios.datasets.netcdf_bytes import Attribute, netcdf_bytes
from scenarios.errors import ScenarioError

MOST_BYTES = 2**31
"""Arrays of one file together; more is no record of an experiment."""


BOOKKEEPING = frozenset(
    {
        *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"),
        *("_NCProperties", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict"),
    }
)
"""Attributes by which NetCDF4 is laid upon HDF5."""


@dataclass(frozen=True)
class Variable:
    """An array of a file.

    Attributes:
        dims: Names of its dimensions, one per axis.
        values: Numbers, or texts.
        attributes: Unit, meaning, role.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Attribute]


@dataclass(frozen=True)
class Contents:
    """What a file holds.

    Attributes:
        variables: By name.
        attributes: Of the whole.
    """

    variables: Mapping[str, Variable]
    attributes: Mapping[str, Attribute]

    def array_hashes(self) -> dict[str, str]:
        """Hash of every array of numbers, by name; names of channels are no numbers."""
        return {name: array_hash(v.values) for name, v in self.variables.items() if v.values.dtype.kind in "biufc"}

    def to_bytes(self) -> bytes:
        """The file.

        Raises:
            ScenarioError: Two variables disagree about a dimension, or a variable is no NetCDF variable.
        """
        sizes: dict[str, int] = {}
        for name, variable in self.variables.items():
            if variable.values.dtype.kind not in "iufU":
                raise ScenarioError(f"{name} is of type {variable.values.dtype}, expected real numbers or texts")
            for dim, size in zip(variable.dims, variable.values.shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise ScenarioError(f"{name} has {size} along {dim}, others have {sizes[dim]}")
        for name in sizes.keys() & self.variables.keys():
            if self.variables[name].dims != (name,):
                raise ScenarioError(f"{name} is a dimension, expected its variable to run along itself alone")
        return netcdf_bytes(sizes, self.variables, self.attributes)


def read_netcdf(path: Path | BinaryIO, *, only: Collection[str] | None = None) -> Contents:
    """Read a file, and nothing but that file.

    Args:
        path: The file, or its bytes as a stream.
        only: Names of the variables that are read; all by default.

    Raises:
        ScenarioError: It is missing, or no NetCDF4 file, or a damaged one, or one that refers to other files or claims
            to hold more than `MOST_BYTES`.
    """
    if isinstance(path, Path) and path.exists() and not path.is_file():
        # From a pipe nothing would ever come.
        raise ScenarioError(f"{path} is no ordinary file, expected NetCDF4")
    try:
        # Through h5netcdf it takes five times as long, mostly for attributes.
        with h5py.File(path, "r") as raw:
            _check(raw, path)
            variables = {
                name: Variable(_dimensions(raw, name, entry), _values(entry), _attributes(entry))
                for name, entry in raw.items()
                if (only is None or name in only) and not _is_dimension(entry)
            }
            return Contents(variables, _attributes(raw))
    except FileNotFoundError:
        raise ScenarioError(f"no file {path}: expected NetCDF4") from None
    except ScenarioError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise ScenarioError(f"{path} is not a NetCDF4 file, or a damaged one") from error


def read_array(path: Path, name: str) -> np.ndarray:
    """Read one array of a file, and nothing else: where there are thousands of files, most of each would be in vain.

    Args:
        path: The file.
        name: The array.

    Raises:
        ScenarioError: As `read_netcdf`, or there is no such array.
    """
    try:
        with h5py.File(path, "r") as raw:
            if not isinstance(raw.get(name, getlink=True), h5py.HardLink):
                raise ScenarioError(f"{path} has no array {name!r}")
            entry = raw[name]
            if not isinstance(entry, h5py.Dataset) or entry.external or entry.is_virtual or entry.nbytes > MOST_BYTES:
                raise ScenarioError(f"{path}: {name!r} is no array that stands in the file itself")
            return _values(entry)
    except FileNotFoundError:
        raise ScenarioError(f"no file {path}: expected NetCDF4") from None
    except ScenarioError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise ScenarioError(f"{path} is not a NetCDF4 file, or a damaged one") from error


def _check(raw: h5py.File, path: Path | BinaryIO) -> None:
    """Refuse a file where reading it would read others or fill the memory: HDF5 knows links, and packs zeros well."""
    size = 0
    for name in raw:
        if not isinstance(raw.get(name, getlink=True), h5py.HardLink):
            raise ScenarioError(f"{path}: {name!r} is a link; expected arrays that stand in the file itself")
        entry = raw[name]
        if not isinstance(entry, h5py.Dataset) or entry.external or entry.is_virtual:
            raise ScenarioError(f"{path}: {name!r} is no array that stands in the file itself")
        size += entry.nbytes
    if size > MOST_BYTES:
        raise ScenarioError(f"{path}: arrays of {size} bytes given, expected at most {MOST_BYTES}")


def _is_dimension(entry: h5py.Dataset) -> bool:
    """Whether an array only tells the length of a dimension that has no variable of its own."""
    return _text(entry.attrs.get("NAME", "")).startswith("This is a netCDF dimension but not a netCDF variable")


def _dimensions(raw: h5py.File, name: str, entry: h5py.Dataset) -> tuple[str, ...]:
    """Names of the dimensions that a variable runs along: HDF5 refers to their arrays."""
    if "DIMENSION_LIST" in entry.attrs:
        return tuple(str(raw[scales[0]].name).removeprefix("/") for scales in entry.attrs["DIMENSION_LIST"])
    if entry.ndim > 1:
        raise ValueError(f"{name} has {entry.ndim} axes without names")
    return (name,) if entry.ndim else ()


def _attributes(entry: h5py.HLObject) -> dict[str, Attribute]:
    """What users wrote; the rest is bookkeeping of the format."""
    return {key: _plain(value) for key, value in entry.attrs.items() if key not in BOOKKEEPING}


def _values(entry: h5py.Dataset) -> np.ndarray:
    values = np.asarray(entry[...])
    return values if values.dtype.kind != "O" else np.array([_text(v) for v in values.ravel()]).reshape(values.shape)


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _plain(value: object) -> Attribute:
    if isinstance(value, np.ndarray):
        return _plain(value.ravel()[0]) if value.size == 1 else value
    if isinstance(value, np.integer):
        return int(value)
    return float(value) if isinstance(value, float | np.floating) else _text(value)
