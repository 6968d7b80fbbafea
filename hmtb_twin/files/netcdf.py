"""NetCDF4 files whose bytes depend on their content alone."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from hmtb_twin.files.atomic_write import write_whole
from hmtb_twin.files.errors import TwinError, system_reason
from hmtb_twin.files.hashes import array_hash

Attribute = str | int | float | np.ndarray
"""Types of an attribute."""

MOST_BYTES = 2**31
"""Arrays of one file together; more is no record of an experiment."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""Beginning of the name that NetCDF4 gives an array which only states the length of a dimension."""

BOOKKEEPING = frozenset(
    {
        *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "DIMENSION_LABELS"),
        *("_NCProperties", "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict"),
    }
)
"""Attributes of HDF5 that make up the structure of NetCDF4."""


@dataclass(frozen=True)
class Variable:
    """A variable of a file.

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
    """Variables of a file by name, and attributes of the whole."""

    variables: Mapping[str, Variable]
    attributes: Mapping[str, Attribute]

    def array_hashes(self) -> dict[str, str]:
        """Hash of every array of numbers, by name; names of channels are no numbers."""
        return {name: array_hash(v.values) for name, v in self.variables.items() if v.values.dtype.kind in "biufc"}

    def to_bytes(self) -> bytes:
        """Write the file in memory.

        Raises:
            TwinError: Two variables disagree about a dimension, or a variable is no NetCDF variable.
        """
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
        return _netcdf_bytes(sizes, self.variables, self.attributes)


def read_netcdf(path: Path | BinaryIO, *, only: Collection[str] | None = None) -> Contents:
    """Read a file, and nothing but that file.

    Args:
        path: The file, or its bytes as a stream.
        only: Names of the variables to read; all by default.

    Raises:
        TwinError: It is missing, no NetCDF4 file or damaged; it refers to other files; or it is too large.
    """
    if isinstance(path, Path) and path.exists() and not path.is_file():
        # Reading from a pipe would never end.
        raise TwinError(f"{path} is no ordinary file, expected NetCDF4")
    try:
        # h5netcdf takes five times as long, mostly for attributes.
        with h5py.File(path, "r") as raw:
            _check(raw, path)
            variables = {
                name: Variable(_dimensions(raw, name, entry), _values(entry), _attributes(entry))
                for name, entry in raw.items()
                if (only is None or name in only) and not _text(entry.attrs.get("NAME", "")).startswith(NO_VARIABLE)
            }
            return Contents(variables, _attributes(raw))
    except FileNotFoundError:
        raise TwinError(f"no file {path}: expected NetCDF4") from None
    except PermissionError as error:
        raise TwinError(f"cannot read {path}: {system_reason(error)}") from error
    except TwinError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise TwinError(f"{path} is not a NetCDF4 file, or a damaged one") from error


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


def _check(raw: h5py.File, path: Path | BinaryIO) -> None:
    """Refuse links to other files, and arrays that claim to fill the memory: HDF5 packs zeros well."""
    size = 0
    for name in raw:
        if not isinstance(raw.get(name, getlink=True), h5py.HardLink):
            raise TwinError(f"{path}: {name!r} is a link; expected arrays that stand in the file itself")
        entry = raw[name]
        if not isinstance(entry, h5py.Dataset) or entry.external or entry.is_virtual:
            raise TwinError(f"{path}: {name!r} is no array that stands in the file itself")
        size += entry.nbytes
    if size > MOST_BYTES:
        raise TwinError(f"{path}: arrays of {size} bytes given, expected at most {MOST_BYTES}")


def _dimensions(raw: h5py.File, name: str, entry: h5py.Dataset) -> tuple[str, ...]:
    """Dimensions of a variable: HDF5 refers to their arrays."""
    if "DIMENSION_LIST" in entry.attrs:
        return tuple(str(raw[scales[0]].name).removeprefix("/") for scales in entry.attrs["DIMENSION_LIST"])
    if entry.ndim > 1:
        raise ValueError(f"{name} has {entry.ndim} axes without names")
    return (name,) if entry.ndim else ()


def _attributes(entry: h5py.HLObject) -> dict[str, Attribute]:
    """Attributes that users wrote, without those of the format itself."""
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


PACKED = 64
"""Arrays of more numbers are compressed."""

LEVEL = 2
"""Level of the compression; higher ones gain nothing, because noise in the low bits cannot be packed."""

CHUNK = 1 << 20
"""Bytes of an array that are compressed at a time, at most: most records are read whole."""

TEXT = h5py.string_dtype()
"""Texts of any length, UTF-8."""


def _netcdf_bytes(
    sizes: Mapping[str, int], variables: Mapping[str, Variable], attributes: Mapping[str, Attribute]
) -> bytes:
    """Write a file; a dimension of size 0 is unlimited. Files of h5netcdf contain times and differ from run to run."""
    memory = {"driver": "core", "backing_store": False, "block_size": CHUNK}
    with h5py.File("in memory", "w", libver=("v108", "v108"), track_order=True, **memory) as file:
        made_by = f"version=2,h5py={h5py.__version__},hdf5={h5py.version.hdf5_version}"
        file.attrs["_NCProperties"] = np.bytes_(made_by)
        _write_attributes(file, attributes)
        # Held open: a dataset that is closed is laid out at once, which would change the bytes.
        scales: dict[str, h5py.Dataset] = {}
        for number, (name, size) in enumerate(sizes.items()):
            if name in variables:
                scale = _dataset(file, name, variables[name].values)
                scale.make_scale(name)
            else:
                scale = file.create_dataset(name, (size,), ">f4", track_order=True, **_layout((size,), 4))
                scale.make_scale(f"{NO_VARIABLE}.{size:10}")
            scale.attrs["_Netcdf4Dimid"] = np.array([number], np.int32)
            scales[name] = scale
        for name, variable in variables.items():
            stored = scales[name] if name in scales else _dataset(file, name, variable.values)
            if name not in scales:
                for axis, dim in enumerate(variable.dims):
                    stored.dims[axis].attach_scale(scales[dim])
            _write_attributes(stored, variable.attributes)
        file.flush()
        return bytes(file.id.get_file_image())


def _write_attributes(place: h5py.HLObject, attributes: Mapping[str, Attribute]) -> None:
    for name, value in attributes.items():
        # Readers of NetCDF4 take a number as an array of one.
        place.attrs[name] = value if isinstance(value, str) else np.atleast_1d(value)


def _dataset(file: h5py.File, name: str, values: np.ndarray) -> h5py.Dataset:
    text = values.dtype.kind == "U"
    layout = _layout(values.shape, 0 if text else values.itemsize)
    return file.create_dataset(name, data=values.astype(TEXT) if text else values, track_order=True, **layout)


def _layout(shape: tuple[int, ...], itemsize: int) -> dict[str, Any]:
    """Chunks of an array, and its compression: texts, whose itemsize is 0 here, have none."""
    if 0 in shape:
        return {"maxshape": tuple(n or None for n in shape), "chunks": tuple(max(n, 1) for n in shape)}
    size = int(np.prod(shape))
    if not shape or size <= PACKED or not itemsize:
        return {}
    rows = max(1, CHUNK // (itemsize * size // shape[0]))
    chunks = (min(rows, shape[0]), *shape[1:])
    return {"chunks": chunks, "shuffle": True, "compression": "gzip", "compression_opts": LEVEL}
