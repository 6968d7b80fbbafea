"""`hmtb convert`: records of the bus from one file format to another."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import (
    check_files,
    counted,
    output_folder,
    print_json,
    print_table,
    say_beside_bar,
    say_each,
    say_next_identify,
)
from scenarios.files.errors import ScenarioError, unknown


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
    from scenarios.files.record_file import ENDINGS, RecordFile, losses, read_records, unnamed, write_record

    if len(paths) < 2:
        raise ScenarioError("expected a file to convert and the file or folder to write; see hmtb convert --help")
    *sources, out = paths
    kind, single = _target(sources, out, format)
    contents = [read_records(source) for source in sources]
    if test is not None:
        contents = [
            RecordFile((entry.choose(test, source),), entry.message, entry.hidden)
            for entry, source in zip(contents, sources, strict=True)
        ]
    records = [record for entry in contents for record in entry.records]
    lost = losses(contents, kind)
    if lost and not lossy:
        raise ScenarioError(f"{out.name} would lose {'; '.join(lost)}. To convert nevertheless: --lossy")
    warnings = [entry.message for entry in contents if entry.message] + [f"lost: {text}" for text in lost]
    names = [record.name for record in records]
    if kind != "1553" and single and len(records) > 1:
        raise ScenarioError(
            f"{len(records)} tests ({', '.join(names)}) need a folder; choose one by --test, or give one"
        )
    # Without characters that leave the folder.
    safe = [re.sub(r"[/\\\0]", "_", name).lstrip(".") or "test" for name in names]
    if len(set(safe)) < len(safe) and not single:
        twice_named = next(name for name in safe if safe.count(name) > 1)
        raise ScenarioError(f"two tests are named {twice_named!r}; their files would be one")
    stems = [sources[0].stem] if kind == "1553" else safe
    places = [out] if single else [out / f"{stem}{ENDINGS[kind]}" for stem in stems]
    with output_folder(out.parent if single else out):
        check_files(*places, overwrite=overwrite)
        if kind == "1553":
            bus = record_run(records, places[0])
            written = [bus.path]
            warnings += [bus.message] if bus.message else []  # the recorder's memory may be too small
        else:
            written = [write_record(record, place) for record, place in zip(records, places, strict=True)]
    notes = unnamed(records, kind, [path.stem for path in written])
    missing = [int(record.lost.sum()) for record in records]
    code = 1 if any(entry.message for entry in contents) else 0
    if json:
        tests = [
            {"name": record.name, "ticks": len(record), "ticks_lost": lost_ticks, "excited": record.axes}
            for record, lost_ticks in zip(records, missing, strict=True)
        ]
        print_json({"files": written, "tests": tests, "lost": [*lost, *notes], "warnings": warnings})
        return code
    rows = [
        (record.name, str(written[min(k, len(written) - 1)]), f"{len(record) * record.dt:g} s", str(missing[k]))
        for k, record in enumerate(records)
    ]
    print_table(counted(len(written), "file"), ("test", "file", "length", "ticks lost"), rows)
    say_each("warning: ", warnings)
    for text in notes:
        say_beside_bar(f"note: {text}")
    say_next_identify(written[0], names[0], records[0].axes, tests=1 + len(records) - len(written))
    return code


def _target(sources: Sequence[Path], out: Path, format: str | None) -> tuple[str, bool]:
    """The format to write, and whether into one file or a folder."""
    from scenarios.files.record_file import ENDINGS, FORMATS, format_of

    if format is not None and format not in ENDINGS:
        raise ScenarioError(unknown("format", format, ENDINGS))
    if out.is_dir() or out.suffix not in FORMATS:
        if format is None:
            raise ScenarioError(
                f"{str(out)!r} ends in none of {', '.join(FORMATS)}; to write into a folder of that name, give --format"
            )
        return format, False
    if format not in (None, format_of(out)):
        raise ScenarioError(f"{out.name} ends like {format_of(out)}, --format says {format}; expected one of them")
    if any(source.resolve() == out.resolve() for source in sources):
        raise ScenarioError(f"{str(out)!r} would be written over itself; name another file")
    return format_of(out), True
