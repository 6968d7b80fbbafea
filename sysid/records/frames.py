"""Records from pandas tables and xarray data sets."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sysid.records.data import IOData
from sysid.records.errors import SysidError
from sysid.records.importers import Choice, records_of

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
    import pandas
    import xarray

    if not isinstance(frame, pandas.DataFrame):
        raise SysidError(f"expected a pandas DataFrame, got {type(frame).__name__}")
    if not frame.columns.is_unique or frame.index.nlevels > 1:
        raise SysidError("expected columns of different names, and an index of time alone")
    index, of = frame.index, frame.attrs.get("columns", {})
    if isinstance(index, pandas.DatetimeIndex) and index.tz is not None:
        index = index.tz_convert(None)
    columns = {
        str(name): column.to_numpy(float, na_value=np.nan)
        if pandas.api.types.is_numeric_dtype(column) and not pandas.api.types.is_complex_dtype(column)
        else column
        for name, column in frame.items()
    }
    dataset = xarray.Dataset(
        {name: ("time", values, of.get(name, {})) for name, values in columns.items()},
        {} if isinstance(index, pandas.RangeIndex) else {"time": ("time", index.to_numpy(), of.get("time", {}))},
        frame.attrs,
    )
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
    import xarray

    if not isinstance(dataset, xarray.Dataset):
        raise SysidError(f"expected an xarray Dataset, got {type(dataset).__name__}")
    u, y = _chosen(dataset, "input", inputs), _chosen(dataset, "output", outputs)
    arrays = {str(name): one for name, one in dataset.items() if one.dtype.kind in "biufc" and one.ndim == 1}
    axes = {arrays[name].dims[0] for name in (*u, *y) if name in arrays}
    if len(axes) > 1:
        raise SysidError(f"expected variables over one dimension, time, got {', '.join(map(str, axes))}")
    time = str(next(iter(axes), ""))
    arrays |= {time: dataset[time]} if time in dataset.coords else {}
    attributes, units = dataset.attrs, {name: str(array.attrs.get("units", "")) for name, array in arrays.items()}
    choice = Choice(
        inputs=u,
        outputs=y,
        time=time if time in arrays else None,
        time_unit=None,
        dt=dt if dt is not None else attributes.get("dt"),
        missing=missing or bool(attributes.get("missing", False)),
    )
    columns = {name: array.to_numpy() for name, array in arrays.items()}
    (record,) = records_of(columns, choice, Path(attributes.get("name") or "table"), units=units)
    offsets = [[arrays[name].attrs["offset"] for name in names if "offset" in arrays[name].attrs] for names in (u, y)]
    return replace(
        record,
        input_offset=np.array(offsets[0]) if any(offsets) else None,
        output_offset=np.array(offsets[1]) if any(offsets) else None,
        start=record.start + (float(columns[time][0]) if units.get(time) == "s" else 0.0),
        name=attributes.get("name", ""),
        window=attributes.get("window", 0),
        intersample=attributes.get("intersample", "zoh"),
    )


def _chosen(dataset: "xarray.Dataset", role: str, names: Sequence[str] | None) -> tuple[str, ...]:
    if names is not None:
        return (names,) if isinstance(names, str) else tuple(names)
    chosen = tuple(str(name) for name, array in dataset.items() if array.attrs.get("role") == role)
    if not chosen and role == "output":
        raise SysidError(f"no column is marked as output: expected outputs=[...] of {', '.join(map(str, dataset))}")
    return chosen
