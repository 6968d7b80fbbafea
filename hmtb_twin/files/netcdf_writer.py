"""NetCDF4 files whose bytes depend on their content alone.

They are written through h5py's calls of HDF5. h5netcdf (tried: 1.8.2) writes its own version into the attribute
`_NCProperties` of every file and leaves the format of the objects to HDF5: hashes of data sets would change with
its releases. h5py's high-level interface gave other bytes in one of five builds by workers of a cluster, at the same
contents; calls of HDF5 itself never did.
"""

from collections.abc import Mapping, Sequence

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5f, h5p, h5s, h5t

from hmtb_twin.files.errors import TwinError
from hmtb_twin.files.netcdf_variable import NO_VARIABLE, Attribute, Variable

PACKED = 64
"""Arrays of more numbers are compressed."""

LEVEL = 2
"""Level of the compression; higher ones gain nothing, because noise in the low bits cannot be packed."""

CHUNK = 1 << 20
"""Bytes of an array that are compressed at a time, at most: most records are read whole."""

TEXT = h5py.string_dtype()
"""Texts of any length, UTF-8."""

IN_FILE, IN_MEMORY = h5t.py_create(TEXT, logical=True), h5t.py_create(TEXT)
"""How HDF5 has them in a file, and in an array of Python's own."""


def netcdf_bytes(
    sizes: Mapping[str, int], variables: Mapping[str, Variable], attributes: Mapping[str, Attribute]
) -> bytes:
    """Return the bytes of a NetCDF-4 file; a dimension of size 0 is unlimited."""
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
        scales: dict[str, h5d.DatasetID] = {}
        for identifier, (name, size) in enumerate(sizes.items()):
            if name in variables:
                scale = _dataset(file, name, variables[name])
                h5ds.set_scale(scale, name.encode())
            else:
                space = h5s.create_simple((size,), (size or h5s.UNLIMITED,))
                scale = h5d.create(file, name.encode(), h5t.IEEE_F32BE, space, _properties((size,), 4))
                h5ds.set_scale(scale, f"{NO_VARIABLE}.{size:10}".encode())
            _attribute(scale, "_Netcdf4Dimid", np.array(identifier, np.int32))
            scales[name] = scale
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


def _dataset(file: h5f.FileID, name: str, variable: Variable) -> h5d.DatasetID:
    shape = variable.values.shape
    if shape:
        space = h5s.create_simple(shape, tuple(size or h5s.UNLIMITED for size in shape))
    else:
        space = h5s.create(h5s.SCALAR)
    if variable.values.dtype.kind == "U":
        values, stored_type, memory_type = variable.values.astype(TEXT), IN_FILE, IN_MEMORY
        # HDF5 keeps texts of any length in a heap, outside the array: nothing is left to compress.
        itemsize = 0
    else:
        values = np.asarray(variable.values, order="C")
        stored_type, memory_type = h5t.py_create(values.dtype), None
        itemsize = values.itemsize
    stored = h5d.create(file, name.encode(), stored_type, space, _properties(shape, itemsize))
    if values.size:
        stored.write(h5s.ALL, h5s.ALL, values, mtype=memory_type)
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
    """Keep attributes in order of creation, and no times."""
    properties.set_obj_track_times(False)
    properties.set_attr_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)


def _attribute(place: "h5f.FileID | h5d.DatasetID", name: str, value: Attribute) -> None:
    if isinstance(value, str):
        space = h5s.create(h5s.SCALAR)
        h5a.create(place, name.encode(), IN_FILE, space).write(np.array(value, dtype=TEXT), mtype=IN_MEMORY)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "iufS":
        raise TwinError(f"attribute {name} = {value!r}, expected text or numbers of at most 64 bits")
    array = array if array.ndim or array.dtype.kind == "S" else array.reshape(1)
    space = h5s.create_simple(array.shape) if array.ndim else h5s.create(h5s.SCALAR)
    h5a.create(place, name.encode(), h5t.py_create(array.dtype), space).write(array)
