"""Numbers in MATLAB files of version 7.3, which are HDF5 files."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sysid.records.channels import listed
from sysid.records.errors import SysidError
from sysid.records.hdf5_files import check_size, items_of, opened

CLASSES = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
"""Classes of arrays, in the attribute `MATLAB_class`."""


def read_hdf5_variables(file: Path) -> dict[str, NDArray[np.generic]]:
    """Read the real numbers of arrays and of structs of arrays, as `log.u`; other kinds are left out.

    HDF5 stores rows first what MATLAB has columns first: arrays are transposed back.

    Raises:
        SysidError: A damaged file, one that MATLAB did not write, too many numbers, or nothing but objects.
    """
    with opened(file, "a damaged .mat file of version 7.3") as whole:
        arrays = list(_arrays(whole, "", {whole["/"]}))
        kept = {
            name: one
            for name, kind, one in arrays
            if kind in CLASSES
            and not {"MATLAB_empty", "MATLAB_object_decode"} & set(one.attrs)
            and one.dtype.names is None
        }
        check_size(file, kept.values())
        if arrays and not kept:
            others = [f"{name} ({kind or 'not of MATLAB'})" for name, kind, _ in arrays]
            raise SysidError(
                f"{file.name}: no arrays of numbers, but {listed(others)}; expected the arrays of such objects, as "
                "u = data.u; y = data.y; Ts = data.Ts; save('log.mat', 'u', 'y', 'Ts')"
            )
        return {name: np.asarray(one[()]).T for name, one in kept.items()}


def _arrays(group: Any, prefix: str, seen: set[Any]) -> Iterator[tuple[str, str, Any]]:
    """Yield name, class and data set of every variable and field; `#refs#` and `#subsystem#` belong to objects.

    Links can lead in circles: no group is entered twice.
    """
    import h5py

    for name, item in items_of(group):
        if isinstance(item, h5py.Group) and not name.startswith("#") and item not in seen:
            seen.add(item)
            if "MATLAB_sparse" not in item.attrs:
                yield from _arrays(item, f"{prefix}{name}.", seen)
        elif isinstance(item, h5py.Dataset):
            kind = item.attrs.get("MATLAB_class", b"")
            yield f"{prefix}{name}", kind.decode() if isinstance(kind, bytes) else str(kind), item
