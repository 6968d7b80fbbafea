"""`hmtb convert`: records of the bus from one file format to another."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    check_files,
    output_folder,
    print_json,
    print_table,
    say_beside_bar,
    say_each,
    say_next_identify,
)
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.printable import counted

if TYPE_CHECKING:
    from hmtb_twin.bus.record import BusRecord
    from scenarios.files.record_file import RecordFile


def convert(
    paths: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="IN ... OUT")],
    *,
    format: str | None = None,
    test: str | None = None,
    lossy: bool = False,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Convert records between 1553, ASCII, CSV, NetCDF and MATLAB.

    The ending of a file defines its format: .ch10 (1553, IRIG 106 Chapter 10), .asc or .txt (ASCII flat file), .csv,
    .nc (NetCDF4), .mat (MATLAB 5). A 1553 record holds up to five tests: several files become one run, and a run
    becomes several files where OUT is a folder. Samples that the bus lost are NaN in every other format.

      hmtb convert run-1.ch10 ascii --format ascii

    A conversion that would lose values is refused, with a list of them; --lossy converts nevertheless. A CSV file
    cannot hold the name of the test and its excited axes; a note reminds of it.

    Args:
        paths: Files to convert, then the file or folder to write.
        format: Format of the files in the folder OUT: nc, csv, mat, 1553, ascii.
        test: Convert only this test of a run, by name or number.
        lossy: Convert although values are lost.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from hmtb_twin.bus.recorder_run import record_run
    from scenarios.files.record_file import losses, read_records, unnamed, write_record

    if len(paths) < 2:
        raise ScenarioError("expected a file to convert and the file or folder to write; see hmtb convert --help")
    *sources, out = paths
    target, is_single_file = _target(sources, out, format)
    contents = [read_records(source) for source in sources]
    if test is not None:
        contents = [_only_test(content, test, source) for content, source in zip(contents, sources, strict=True)]
    records: list[BusRecord] = []
    for content in contents:
        records += content.records
    # Asked before anything is written: a refusal leaves the folder as it was.
    lost = losses(contents, target)
    if lost and not lossy:
        raise ScenarioError(f"{out.name} would lose {'; '.join(lost)}. To convert nevertheless: --lossy")
    damages = [content.message for content in contents if content.message]
    warnings = [*damages, *(f"lost: {loss}" for loss in lost)]
    # Only 1553 records hold several tests in one file.
    names = [record.name for record in records]
    if target != "1553" and is_single_file and len(records) > 1:
        raise ScenarioError(
            f"{len(records)} tests ({', '.join(names)}) need a folder; choose one by --test, or give one"
        )
    file_names = _file_names(names, sources[0].stem, target, may_collide=is_single_file)
    folder = out.parent if is_single_file else out
    paths_out = [out] if is_single_file else [out / name for name in file_names]
    with output_folder(folder):
        check_files(*paths_out, overwrite=overwrite)
        if target == "1553":
            bus = record_run(records, paths_out[0])
            written = [bus.path]
            if bus.message:  # the recorder's memory may be too small
                warnings.append(bus.message)
        else:
            written = [write_record(record, path) for record, path in zip(records, paths_out, strict=True)]
    notes = unnamed(records, target, [path.stem for path in written])
    # What could be saved of a damaged record is written; the exit code tells scripts that it is not all.
    code = 1 if damages else 0
    if json:
        tests = [_test_record(record) for record in records]
        print_json({"files": written, "tests": tests, "lost": [*lost, *notes], "warnings": warnings})
        return code
    _print(records, written)
    say_each("warning: ", warnings)
    for note in notes:
        say_beside_bar(f"note: {note}")  # a script that reads stdout has the files alone
    say_next_identify(written[0], names[0], records[0].axes, tests=1 + len(records) - len(written))
    return code


def _print(records: "Sequence[BusRecord]", written: Sequence[Path]) -> None:
    rows = []
    for k, record in enumerate(records):
        file = written[min(k, len(written) - 1)]  # a run of several tests is one file
        lost_ticks = int(record.lost.sum())
        rows.append((record.name, str(file), f"{len(record) * record.dt:g} s", str(lost_ticks)))
    print_table(counted(len(written), "file"), ("test", "file", "length", "ticks lost"), rows)


def _only_test(content: "RecordFile", test: str, source: Path) -> "RecordFile":
    """The contents of a file with one of its tests alone."""
    from dataclasses import replace

    return replace(content, records=(content.choose(test, source),))


def _file_names(names: Sequence[str], stem: str, target: str, *, may_collide: bool) -> list[str]:
    """Names of the files of a folder: of a 1553 run one, else one for each test, without characters that leave it."""
    from scenarios.files.record_file import ENDINGS

    # Names come from files: a slash would leave the folder, a leading dot would hide the file.
    safe = [re.sub(r"[/\\\0]", "_", name).lstrip(".") or "test" for name in names]
    if len(set(safe)) < len(safe) and not may_collide:
        twice_named = next(name for name in safe if safe.count(name) > 1)
        raise ScenarioError(f"two tests are named {twice_named!r}; their files would be one")
    stems = [stem] if target == "1553" else safe
    return [f"{name}{ENDINGS[target]}" for name in stems]


def _test_record(record: "BusRecord") -> dict[str, object]:
    lost = int(record.lost.sum())
    return {"name": record.name, "ticks": len(record), "ticks_lost": lost, "excited": record.axes}


def _target(sources: Sequence[Path], out: Path, format: str | None) -> tuple[str, bool]:
    """The format to write, and whether into one file or a folder."""
    from scenarios.files.record_file import ENDINGS, FORMATS, format_of

    if format is not None and format not in ENDINGS:
        raise ScenarioError(unknown("format", format, ENDINGS))
    # A folder may be called `run.csv`: what is there decides before the ending does.
    if out.is_dir() or out.suffix not in FORMATS:
        if format is None:
            raise ScenarioError(
                f"{str(out)!r} ends in none of {', '.join(FORMATS)}; to write into a folder of that name, give --format"
            )
        return format, False
    if format not in (None, format_of(out)):
        raise ScenarioError(f"{out.name} ends like {format_of(out)}, --format says {format}; expected one of them")
    # Resolved, because a link or `./` names the same file.
    if any(source.resolve() == out.resolve() for source in sources):
        raise ScenarioError(f"{str(out)!r} would be written over itself; name another file")
    return format_of(out), True
