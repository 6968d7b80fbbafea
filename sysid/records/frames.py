"""Records from pandas tables and xarray data sets."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import sampling_interval
from sysid.records.data import IOData
from sysid.records.errors import SysidError

if TYPE_CHECKING:
    import pandas
    import xarray

UNIFORM = 0.01  # difference of single steps of time, relative to the median, that counts as rounding of stamps
SAME_INTERVAL = 1e-3  # two intervals closer than this part are one, written with few digits


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
        frame: The table; its index in s, as time stamps or as differences of time. An index that only counts rows needs
            `dt`.
        inputs: Names of the input columns; by default those of a table from `IOData.to_dataframe`.
        outputs: Names of the output columns, likewise.
        dt: Sampling interval in s; must agree with the index.
        missing: Whether NaN marks missing output samples.

    Returns:
        The record, with the units in `frame.attrs`.

    Raises:
        SysidError: Another type, no such column, no sampling interval or contradicting ones, times that are not
            uniform, and as `IOData`.
    """
    import pandas
    import xarray

    if not isinstance(frame, pandas.DataFrame):
        raise SysidError(f"expected a pandas DataFrame, got {type(frame).__name__}")
    if not frame.columns.is_unique or frame.index.nlevels > 1:
        raise SysidError("expected columns of different names, and an index of time alone")
    columns, index = [frame.iloc[:, k] for k in range(frame.shape[1])], frame.index
    if isinstance(index, pandas.DatetimeIndex) and index.tz is not None:
        index = index.tz_convert(None)
    of = frame.attrs.get("columns", {})
    dataset = xarray.Dataset(
        {
            str(one.name): (
                "time",
                one.to_numpy(float, na_value=np.nan) if pandas.api.types.is_numeric_dtype(one) else one.to_numpy(),
                of.get(one.name, {}),
            )
            for one in columns
        },
        {} if isinstance(index, pandas.RangeIndex) else {"time": index.to_numpy()},
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
    names = [_chosen(dataset, *pair) for pair in (("input", inputs), ("output", outputs))]
    channels = [[dataset[name] for name in part] for part in names]
    dimensions = {channel.dims for part in channels for channel in part}
    if len(dimensions) != 1 or len(axes := dimensions.pop()) != 1:
        raise SysidError("expected variables over one dimension, time, the same for all")
    times = dataset[axes[0]].values if axes[0] in dataset.coords else None
    start, step = _uniform(times, dt if dt is not None else dataset.attrs.get("dt"))
    u, y = (np.column_stack([channel.values for channel in part]) if part else None for part in channels)
    units = [tuple(str(channel.attrs.get("units", "")) for channel in part) for part in channels]
    offsets = [[channel.attrs["offset"] for channel in part if "offset" in channel.attrs] for part in channels]
    return IOData(
        u,  # type: ignore[arg-type]
        y,  # type: ignore[arg-type]
        step,
        input_names=names[0],
        output_names=names[1],
        input_units=units[0],
        output_units=units[1],
        intersample=dataset.attrs.get("intersample", "zoh"),
        window=dataset.attrs.get("window", 0),
        name=dataset.attrs.get("name", ""),
        start=start,
        missing=missing or bool(dataset.attrs.get("missing", False)),
        input_offset=np.array(offsets[0]) if any(offsets) else None,
        output_offset=np.array(offsets[1]) if any(offsets) else None,
    )


def _chosen(dataset: "xarray.Dataset", role: str, names: Sequence[str] | None) -> tuple[str, ...]:
    if names is None:
        chosen = tuple(str(name) for name, array in dataset.items() if array.attrs.get("role") == role)
        if not chosen and role == "output":
            raise SysidError(f"no column is marked as output: expected outputs=[...] of {', '.join(map(str, dataset))}")
        return chosen
    chosen = (names,) if isinstance(names, str) else tuple(names)
    if unknown := [name for name in chosen if name not in dataset]:
        raise SysidError(f"no column {unknown[0]!r}; there are {', '.join(map(str, dataset))}")
    return chosen


def _uniform(times: NDArray[Any] | None, dt: float | None) -> tuple[float, float]:
    """First instant and interval in s of uniform times."""
    if times is None or len(times) < 2:
        if dt is None:
            raise SysidError("no sampling interval: expected an index or coordinate of time, or dt in s")
        return 0.0, sampling_interval(dt)
    if times.dtype.kind not in "iufmM":
        raise SysidError(f"expected times in s, stamps or differences of time, got {times.dtype} such as {times[0]!r}")
    if times.dtype.kind == "M":
        times = times - times[0]
    seconds = times / np.timedelta64(1, "s") if times.dtype.kind == "m" else times.astype(float)
    steps = np.diff(seconds)
    middle, step = float(np.median(steps)), float((seconds[-1] - seconds[0]) / (len(seconds) - 1))
    if not (middle > 0.0 and np.abs(steps - middle).max() <= UNIFORM * middle):
        raise SysidError(f"times are not uniform: steps from {steps.min():.6g} to {steps.max():.6g} s; resample first")
    if dt is not None and not abs(dt - step) <= SAME_INTERVAL * step:
        raise SysidError(f"sampling interval {step:.6g} s by the times, {dt:.6g} s by dt: expected one value")
    return float(seconds[0]), step if dt is None else sampling_interval(dt)
