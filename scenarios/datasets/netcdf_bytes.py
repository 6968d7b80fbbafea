"""The bytes of a NetCDF4 file, written straight through HDF5: what a file costs is felt where there are thousands.

A NetCDF4 file is an HDF5 file in which every dimension is a dimension scale, the variable of its name if there is one,
and every variable names its scales. The file is made in memory; its bytes depend on what it holds
and on the version of HDF5 alone.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5f, h5p, h5s, h5t

Attribute = str | int | float | np.ndarray
"""What an attribute may be."""

PACKED = 64
"""Arrays of more numbers are compressed."""

LEVEL = 2
"""Of the compression: the noise in the low bits is what costs, and no level packs it."""

CHUNK = 1 << 20
"""Bytes of an array that are compressed at a time, at most: most records are read whole."""

TEXT = h5py.string_dtype()
"""Texts of any length, UTF-8."""

IN_FILE, IN_MEMORY = h5t.py_create(TEXT, logical=True), h5t.py_create(TEXT)
"""How HDF5 has them in a file, and in an array of Python's own."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable."
"""Beginning of the name that NetCDF4 gives a dimension scale without a variable."""


class Array(Protocol):
    """A variable: names of its dimensions, numbers or texts, attributes."""

    @property
    def dims(self) -> Sequence[str]:
        """Names of its dimensions."""

    @property
    def values(self) -> np.ndarray:
        """Numbers, or texts."""

    @property
    def attributes(self) -> Mapping[str, Attribute]:
        """Unit, meaning, role."""


def netcdf_bytes(
    sizes: Mapping[str, int], variables: Mapping[str, Array], attributes: Mapping[str, Attribute]
) -> bytes:
    """Make a file.

    Args:
        sizes: Of all dimensions, by name; one of size 0 is unlimited, as NetCDF has it.
        variables: By name, real or whole numbers or texts; one named like a dimension has that dimension alone.
        attributes: Of the whole.
    """
    creation = h5p.create(h5p.FILE_CREATE)
    _bare(creation)
    creation.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fapl_core(CHUNK, False)
    access.set_libver_bounds(h5f.LIBVER_V18, h5f.LIBVER_V18)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    file = h5f.create(b"in memory", h5f.ACC_TRUNC, creation, access)
    try:
        made_by = f"version=2,h5py={h5py.__version__},hdf5={h5py.version.hdf5_version}"
        _attribute(file, "_NCProperties", np.array(made_by.encode()))
        for name, value in attributes.items():
            _attribute(file, name, value)
        scales = {
            name: _scale(file, name, size, number, variables) for number, (name, size) in enumerate(sizes.items())
        }
        for name, variable in variables.items():
            stored = scales[name] if name in scales else _dataset(file, name, variable)
            if name not in scales:
                for axis, dim in enumerate(variable.dims):
                    h5ds.attach_scale(stored, scales[dim], axis)
            for key, value in variable.attributes.items():
                _attribute(stored, key, value)
        h5f.flush(file)
        return bytes(file.get_file_image())
    finally:
        file.close()


def _scale(file: h5f.FileID, name: str, size: int, number: int, variables: Mapping[str, Array]) -> h5d.DatasetID:
    """A dimension, as its variable or as an empty array."""
    if name in variables:
        stored = _dataset(file, name, variables[name])
        h5ds.set_scale(stored, name.encode())
    else:
        properties = _properties((size,), 4)
        space = h5s.create_simple((size,), (size or h5s.UNLIMITED,))
        stored = h5d.create(file, name.encode(), h5t.IEEE_F32BE, space, properties)
        h5ds.set_scale(stored, f"{NO_VARIABLE}{size:10}".encode())
    _attribute(stored, "_Netcdf4Dimid", np.array(number, np.int32))
    return stored


def _dataset(file: h5f.FileID, name: str, variable: Array) -> h5d.DatasetID:
    text = variable.values.dtype.kind == "U"
    values = variable.values.astype(TEXT) if text else np.asarray(variable.values, order="C")
    shape = values.shape
    space = h5s.create_simple(shape, tuple(n or h5s.UNLIMITED for n in shape)) if shape else h5s.create(h5s.SCALAR)
    properties = _properties(shape, 0 if text else values.itemsize)
    stored = h5d.create(file, name.encode(), IN_FILE if text else h5t.py_create(values.dtype), space, properties)
    if values.size:
        stored.write(h5s.ALL, h5s.ALL, values, mtype=IN_MEMORY if text else None)
    return stored


def _properties(shape: Sequence[int], itemsize: int) -> h5p.PropDCID:
    properties = h5p.create(h5p.DATASET_CREATE)
    _bare(properties)
    size = int(np.prod(shape))
    if shape and 0 in shape:
        properties.set_chunk(tuple(max(n, 1) for n in shape))
    elif size > PACKED and itemsize:
        rows = max(1, CHUNK // (itemsize * size // shape[0]))
        properties.set_chunk((min(rows, shape[0]), *shape[1:]))
        properties.set_shuffle()
        properties.set_deflate(LEVEL)
    return properties


def _bare(properties: h5p.PropOCID) -> None:
    """Attributes in the order in which they are made, and no times."""
    properties.set_obj_track_times(False)
    properties.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)


def _attribute(place: "h5f.FileID | h5d.DatasetID", name: str, value: Attribute) -> None:
    if isinstance(value, str):
        space = h5s.create(h5s.SCALAR)
        h5a.create(place, name.encode(), IN_FILE, space).write(np.array(value, dtype=TEXT), mtype=IN_MEMORY)
        return
    array = np.asarray(value)
    array = array if array.ndim or array.dtype.kind == "S" else array.reshape(1)
    space = h5s.create_simple(array.shape) if array.ndim else h5s.create(h5s.SCALAR)
    h5a.create(place, name.encode(), h5t.py_create(array.dtype), space).write(array)
