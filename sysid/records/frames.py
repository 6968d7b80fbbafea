"""Records from pandas tables and xarray data sets."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sysid.records.arguments import channel_names, truth_value
from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.importers import Choice, records_of
from sysid.records.optional import optional

if TYPE_CHECKING:
    import pandas
    import xarray


def from_dataframe(
    frame: "pandas.DataFrame",
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Make a record of columns of a table whose index is time.

    Args:
        frame: The table; its index in s, as time stamps or as differences of time, which may jitter as those of
            `read_csv`. An index that only counts rows needs `dt`.
        inputs: Names of the input columns; by default those of a table from `IOData.to_dataframe`.
        outputs: Names of the output columns, likewise.
        dt: Sampling interval in s; must agree with the index.
        missing: Whether NaN marks missing output samples.

    Returns:
        The record, with the units in `frame.attrs`.

    Raises:
        SysidError: Another type, and as `read_csv`.
    """
    with optional("files"):
        import pandas
        import xarray

    if not isinstance(frame, pandas.DataFrame):
        raise SysidError(f"expected a pandas DataFrame, got {type(frame).__name__}")
    if not frame.columns.is_unique or frame.index.nlevels > 1:
        raise SysidError("expected columns of different names, and an index of time alone")
    index, attributes = frame.index, frame.attrs.get("columns", {})
    if isinstance(index, pandas.DatetimeIndex) and index.tz is not None:
        index = index.tz_convert(None)
    variables: dict[str, Any] = {}
    for label, column in frame.items():
        name = str(label)
        values: Any = column
        if pandas.api.types.is_numeric_dtype(column) and not pandas.api.types.is_complex_dtype(column):
            # Nullable types of pandas have NA where others have NaN.
            values = column.to_numpy(float, na_value=np.nan)
        variables[name] = ("time", values, attributes.get(name, {}))
    coordinates = {}
    if not isinstance(index, pandas.RangeIndex):
        coordinates["time"] = ("time", index.to_numpy(), attributes.get("time", {}))
    dataset = xarray.Dataset(variables, coordinates, frame.attrs)
    return from_xarray(dataset, inputs=inputs, outputs=outputs, dt=dt, missing=missing)


def from_xarray(
    dataset: "xarray.Dataset",
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Make a record of variables of a data set over one dimension, time.

    Args:
        dataset: The data set; coordinate of time as in `from_dataframe`.
        inputs: Names of the input variables; by default those whose attribute `role` is "input".
        outputs: Names of the output variables, likewise.
        dt: Sampling interval in s; by default the attribute `dt` of the data set, or that of the coordinate.
        missing: Whether NaN marks missing output samples.

    Returns:
        The record, with the units in the variables' attributes `units`.

    Raises:
        SysidError: As `from_dataframe`, and variables of several dimensions.
    """
    with optional("files"):
        import xarray

    if not isinstance(dataset, xarray.Dataset):
        raise SysidError(f"expected an xarray Dataset, got {type(dataset).__name__}")
    missing = truth_value("missing", missing)
    u, y = _chosen(dataset, "input", inputs), _chosen(dataset, "output", outputs)
    arrays: dict[str, Any] = {}
    for name, array in dataset.items():
        if array.dtype.kind in "biufc" and array.ndim == 1:
            arrays[str(name)] = array
    channels = [arrays[name] for name in (*u, *y) if name in arrays]
    axes = {channel.dims[0] for channel in channels}
    if len(axes) > 1:
        raise SysidError(f"expected variables over one dimension, time, got {', '.join(map(str, axes))}")
    time = str(next(iter(axes), ""))
    if time in dataset.coords:
        arrays[time] = dataset[time]
    attributes = dataset.attrs
    units = {name: str(array.attrs.get("units", "")) for name, array in arrays.items()}
    time_name = time if time in arrays else None
    interval = dt if dt is not None else attributes.get("dt")
    choice = Choice(
        inputs=u,
        outputs=y,
        time=time_name,
        time_unit=None,
        dt=interval,
        missing=missing or bool(attributes.get("missing", False)),
    )
    columns = {name: array.to_numpy() for name, array in arrays.items()}
    (record,) = records_of(columns, choice, Path(attributes.get("name") or "table"), units=units)
    input_offset, output_offset = _offsets(arrays, u), _offsets(arrays, y)
    has_offsets = bool(input_offset or output_offset)
    # The importer counts times from the first sample.
    start = float(columns[time][0]) if units.get(time) == "s" else 0.0
    return replace(
        record,
        input_offset=np.array(input_offset) if has_offsets else None,
        output_offset=np.array(output_offset) if has_offsets else None,
        start=record.start + start,
        name=attributes.get("name", ""),
        window=attributes.get("window", 0),
        intersample=attributes.get("intersample", "zoh"),
    )


def _offsets(arrays: Mapping[str, Any], names: Sequence[str]) -> list[float]:
    """Operating points of channels, of those that have one."""
    attributes = [arrays[name].attrs for name in names]
    return [of_channel["offset"] for of_channel in attributes if "offset" in of_channel]


def _chosen(dataset: "xarray.Dataset", role: str, names: Sequence[str] | None) -> tuple[str, ...]:
    if names is not None:
        return tuple(channel_names(f"{role}s", names))
    chosen = tuple(str(name) for name, array in dataset.items() if array.attrs.get("role") == role)
    if not chosen and role == "output":
        raise SysidError(f"no column is marked as output: expected outputs=[...] of {', '.join(map(str, dataset))}")
    return chosen
