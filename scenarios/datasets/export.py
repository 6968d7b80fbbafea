"""Export of a data set to formats that other programs read."""

import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from scenarios.datasets.data_set import DataSet, Listing, open_data_set
from scenarios.datasets.export_mat import mat
from scenarios.datasets.export_parquet import parquet
from scenarios.datasets.export_text import ascii_table, csv, csv_metadata
from scenarios.datasets.hashes import file_hash
from scenarios.datasets.layout import SUMS
from scenarios.datasets.netcdf import Contents, read_netcdf
from scenarios.errors import ScenarioError
from scenarios.suggest import unknown

ALONG = ("LICENSE", "CITATION.cff")
"""Files of the data set that go with every copy of its records."""


@dataclass(frozen=True)
class Format:
    """A format of records.

    Attributes:
        ending: Of its files.
        content: The file for what a record's NetCDF file holds.
        metadata: A second file with what the first cannot say, for its name; its own ends in `-metadata.json`.
    """

    ending: str
    content: Callable[[Contents], bytes]
    metadata: Callable[[Contents, str], bytes] | None = None


FORMATS: Mapping[str, Format] = MappingProxyType(
    {
        "mat": Format(".mat", mat),
        "csv": Format(".csv", csv, csv_metadata),
        "parquet": Format(".parquet", parquet),
        "ascii": Format(".txt", ascii_table),
    }
)
"""The formats, by name."""


def export(
    folder: Path,
    out: Path,
    formats: Sequence[str],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Path, ...]:
    """Write the records of a data set in other formats; nothing but its index and its `data/` is read.

    Each format has a folder `<label>-<format>` of its own, with `<part>/<experiment>` as in the data set; it appears
    when it is complete.

    Args:
        folder: The data set.
        out: Folder in which those of the formats are made.
        formats: Names of `FORMATS`.
        progress: Told the records done and those there are.

    Returns:
        The folders, one per format.

    Raises:
        ScenarioError: No data set, an unknown format, a folder that is already there, or a record that is not what the
            index says.
        OSError: A file cannot be written; nothing of the export stays.
    """
    data_set = open_data_set(folder)
    if out.resolve().is_relative_to(folder.resolve()):
        raise ScenarioError(f"{out} is inside the data set, which is never changed; name another --out")
    names = tuple(dict.fromkeys(formats))
    wrong = [name for name in names if name not in FORMATS]
    if wrong or not names:
        raise ScenarioError(
            unknown("format", wrong[0], FORMATS) if wrong else f"no format given of {', '.join(FORMATS)}"
        )
    finals = {name: out / f"{data_set.label}-{name}" for name in names}
    there = [str(path) for path in finals.values() if path.exists()]
    if there:
        raise ScenarioError(
            f"{', '.join(there)} is already there, and is not overwritten; remove it, or name another --out"
        )
    lines = [line for line in data_set.listings if line.failed is None]
    with _workshop(out) as place:
        for done, line in enumerate(lines):
            contents = _checked(data_set, line)
            for name in names:
                _write(place / name / line.part, line.name, FORMATS[name], contents)
            if progress is not None:
                progress(done + 1, len(lines))
        for name in names:
            _describe(data_set, lines, place / name, name)
        for name, final in finals.items():
            (place / name).rename(final)
    return tuple(finals.values())


@contextmanager
def _workshop(out: Path) -> Iterator[Path]:
    """A folder to work in, on the disk of the result; it goes, whatever happens."""
    made = [path for path in (out, *out.parents) if not path.exists()]
    out.mkdir(parents=True, exist_ok=True)
    place = Path(tempfile.mkdtemp(prefix=".export-", dir=out))
    try:
        yield place
    except BaseException:
        shutil.rmtree(place)
        with suppress(OSError):  # others may have put something there meanwhile
            for path in made:  # innermost first
                path.rmdir()
        raise
    shutil.rmtree(place)


def _checked(data_set: DataSet, line: Listing) -> Contents:
    """What a record's file holds, if it is what the index says."""
    path = data_set.folder / line.file
    contents = read_netcdf(path)
    said, found = line.facts.get("arrays", {}).get(line.file, {}), contents.array_hashes()
    differing = sorted(name for name in {*said, *found} if said.get(name) != found.get(name))
    if differing:
        raise ScenarioError(
            f"{path}: {', '.join(differing)} differ from what the index says; expected an undamaged data set, "
            "see hmtb dataset check"
        )
    return contents


def _write(folder: Path, name: str, format: Format, contents: Contents) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}{format.ending}"
    path.write_bytes(format.content(contents))
    if format.metadata is not None:
        path.with_name(f"{path.name}-metadata.json").write_bytes(format.metadata(contents, path.name))


def _describe(data_set: DataSet, lines: Sequence[Listing], folder: Path, name: str) -> None:
    """Say what the folder holds, and put a checksum on all of it."""
    folder.mkdir(exist_ok=True)
    records = [
        {
            "name": line.name,
            "part": line.part,
            "block": line.block,
            "arm": line.arm,
            "twin": line.twin,
            "joints": line.joints,
            "file": f"{line.part}/{line.name}{FORMATS[name].ending}",
        }
        for line in lines
    ]
    index = {"data_set": data_set.label, "hash": data_set.hash, "format": name, "records": records}
    (folder / "export.json").write_text(json.dumps(index, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    for file in ALONG:
        if (data_set.folder / file).is_file():
            shutil.copyfile(data_set.folder / file, folder / file)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    sums = "".join(f"{file_hash(path)}  {path.relative_to(folder).as_posix()}\n" for path in files)
    (folder / SUMS).write_text(sums, encoding="utf-8")
