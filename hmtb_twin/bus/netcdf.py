"""NetCDF4 files of logs and bus records: written whole or not at all, read strictly."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmtb_twin.parameters.errors import TwinError, system_reason

if TYPE_CHECKING:
    import xarray as xr


def write_netcdf(
    path: str | Path,
    kind: str,
    variables: Mapping[str, Any],
    coordinates: Mapping[str, Any],
    attributes: Mapping[str, Any],
) -> Path:
    """Write a data set under a temporary name, then rename it.

    Args:
        path: The file.
        kind: Kind of the file in messages, such as "log".
        variables: Dimensions, values and attributes by name.
        coordinates: Values by dimension.
        attributes: Attributes of the file.

    Returns:
        The path.

    Raises:
        TwinError: The file cannot be written.
    """
    import xarray as xr

    path = Path(path)
    if path.is_dir() or not path.parent.is_dir():
        raise TwinError(f"cannot write the {kind} {path}: it is a folder, or its folder does not exist")
    partial = path.with_name(path.name + ".partial")
    try:
        xr.Dataset(variables, coords=coordinates, attrs=attributes).to_netcdf(partial, engine="h5netcdf")
        partial.replace(path)
    except (OSError, ValueError, TypeError) as error:
        partial.unlink(missing_ok=True)
        reason = system_reason(error) if isinstance(error, OSError) else error
        raise TwinError(f"cannot write the {kind} {path}: {reason}") from error
    return path


def read_netcdf(path: str | Path, kind: str, version: str, required: Mapping[str, Any]) -> "xr.Dataset":
    """Read a data set into memory.

    Args:
        path: The file.
        kind: Kind of the file in messages, such as "joint log".
        version: Attribute `format` of the file.
        required: Variables that it must hold.

    Raises:
        TwinError: The file is missing, damaged, or of another kind.
    """
    import h5py
    import xarray as xr

    path = Path(path)
    if not path.is_file():
        raise TwinError(f"no file {path}: expected a {kind}, NetCDF4")
    try:
        with h5py.File(path) as file:
            # Damage shows here, where no file is left half open.
            _ = dict(file["/"].attrs)
        with warnings.catch_warnings():
            # xarray warns of foreign files before the error below names them.
            warnings.simplefilter("ignore")
            with xr.open_dataset(path, engine="h5netcdf") as stored:
                dataset = stored.load()
    except PermissionError as error:
        raise TwinError(f"cannot read {path}: {error.strerror}") from error
    except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
        raise TwinError(f"{path} is not a NetCDF4 file, or a damaged one") from error
    if str(dataset.attrs.get("format")) != version or any(name not in dataset for name in required):
        raise TwinError(
            f"{path} is no {kind}: expected format {version!r} with {', '.join(required)}; "
            f"found {', '.join(map(str, dataset)) or 'nothing'}"
        )
    return dataset
