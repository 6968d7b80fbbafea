"""Files of bus records in every format: 1553, ASCII, CSV, NetCDF, MATLAB."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from hmtb_twin import JointLog
from hmtb_twin.bus import recorder_run
from hmtb_twin.bus.messages import incomplete, rounding
from hmtb_twin.bus.record import CHANNELS, FORMAT, BusRecord
from hmtb_twin.files.atomic_write import check_place
from hmtb_twin.files.netcdf import stated_format, variable_names
from scenarios.files import mat_file
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.flat_file import CSV_HEADER, FLAT, read_csv, read_flat, write_csv, write_flat

ENDINGS: Mapping[str, str] = MappingProxyType(
    {"nc": ".nc", "csv": ".csv", "mat": ".mat", "1553": ".ch10", "ascii": ".asc"}
)
"""Ending of the files of each format."""

FORMATS: Mapping[str, str] = MappingProxyType(
    {**{ending: name for name, ending in ENDINGS.items()}, ".c10": "1553", ".txt": "ascii"}
)
"""Format of the files with each ending."""


COORDINATES = ("sample", "joint", "component", "axis")
"""Names of the axes of our NetCDF4 files; arrays of these names hold no channel."""


@dataclass(frozen=True)
class RecordFile:
    """Records of a file.

    Attributes:
        records: Its tests.
        message: One line on what is missing; empty if nothing is.
        hidden: Channels of a joint log that no other format holds: what only a simulation knows.
    """

    records: tuple[BusRecord, ...]
    message: str = ""
    hidden: tuple[str, ...] = ()

    def choose(self, test: str | None, path: Path) -> BusRecord:
        """Choose a test by name or by number from 1; not needed if there is one.

        Raises:
            ScenarioError: No such test, or none named of several; the message names the file.
        """
        names = [record.name for record in self.records]
        if test is None:
            if len(names) > 1:
                raise ScenarioError(f"{path.name} holds {len(names)} tests: {', '.join(names)}; choose one by --test")
            return self.records[0]
        if test in names:
            return self.records[names.index(test)]
        # A name comes before a number: a test may be called "2". Longer numbers would be no index at all.
        if test.isdecimal() and len(test) < 9 and 1 <= int(test) <= len(names):
            return self.records[int(test) - 1]
        raise ScenarioError(unknown("test", test, names))


def format_of(path: Path) -> str:
    """Name of a file's format, by its ending.

    Raises:
        ScenarioError: Another ending.
    """
    if path.suffix not in FORMATS:
        raise ScenarioError(f"{str(path)!r}: unknown kind of file {path.suffix!r}; there are: {', '.join(FORMATS)}")
    return FORMATS[path.suffix]


def is_record(path: Path) -> bool:
    """Whether a file holds bus records of ours, by its contents."""
    format_name = FORMATS.get(path.suffix)
    if format_name == "nc":
        return stated_format(path) == FORMAT
    if format_name == "mat":
        return mat_file.is_ours(path)
    if format_name in _FIRST_LINES:
        # No more than the expected line and its end: the first line of a foreign file may be gigabytes long.
        with path.open("rb") as file:
            line = file.readline(len(CSV_HEADER) + 4).decode("ascii", errors="replace")
        return line.strip() == _FIRST_LINES[format_name]
    # No other program here writes this ending; a file that is no record is refused when it is read.
    return format_name == "1553"


_FIRST_LINES = {"ascii": f"% {FLAT}", "csv": CSV_HEADER}
_READERS = {"mat": mat_file.read_mat, "ascii": read_flat, "csv": read_csv}
_WRITERS = {"mat": mat_file.write_mat, "ascii": write_flat, "csv": write_csv, "nc": BusRecord.save}


def read_records(path: Path) -> RecordFile:
    """Read a file of any of our formats.

    Args:
        path: `.ch10` or `.c10` (1553), `.asc` or `.txt` (ASCII), `.csv`, `.nc` (bus record or joint log), `.mat`.

    Raises:
        ScenarioError: The file is missing or of another kind.
        TwinError: It is damaged beyond use.
    """
    if not path.is_file():
        raise ScenarioError(f"no file {str(path)!r}; expected one of {', '.join(FORMATS)}")
    format_name = format_of(path)
    if format_name == "1553":
        run = recorder_run.read_run(path)
        return RecordFile(run.tests, run.message)
    if format_name in _READERS:
        return RecordFile((_READERS[format_name](path),))
    if stated_format(path) == FORMAT:
        return RecordFile((BusRecord.load(path),))
    # The remaining NetCDF files of ours are logs of a simulation, which know more than the bus recorded.
    record = BusRecord.of(JointLog.load(path))
    hidden = tuple(name for name in variable_names(path) if name not in (*CHANNELS, *COORDINATES))
    # Seed and provenance are attributes of a log, no variables.
    if hidden:
        hidden = (*hidden, "seed", "provenance")
    return RecordFile((record,), hidden=hidden)


def write_record(record: BusRecord, path: Path) -> Path:
    """Write one test; the ending chooses the format.

    Args:
        record: The test.
        path: The file, any ending but that of 1553 records, which hold runs.

    Raises:
        ScenarioError: Another ending, or there is a folder of that name.
        TwinError: The NetCDF file cannot be written.
    """
    check_place(path)
    format_name = format_of(path)
    if format_name not in _WRITERS:
        raise ScenarioError(f"{path.name}: 1553 records are written by the run")
    return _WRITERS[format_name](record, path)


def losses(contents: Sequence[RecordFile], kind: str) -> list[str]:
    """List what is lost when records are written in a format, one text for each loss.

    Raises:
        ScenarioError: More tests than a run of the recorder holds.
    """
    hidden, records = set[str](), list[BusRecord]()
    for content in contents:
        hidden.update(content.hidden)
        records.extend(content.records)
    lost = []
    if hidden:
        lost.append(f"what only a simulation knows ({', '.join(sorted(hidden))})")
    if kind == "1553":
        lost += _lost_in_a_run(records)
    return lost


def _lost_in_a_run(records: Sequence[BusRecord]) -> list[str]:
    """What a run of the recorder loses: digits, messages of which a word is missing, ticks beyond its memory."""
    lost = []
    # A word of the bus has 16 bits: values are rounded to its quantum, and one bad word costs its whole message.
    units = {"commanded": "rad", "measured": "rad", "wrench": "N or N m"}
    for record in records:
        for channel, change in rounding(record).items():
            lost.append(f"{record.name}: digits of the {channel} values, up to {change:.3g} {units[channel]}")
        for channel, count in incomplete(record).items():
            lost.append(
                f"{record.name}: {channel} values at {count} ticks at which others of the same message are missing"
            )
    if len(records) > recorder_run.TESTS_PER_RUN:
        raise ScenarioError(f"{len(records)} tests given; a run of the recorder holds {recorder_run.TESTS_PER_RUN}")
    ticks = sum(map(len, records))
    if ticks > (memory := recorder_run.MEMORY):
        lost.append(f"{ticks - memory} of {ticks} ticks: the recorder's memory holds {memory}, twenty minutes")
    return lost


def unnamed(records: Sequence[BusRecord | JointLog], kind: str, names: Sequence[str]) -> list[str]:
    """List what a format has no place for beside the channels: a CSV names no test and no axes.

    Args:
        records: The records.
        kind: Name of the format to write.
        names: Names of the written files, one for each record.
    """
    if kind != "csv":
        return []
    lost = []
    for record, name in zip(records, names, strict=True):
        unsaid = []
        if name != record.name:
            unsaid.append(f"that the test is {record.name}")
        if record.axes:
            unsaid.append(f"that it excites {', '.join(record.axes)}")
        if unsaid:
            lost.append(f"{name}{ENDINGS[kind]} does not say {' nor '.join(unsaid)}")
    return lost
