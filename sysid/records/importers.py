"""Records from files: CSV, MATLAB, NumPy, NetCDF, logs of messages."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import channel_names, optional_text, real_number, shown
from sysid.records.arrays import FloatArray
from sysid.records.channels import default_names, listed
from sysid.records.data import IOData
from sysid.records.errors import Message, SysidError
from sysid.records.foreign_files import is_hdf5, numpy_contents
from sysid.records.mat_hdf5 import read_hdf5_variables
from sysid.records.mat_variables import read_variables
from sysid.records.message_logs import message_signals
from sysid.records.netcdf_columns import netcdf_columns
from sysid.records.reading_process import UnreadableError, read_apart
from sysid.records.text_columns import text_columns
from sysid.records.time_grid import Lost, Signal, experiments, period
from sysid.records.time_stamps import Column, Place, Stamps, interval_unit, is_counter, is_time, stamps, time_column

STATED = "dt as given"  # origin of an interval in messages: the argument
MOST_LOST = 0.05  # largest share of rows without input that count as lost: those that `period` takes for losses
SAME_INTERVAL = 1e-3  # two intervals closer than this part are one, written with few digits


@dataclass(frozen=True)
class Choice:
    """Columns and times to read, as in `read_csv`, and how to treat lost samples.

    Attributes:
        inputs: Names of the inputs.
        outputs: Names of the outputs.
        time: Name of the times; None concludes it.
        time_unit: Their unit.
        dt: Sampling interval, s.
        missing: Whether outputs may be missing in the file, and inputs of rows that then count as lost.
        cut: Whether gaps cut a record into experiments.
        lost: What becomes of single samples that were lost between stamps, as in `experiments`.
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    time: str | None
    time_unit: str | None
    dt: float | None
    missing: bool
    cut: bool = False
    lost: Lost = "cut"

    def __post_init__(self) -> None:
        for side in ("inputs", "outputs"):
            object.__setattr__(self, side, channel_names(side, getattr(self, side)))
        if not self.outputs:
            raise SysidError("no output named, expected one or more")
        if len(set(self.channels)) != len(self.channels):
            raise SysidError(f"expected different columns, got {listed(self.channels)}")
        optional_text("time", self.time)
        optional_text("time_unit", self.time_unit)
        if self.dt is not None:
            real_number("dt", self.dt, "be above 0 s", lambda dt: 0.0 < dt < np.inf)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of inputs, then outputs."""
        return (*self.inputs, *self.outputs)


def read_csv(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    time: str | None = None,
    time_unit: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from text: columns separated by commas, semicolons, tabs or spaces.

    The first line names the columns. A file without such a line has the columns `time`, if named, `inputs`, `outputs`;
    one column more is taken for times, the first, if its numbers rise evenly.
    Lines that begin with # or % are ignored. Empty cells and `nan` are missing samples.

    Times are numbers, or texts as `2026-01-31T12:00:00.5`, `31/1/2026 0:01`, `31.01.2026 00:01:00`, `31-Jan-2026 0:01`
    or `12:00:00.5`. Day and month are told apart by numbers above 12 or by the sequence, which must rise evenly;
    otherwise they are refused. Days in a column beside that of the clock are joined with it, and a clock without days
    goes on past midnight. Numbers have the unit of the name, as in `Time (ms)` or `stamp_ns`; stamps since 1970 in s,
    ms, µs or ns are known by their size; others are in s, but with `dt` those that count 0, 1, 2, ... count samples.

    Samples whose stamps jitter are put on a uniform grid, steps above 2.5 intervals are gaps; a `SysidWarning` says
    what was done. A single lost row is interpolated, or with `missing` a missing output; `read_experiments` cuts there
    if it can, since the input of a lost row is not known.

    Args:
        path: The file.
        inputs: Names of the input columns.
        outputs: Names of the output columns.
        time: Name of the column of times. None: `t`, `time`, `timestamp`, `Time (ms)`, `Zeit [ms]` ..., or the only
            other column that increases as steadily as a clock; with `dt`, one that does so by this interval.
        time_unit: Unit of the times: s, ms, us, ns, min, h or days.
        dt: Sampling interval, s. Required unless the file has times or a constant column `dt`; must agree with them
            otherwise, and samples whose stamps jitter are then taken for uniform ones, if none was lost.
        missing: Whether outputs may be missing: empty cells or `nan`. Rows without input then count as lost, up to
            5 %. Gaps of the times are refused all the same.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No file, no text, no such column, cells that are no numbers, no or contradicting sampling intervals,
            times that do not increase or are too irregular, gaps.
    """
    return _single(_from_text, path, "a text file", Choice(inputs, outputs, time, time_unit, dt, missing))


def read_mat(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    time: str | None = None,
    time_unit: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from a MATLAB file of any version.

    Args:
        path: The file.
        inputs: Names of the input variables, vectors, or matrices with time first. Version 7.3 also has the fields of
            structs, as `log.u`.
        outputs: Names of the output variables, likewise.
        time: As in `read_csv`, likewise the following.
        time_unit: Unit of the times.
        dt: Sampling interval, s; the file may hold it as a scalar `dt` or `Ts`.
        missing: Whether outputs may be missing.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No file, another format, no such variable, and as in `read_csv`.
    """
    return _single(_from_mat, path, "a .mat file", Choice(inputs, outputs, time, time_unit, dt, missing))


def read_npz(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    time: str | None = None,
    time_unit: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from the arrays of a NumPy archive, as `numpy.savez(path, u=u, y=y, dt=0.01)` writes it.

    Args:
        path: The file.
        inputs: Names of the input arrays (N,), or (N, k) with time first.
        outputs: Names of the output arrays, likewise.
        time: As in `read_csv`, likewise the following.
        time_unit: Unit of the times.
        dt: Sampling interval, s; the file may hold it as a scalar `dt` or `Ts`.
        missing: Whether outputs may be missing, as NaN.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No file, another format, no such array of numbers (arrays of Python objects are never read), and as
            in `read_csv`.
    """
    return _single(_from_npz, path, "an .npz file", Choice(inputs, outputs, time, time_unit, dt, missing))


def read_netcdf(
    path: str | Path,
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    time: str | None = None,
    time_unit: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from NetCDF4: variables over one dimension of time, of one column or several.

    Args:
        path: The file.
        inputs: Names of the input variables; their first dimension is time.
        outputs: Names of the output variables, likewise.
        time: As in `read_csv`, likewise the following.
        time_unit: Unit of the times; the attribute `units` holds it too, also as `milliseconds since 2026-01-31`.
        dt: Sampling interval, s; the file may hold it as an attribute or scalar `dt`.
        missing: Whether outputs may be missing.

    Returns:
        The record, named after the file; units from the attributes `units`.

    Raises:
        SysidError: No file, another format, no such variable, and as in `read_csv`.
    """
    return _single(_from_netcdf, path, "a NetCDF4 file", Choice(inputs, outputs, time, time_unit, dt, missing))


def read_log(
    path: str | Path,
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    time: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> IOData:
    """Read a record from a log of messages: MCAP (ROS messages or JSON), a rosbag2 folder, or a bag of ROS 1.

    Every topic has stamps of its own. They are put on the grid of the slowest output, or of `dt`: outputs are
    interpolated, inputs hold until their next message. Needs the packages mcap and rosbags, the extra `logs`.

    Joints are found by name in each message, whose order may change; numbers mean the order of the first message. Where
    several nodes publish a topic, `/joint_states@1.position[elbow]` chooses the first, and
    `/joint_states@elbow,wrist.position[elbow]` the one with these joints in this order; messages list them.

    Args:
        path: The file or folder.
        inputs: Fields of the inputs: topic, field and index or joint name, as `/cmd.data`, `/joint_states.position[3]`,
            `/joint_states.velocity[elbow]`. A field that is a vector is as many channels.
        outputs: Fields of the outputs, likewise.
        time: `header`: the stamps of the messages' headers; `log`: the times at which they were logged. None: headers
            if all topics have them.
        dt: Interval of the grid, s.
        missing: As in `read_csv`.

    Returns:
        The record, named after the file.

    Raises:
        SysidError: No log, no such topic or field, stamps that do not increase, no time in common, gaps, a
            package that is missing.
    """
    kind = "an MCAP file, a rosbag2 folder or a bag"
    return _single(_from_log, path, kind, Choice(inputs, outputs, time, None, dt, missing))


def read_experiments(
    paths: str | Path | Sequence[str | Path],
    *,
    inputs: Sequence[str] = ("u",),
    outputs: Sequence[str] = ("y",),
    time: str | None = None,
    time_unit: str | None = None,
    dt: float | None = None,
    missing: bool = False,
) -> tuple[IOData, ...]:
    """Read the experiments of several files, and those between the gaps of a log.

    Args:
        paths: One file or several; the endings .mat, .npz, .nc, .mcap and .bag name their formats, a folder is a
            rosbag2, others are text.
        inputs: As in `read_csv`, likewise the following.
        outputs: Names of the outputs.
        time: Name of the times.
        time_unit: Unit of the times.
        dt: Sampling interval, s.
        missing: Whether outputs may be missing: empty cells or NaN; rows without input then count as lost. Gaps of the
            stamps always cut a record, and lost rows a table if its parts are long.

    Returns:
        The records, of one interval.

    Raises:
        SysidError: As in `read_csv`; different intervals.
    """
    return experiments_of(paths, Choice(inputs, outputs, time, time_unit, dt, missing, cut=True))


def experiments_of(paths: str | Path | Sequence[str | Path], choice: Choice) -> tuple[IOData, ...]:
    """Do the work of `read_experiments`, for callers that choose more than it offers."""
    several = (paths,) if isinstance(paths, str | Path) else paths
    if not isinstance(several, Iterable):
        raise SysidError(f"expected the paths of data files, got {shown(paths)}")
    files = [_existing(path, "a data file or the folder of a rosbag2") for path in several]
    if not files:
        raise SysidError("expected the paths of data files, got none")
    records: list[IOData] = []
    for file in files:
        load = _from_log if file.is_dir() else _LOADERS.get(file.suffix.lower(), _from_text)
        try:
            records.extend(load(file, choice))
        except SysidError as error:
            if len(files) == 1 or "unknown column" not in str(error):
                raise
            hint = "; several files are experiments, each with all inputs and outputs: join signals of one experiment"
            raise SysidError(f"{error}{hint} in one table first, by time (pandas.merge_asof)") from error
    return one_interval(records)


def one_interval(parts: Sequence[IOData]) -> tuple[IOData, ...]:
    """Give experiments the interval of the first, from which those that were measured differ by little.

    Raises:
        SysidError: The intervals differ by more than 0.1 %.
    """
    first = parts[0]
    for record in parts:
        if abs(record.dt - first.dt) > SAME_INTERVAL * first.dt:
            raise SysidError(
                f"{record.name} is sampled every {record.dt:.6g} s, {first.name} every {first.dt:.6g} s; "
                "expected one interval (resample brings them to one)"
            )
    # Records of the very interval are passed on as they are: a copy of a long one takes time and memory.
    return tuple(record if record.dt == first.dt else replace(record, dt=first.dt) for record in parts)


def _single(load: Callable[[Path, Choice], tuple[IOData, ...]], path: str | Path, kind: str, choice: Choice) -> IOData:
    (record,) = load(_existing(path, kind), choice)
    return record


def _from_text(file: Path, choice: Choice) -> tuple[IOData, ...]:
    expected = (choice.time, *choice.channels) if choice.time else choice.channels
    columns, place = text_columns(file, expected)
    return records_of(columns, choice, file, place)


def _from_mat(file: Path, choice: Choice) -> tuple[IOData, ...]:
    variables = read_hdf5_variables(file) if is_hdf5(file) else read_variables(file)
    columns: dict[str, Column] = {}
    for name, values in variables.items():
        if values.dtype.kind in "biuf" and values.ndim == 2 and values.size:
            # A row vector can only be a signal; a matrix is taken time first, never transposed on a guess.
            columns[name] = values.reshape(-1, 1) if 1 in values.shape else values
    return records_of(columns, choice, file)


def _from_npz(file: Path, choice: Choice) -> tuple[IOData, ...]:
    try:
        arrays = read_apart(numpy_contents, file)
    except (UnreadableError, OSError) as error:
        raise SysidError(f"{file.name}: not an .npz file, which numpy.savez writes ({error})") from error
    columns: dict[str, Column] = {}
    for name, values in arrays.items():
        array = np.asarray(values)
        if array.size and array.ndim <= 2:
            # Scalars are intervals; a row vector can only be a signal, a matrix is never transposed on a guess.
            columns[name] = array.reshape(-1, 1) if array.ndim < 2 or 1 in array.shape else array
    return records_of(columns, choice, file)


def _from_netcdf(file: Path, choice: Choice) -> tuple[IOData, ...]:
    columns, units = netcdf_columns(file)
    return records_of(columns, choice, file, units=units)


def records_of(
    columns: Mapping[str, Column],
    choice: Choice,
    file: Path,
    place: Place = lambda sample: f"sample {sample}",
    units: Mapping[str, str] | None = None,
) -> tuple[IOData, ...]:
    """Make records of named columns (N,) or (N, k); a column that is no channel may hold times or the interval."""
    units = units or {}
    _check_channels(columns, choice, file)
    intervals = _intervals(columns, choice, file)
    stated = next(iter(intervals.values()), None)
    clock_name, concluded, remarks = time_column(columns, choice.time, choice.channels, stated=stated, file=file.name)
    clock = None
    if clock_name is not None:
        # NetCDF has units as `milliseconds since 2026-01-31`.
        attribute = units.get(clock_name, "").partition(" since ")[0].lower()
        unit = choice.time_unit or attribute or concluded or None
        clock = stamps(clock_name, columns[clock_name], unit, place, file.name)
        if unit is None and is_counter(clock_name, columns[clock_name]):
            clock, remarks_on_counter = _counted(clock_name, clock, stated, file)
            remarks = (*remarks, *remarks_on_counter)
        intervals[repr(clock_name)] = period(clock.seconds, f"column {clock_name!r}", file.name)
    # Only a column with the name of a time keeps its texts.
    first_cells = {name: str(values[0]) for name, values in columns.items() if _is_text(values)}
    unread = [f"column {name!r} holds {cell!r}, which is not read as a time" for name, cell in first_cells.items()]
    if not intervals:
        raise SysidError(_no_interval(columns, choice, file, unread))
    if clock is None:
        remarks = (*remarks, *(f"{remark}, so that gaps are not noticed" for remark in unread))
    interval = _agreed(intervals, file)
    count = len(columns[choice.channels[0]])
    if not np.isfinite(interval * count):
        raise SysidError(
            f"{file.name}: {count} samples every {interval:g} s last longer than any number; expected less"
        )
    if clock is None:
        clock = Stamps(interval * np.arange(count, dtype=np.float64), 0.0, ())
    if len(clock.seconds) != count:
        raise SysidError(f"{file.name}: {clock_name} has {len(clock.seconds)} samples, the channels have {count}")
    known, remark = _rows_with_inputs(columns, choice, file, place)
    signals: dict[str, Signal] = {}
    seconds = clock.seconds[known]
    for name in choice.channels:
        signals[name] = _signal(name, seconds, columns[name][known], units.get(name, ""))
    return experiments(
        [signals[name] for name in choice.inputs],
        [signals[name] for name in choice.outputs],
        interval,
        missing=choice.missing,
        cut=choice.cut,
        name=file.name,
        resolution=clock.resolution,
        # An interval that the user states is that of the samples, whose stamps then only jitter.
        nominal=len(intervals) > 1,
        remarks=(*remarks, *clock.remarks, *remark),
        lost=choice.lost,
    )


def _rows_with_inputs(
    columns: Mapping[str, Column], choice: Choice, file: Path, place: Place
) -> tuple[slice | NDArray[np.bool_], tuple[str, ...]]:
    """Rows (N,) whose inputs are all known, and a remark on the others, which count as lost.

    Raises:
        SysidError: Inputs are missing without `missing`, or so many that a column may be logged only when it changes.
    """
    unknown: dict[str, NDArray[np.bool_]] = {}
    for name in choice.inputs:
        values = columns[name]
        if values.dtype.kind == "f" and np.isnan(values).any():
            unknown[name] = np.asarray(np.isnan(values.reshape(len(values), -1)).any(axis=1))
    if not unknown:
        return slice(None), ()
    name, mask = max(unknown.items(), key=lambda item: int(item[1].sum()))
    where = f"{file.name}, {place(int(np.argmax(mask)))}"
    count = f"{int(mask.sum())} of {len(mask)} samples of input {name!r} are empty or NaN"
    if mask.mean() > MOST_LOST:
        raise SysidError(
            f"{where}: {count}; expected {MOST_LOST:.0%} at most. An input that is logged only when it changes must be "
            f"filled first, each empty cell with the value above it: pandas.DataFrame.ffill, MATLAB fillmissing"
        )
    if not choice.missing:
        advice = "; missing=True takes these rows for lost ones"
        message = (
            f"{where}: {count}; expected all inputs{advice}; where the input is logged only when it changes, "
            "fill each empty cell with the value above it"
        )
        raise SysidError(Message(message, "lost-inputs", missing=advice))
    rows = ~np.any([*unknown.values()], axis=0)
    return rows, (f"{int((~rows).sum())} rows without input count as lost",)


def _counted(name: str, clock: Stamps, stated: float | None, file: Path) -> tuple[Stamps, tuple[str, ...]]:
    """Stamps of a column that counts 0, 1, 2, ..., times the stated interval in s, and a remark where they differ.

    Raises:
        SysidError: No interval, and the name is not that of a time.
    """
    if stated is not None:
        remark = f"column {name!r} counts samples; each is the stated {stated:g} s"
        remarks = () if stated == 1.0 else (remark,)
        return clock._replace(seconds=clock.seconds * stated, resolution=clock.resolution * stated), remarks
    if not is_time(name):
        message = f"{file.name}: column {name!r} counts samples, 0, 1, 2, ...; expected their interval, dt in s"
        raise SysidError(Message(message, "counter", dt="dt in s"))
    remark = f"column {name!r} counts 0, 1, 2, ... and is taken for seconds (if it counts samples, state dt)"
    return clock, (remark,)


def _check_channels(columns: Mapping[str, Column], choice: Choice, file: Path) -> None:
    """Refuse names that are no columns, and columns of several lengths."""
    for name in choice.channels:
        if name in columns:
            continue
        near = get_close_matches(name, columns, 1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        present = ", ".join(columns) or "none of numbers"
        message = f"{file.name}: unknown column {name!r}{hint}; there are {present}"
        if file.suffix == ".mat":
            message += " (structs, tables and objects such as iddata are not read; save their arrays)"
        if file.suffix == ".npz":
            message += " (arrays of Python objects are not read; save numbers)"
        raise SysidError(message)
    lengths = {name: len(columns[name]) for name in choice.channels}
    if len(set(lengths.values())) > 1:
        sizes = [f"{name} has {length} samples" for name, length in lengths.items()]
        raise SysidError(f"{file.name}: {', '.join(sizes)}; time is first")


def _no_interval(columns: Mapping[str, Column], choice: Choice, file: Path, unread: Sequence[str]) -> Message:
    """What a file without times needs; `unread` are remarks on columns of texts that look like times."""
    if (samples := len(columns[choice.channels[0]])) < 2:
        return Message(f"{file.name}: {samples} sample, which tells no sampling interval; expected two or more")
    others = [name for name in columns if name not in choice.channels]
    present = listed(others) or "no other column"
    message = (
        f"{file.name}: no sampling interval; expected a column of times (t, time, 'Time (s)', time=NAME), "
        f"a variable dt or Ts, or dt in s; the file has {present}"
    )
    message += "".join(f"; {remark}: write numbers, as ms, or 2026-01-31T12:00:00.5" for remark in unread)
    if counters := [name for name in others if is_counter(name, columns[name])]:
        message += f"; {listed(counters)} counts samples, of which dt is the interval"
    return Message(message, "no-interval", time="time=NAME", dt="or dt in s")


def _agreed(intervals: Mapping[str, float], file: Path) -> float:
    """The first of the intervals that a file and its reader state, s; the others must agree with it."""
    (first, interval), *further = intervals.items()
    for source, value in further:
        if abs(value - interval) > SAME_INTERVAL * interval:
            message = (
                f"{file.name}: sampling interval {interval:.6g} s by {first}, {value:.6g} s by {source}; "
                "expected one value (omit the wrong one)"
            )
            raise SysidError(Message(message, "several-intervals", dt=STATED))
    return interval


def _signal(name: str, times: FloatArray, values: Column, unit: str) -> Signal:
    if values.dtype.kind == "c":
        raise SysidError(f"{name}: expected real numbers, got complex ones")
    if not values.size:
        raise SysidError(f"{name} has shape {values.shape}; expected at least 2 samples")
    table = values.astype(np.float64).reshape(len(values), -1)
    width = table.shape[1]
    names = (name,) if width == 1 else default_names(name, width)
    return Signal(times, table, names, (unit,) * len(names))


def _intervals(columns: Mapping[str, Column], choice: Choice, file: Path) -> dict[str, float]:
    """Sampling intervals in s that are stated: by the user, and by constant columns `dt` or `Ts`."""
    intervals = {} if choice.dt is None else {STATED: choice.dt}
    for name, values in columns.items():
        scale = None if name in (*choice.channels, choice.time) else interval_unit(name)
        if scale is None or _is_text(values) or (is_time(name) and np.ptp(values) > 0):
            continue
        if not values.size:
            raise SysidError(f"{file.name}: {name!r} is empty; expected one sampling interval above 0 s")
        low, high = float(values.min()), float(values.max())
        if not 0.0 < low == high < np.inf:
            present = f"{low:g}" if values.size == 1 else f"{low:g} to {high:g}"
            raise SysidError(f"{file.name}: {name!r} is {present}; expected one sampling interval above 0 s")
        intervals[repr(name)] = low * scale
    return intervals


def _is_text(values: Column) -> bool:
    return values.dtype.kind == "U"


def _existing(path: str | Path, expected: str) -> Path:
    """Check that a path is an ordinary file, or a folder of such where a folder is expected."""
    if not isinstance(path, str | Path):
        raise SysidError(f"expected the path of {expected}, got {shown(path)}")
    file = Path(path)
    # Reading a pipe may never end.
    if not (file.is_file() or (file.is_dir() and "folder" in expected)):
        raise SysidError(f"no data file {str(path)!r}; expected {expected}")
    inside = file.rglob("*") if file.is_dir() else ()
    if any(not (item.is_file() or item.is_dir()) for item in inside):
        raise SysidError(f"{str(path)!r} holds a pipe, a device or a broken link; expected files")
    return file


def _from_log(file: Path, choice: Choice) -> tuple[IOData, ...]:
    if choice.time_unit is not None:
        raise SysidError(f"{file.name}: time_unit={shown(choice.time_unit)}, but stamps of messages are in ns")
    u, y, remark = message_signals(file, choice.inputs, choice.outputs, choice.time)
    return experiments(
        u,
        y,
        choice.dt,
        missing=choice.missing,
        cut=choice.cut,
        name=file.name,
        remarks=(remark,),
        lost=choice.lost,
    )


_LOADERS = {
    ".mat": _from_mat,
    ".npz": _from_npz,
    ".nc": _from_netcdf,
    ".mcap": _from_log,
    ".bag": _from_log,
    ".db3": _from_log,
}
