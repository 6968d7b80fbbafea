"""Stamps of samples: which column holds them, in which unit, and the seconds that they mean."""

import re
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.records.arguments import shown
from sysid.records.arrays import FloatArray
from sysid.records.channels import listed
from sysid.records.errors import Message, SysidError

TIME_NAMES = ("t", "time", "ts", "timestamp", "stamp", "datetime", "date", "epoch", "unix", "utc", "elapsed", "clock")
TRANSLATED = ("zeit", "zeitstempel", "uhrzeit", "datum", "temps", "heure", "tiempo", "fecha", "hora")
INTERVAL_NAMES = ("ts", "dt")
SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
    **dict.fromkeys(("h", "hour", "hours"), 3600.0),
    **dict.fromkeys(("d", "day", "days"), 86400.0),
}
"""Units of time, s."""

SPELLED_UNITS = tuple(unit for unit in SECONDS if len(unit) > 4)
"""Units that are a name of a clock by themselves."""

EPOCH = (9.4e8, 4.2e9)
"""Seconds since 1970 of the years 1999 to 2103: unnamed units of larger stamps follow from their size."""

SPREADSHEET_DAYS = (36526.0, 73051.0)
"""Days since 1900 of the years 2000 to 2099, as spreadsheets count them."""

ROUNDING = 1e-6  # of a mean step, relative to itself

ROUNDED = 1e-2  # largest remainder of a multiple of the resolution: float64 rounds stamps of 1.7e9 s to 2.4e-7 s
MOST_DIGITS = 4  # most digits of the smallest step; a finer resolution is not the reason why steps differ

STEADY = 0.5
"""Part of their median by which the steps of a column without a name of time may deviate and still be a clock's."""

DAY = 86400.0  # s
LARGEST_STEP = 2.5  # medians, up to which a step of a clock past midnight is one of its steps: a gap is longer

MATCHING = 1e-2  # part of a stated interval by which the median step of a clock without a name of time may differ

Column = NDArray[Any]
Place = Callable[[int], str]  # where a sample stands in its file, for messages: "line 7"


class Stamps(NamedTuple):
    """Times of the samples of a table.

    Attributes:
        seconds: Time since the first sample (N,), s.
        resolution: Power of ten that all times are multiples of, s; 0 if there is none.
        remarks: How the unit was concluded, where no name says it.
    """

    seconds: FloatArray
    resolution: float
    remarks: tuple[str, ...]


def time_column(
    columns: Mapping[str, Column], time: str | None, channels: Collection[str], *, stated: float | None, file: str
) -> tuple[str | None, str, tuple[str, ...]]:
    """Name of the column of times, its unit where the steps tell it, and a remark where no name says it.

    It is `time`, if known, and none of the channels. Where no column has the name of a time, it is the only one that
    increases as steadily as a clock, or, with a `stated` interval in s, the first one that does so by this interval.

    Raises:
        SysidError: No such column, or a choice between several clocks.
    """
    if time is not None:
        if time not in columns or time in channels:
            raise SysidError(f"{file}: no column of times {time!r}; there are {listed([*columns])}")
        return time, "", ()
    candidates: dict[str, Column] = {}
    for name, values in columns.items():
        if name not in channels and values.size > 1 and values.dtype.kind != "U":
            candidates[name] = values
    named = [name for name, values in candidates.items() if is_time(name) and not _constant(values)]
    if named:
        return named[0], "", ()
    clocks = [name for name, values in candidates.items() if is_clock(values) and not _constant(values)]
    if stated is not None:
        # Of a .mat file only vectors as long as the channels tell of their samples.
        samples = max(len(columns[channel]) for channel in channels)
        clocks = [name for name in clocks if len(columns[name]) == samples]
        for name in clocks:
            if unit := _unit_of_steps(name, columns[name], stated):
                return name, unit, (f"times are column {name!r}, in {unit}: it increases by the stated interval",)
        remark = f"{listed(clocks)} increases as steadily as times and is not used (if it holds them: time=NAME)"
        return None, "", (remark,) if clocks else ()
    if len(clocks) > 1:
        text = f"{file}: several columns may be times: {listed(clocks)}; expected one, named by time=NAME"
        raise SysidError(Message(text, "several-times", time="time=NAME"))
    if clocks:
        return clocks[0], "", (f"times are column {clocks[0]!r}, the only one that increases steadily",)
    return None, "", ()


def stamps(name: str, values: Column, unit: str | None, place: Place, file: str) -> Stamps:
    """Seconds since the first sample of a column of times (N,); differences of whole numbers are exact.

    The unit of numbers is `unit`, or that in the name, as `Time (ms)`, else by the size of stamps since 1970, else s.

    Raises:
        SysidError: An unknown unit, times that are no numbers or do not increase.
    """
    values = values.ravel()
    texts, is_text_clock = values, values.dtype.kind == "m"
    if values.dtype.kind in "mM":
        nanoseconds = "datetime64[ns]" if values.dtype.kind == "M" else "m8[ns]"
        values, unit = values.astype(nanoseconds).view(np.int64), "ns"
    elif values.dtype.kind not in "iuf":
        raise SysidError(f"{file}: column {name!r} holds no times; expected numbers or times as 2026-01-31T12:00:00.5")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        raise SysidError(f"{file}, {place(int(np.argmin(np.isfinite(values))))}: no time in column {name!r}")
    if len(values) < 2:
        raise SysidError(f"{file}: {len(values)} time(s) in column {name!r}, expected at least 2")
    unit = unit or _name_and_unit(name)[1]
    if unit and unit not in SECONDS:
        raise SysidError(
            f"{file}: times of column {name!r} are in {shown(unit)}; expected s, ms, us, ns, min, h or days"
        )
    remarks: tuple[str, ...] = ()
    if not unit:
        unit = _epoch_unit(float(values[0]))
        if unit:
            remarks = (f"times in column {name!r} are taken for {unit} since 1970, by their size",)
        elif _counts_days(values):
            unit = "days"
            remarks = (
                f"times in column {name!r} are taken for days since 1900, as spreadsheets have them: in days their "
                "steps are round numbers of seconds; --time-unit s (time_unit='s') takes them for seconds",
            )
        else:
            unit = "s"
    values, midnights = _past_midnight(values, unit, has_half_days=is_text_clock)
    if midnights:
        remarks = (*remarks, f"the clock in column {name!r} passes midnight or noon {midnights} time(s) and goes on")
    # Unsigned numbers would turn a step back into a large one.
    back = np.flatnonzero(values[1:] <= values[:-1])
    if back.size:
        k = int(back[0]) + 1
        advice = "; a clock that passes midnight within a gap needs a date" if is_text_clock else ""
        raise SysidError(
            f"{file}, {place(k)}: time {_shown(texts[k])} in column {name!r} is not after {_shown(texts[k - 1])} in "
            f"{place(k - 1)} "
            f"({back.size} such steps); expected increasing times{advice}"
        )
    # The difference first: float64 rounds nanoseconds since 1970 to hundreds of them.
    elapsed: FloatArray = (values - values[0]).astype(np.float64)
    return Stamps(np.asarray(elapsed * SECONDS[unit]), _resolution(elapsed) * SECONDS[unit], remarks)


def _shown(stamp: Any) -> str:
    """A stamp as people write it."""
    if isinstance(stamp, np.datetime64):
        return f"{np.datetime_as_string(stamp.astype('datetime64[ms]'))}"
    if isinstance(stamp, np.timedelta64):
        milliseconds = int(stamp.astype("m8[ms]").astype(np.int64))
        minutes, rest = divmod(milliseconds, 60_000)
        return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest / 1000:06.3f}"
    return str(stamp)


def _past_midnight(values: Column, unit: str, *, has_half_days: bool) -> tuple[Column, int]:
    """Times (N,) of a clock without a date, which starts again after a day, or half a day; and how often it does.

    It is continued only where its steps stay even: other steps back are errors of the file.
    """
    back = np.flatnonzero(values[1:] < values[:-1]) + 1
    if not back.size or len(values) < 4:
        return values, 0
    # Steps of unsigned numbers would never be negative.
    signed = values.astype(np.int64) if values.dtype.kind in "iu" else values
    steps = np.diff(signed)
    middle = np.median(steps)
    days = (DAY, DAY / 2) if has_half_days else (DAY,)
    for day in days:
        # Times of texts are whole nanoseconds, whose sums must stay exact.
        span = signed.dtype.type(round(day / SECONDS[unit]))
        continued = steps[back - 1] + span
        if (continued > 0).all() and (continued <= LARGEST_STEP * middle).all():
            passed = np.zeros(len(signed), dtype=signed.dtype)
            passed[back] = span
            return signed + np.cumsum(passed), back.size
    return values, 0


def is_counter(name: str, values: Column) -> bool:
    """Whether a column without a unit in its name counts 0, 1, 2, ..., a few lost samples apart."""
    if values.dtype.kind not in "iuf" or values.ravel().shape != (len(values),) or len(values) < 3:
        return False
    numbers = values.ravel().astype(np.float64)
    if not np.isfinite(numbers).all() or _name_and_unit(name)[1] or _epoch_unit(float(numbers[0])):
        return False
    steps = np.diff(numbers)
    return bool(np.median(steps) == 1.0 and (steps >= 1.0).all() and (numbers == np.rint(numbers)).all())


def _epoch_unit(stamp: float) -> str:
    """Unit in which a stamp since 1970 lies in the years of `EPOCH`; empty if there is none."""
    for unit in ("s", "ms", "us", "ns"):
        if EPOCH[0] <= stamp * SECONDS[unit] <= EPOCH[1]:
            return unit
    return ""


def _counts_days(values: Column) -> bool:
    """Whether numbers are days of a spreadsheet: of their size, and with steps that are round in s but not in days."""
    if values.dtype.kind != "f" or not SPREADSHEET_DAYS[0] <= float(values[0]) <= SPREADSHEET_DAYS[1]:
        return False
    elapsed = (values - values[0]).astype(np.float64)
    steps = np.diff(elapsed)
    if len(steps) < 2 or not (steps > 0.0).all():
        return False
    # of rounded or jittering stamps the mean step is known far better than any one
    mean = float(elapsed[-1]) / len(steps)
    error = float(np.abs(steps - mean).max()) / len(steps)
    return _is_round(mean * DAY, error * DAY) and not _is_round(mean, error)


def _is_round(value: float, error: float) -> bool:
    """Whether a positive number may be one of two significant digits, given its error."""
    nearest = float(f"{value:.1e}")
    return abs(value - nearest) <= error + ROUNDING * value


def is_time(name: str) -> bool:
    """Whether a column has the name of a time."""
    return _name_and_unit(name)[0] in (*TIME_NAMES, *TRANSLATED)


def interval_unit(name: str) -> float | None:
    """Unit in s of a constant column of the sampling interval; None for other columns."""
    key, unit = _name_and_unit(name)
    return SECONDS.get(unit or "s") if key in INTERVAL_NAMES else None


def _name_and_unit(name: str) -> tuple[str, str]:
    """Split `Time (s)`, `t[ms]`, `time_s`, `log.time / s` or `%time` into name and unit, lower case."""
    label = name.strip().lower().rpartition(".")[2].strip("% ").replace("time_stamp", "timestamp")
    if label in SPELLED_UNITS:
        # a clock whose name is its unit, as the `millis` of a microcontroller
        return "time", label
    match = re.fullmatch(r"([a-z]+)\s*(?:[(\[]\s*([^)\]]*?)\s*[)\]]|(?:_|\s*/\s*|\s+)([a-zµμ]+))?", label)
    if match is None:
        return label, ""
    return match[1], match[2] or match[3] or ""


def _resolution(elapsed: FloatArray) -> float:
    """Largest power of ten that increasing numbers, of which the first is 0, are multiples of; 0 if there is none."""
    largest = np.floor(np.log10(np.diff(elapsed).min(initial=elapsed[-1])))
    for exponent in np.arange(largest, largest - MOST_DIGITS, -1.0):
        multiples = elapsed / 10.0**exponent
        if np.abs(multiples - np.rint(multiples)).max() < ROUNDED:
            return float(10.0**exponent)
    return 0.0


def _unit_of_steps(name: str, values: Column, interval: float) -> str:
    """Unit in which a clock goes on by an interval in s; empty if there is none."""
    times: NDArray[Any]
    if values.dtype.kind == "M":
        times, named_unit = values.ravel().astype("datetime64[ns]").view(np.int64), "ns"
    else:
        times, named_unit = values.ravel().astype(np.float64), _name_and_unit(name)[1]
    step = float(np.median(np.diff(times)))
    for unit in (named_unit,) if named_unit in SECONDS else ("s", "ms", "us", "ns"):
        if abs(step * SECONDS[unit] - interval) <= MATCHING * interval:
            return unit
    return ""


def _constant(values: Column) -> bool:
    return bool((values.ravel() == values.ravel()[0]).all())


def is_clock(values: Column) -> bool:
    """Whether numbers increase by steps like those of a clock; 0, 1, 2 ... count samples."""
    if values.dtype.kind == "M":
        return True
    if values.dtype.kind not in "iuf" or values.ravel().shape != (len(values),) or len(values) < 3:
        return False
    steps = np.diff(values.ravel().astype(np.float64))
    middle = np.median(steps)
    near = np.abs(steps - middle) <= STEADY * middle
    return bool((steps > 0).all() and near.mean() > 0.9 and not (steps == 1).all())
