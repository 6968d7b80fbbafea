"""Export of a data set to formats that other programs read: .mat, CSV, Parquet, ASCII."""

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from hmtb_twin.files.atomic_write import working_folder
from hmtb_twin.files.netcdf import Contents, read_netcdf
from scenarios.datasets.data_set import DataRecord, DataSet, open_data_set
from scenarios.datasets.index import seal
from scenarios.exchange.part_tables import PartTables
from scenarios.exchange.record_files import ascii_table, csv, csv_metadata, mat
from scenarios.files.errors import ScenarioError, unknown


class Writer(Protocol):
    """Writes the records of a data set into the folder of a format."""

    def add(self, record: DataRecord, contents: Contents) -> str:
        """Write a record and return the path of its file in the folder."""
        ...

    def close(self) -> None:
        """Write what describes the records as a whole."""
        ...

    def abort(self) -> None:
        """Close the files of an export that failed."""
        ...


class RecordFiles:
    """A file for each record, and where a format has it, one of metadata beside it.

    Args:
        folder: Folder of the format.
        ending: Ending of the files.
        to_bytes: Makes a file.
        metadata: Makes the metadata of a file of that name, which goes to NAME-metadata.json.
    """

    def __init__(
        self,
        folder: Path,
        ending: str,
        to_bytes: Callable[[Contents], bytes],
        metadata: Callable[[Contents, str], bytes] | None = None,
    ) -> None:
        self._folder, self._ending, self._to_bytes, self._metadata = folder, ending, to_bytes, metadata

    def add(self, record: DataRecord, contents: Contents) -> str:
        """Write a record."""
        path = self._folder / record.part / f"{record.name}{self._ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(self._to_bytes(contents))
        if self._metadata is not None:
            path.with_name(f"{path.name}-metadata.json").write_bytes(self._metadata(contents, path.name))
        return f"{record.part}/{path.name}"

    def close(self) -> None:
        """Nothing describes the files as a whole."""

    def abort(self) -> None:
        """No file stays open."""


FORMATS: Mapping[str, Callable[[Path, DataSet], Writer]] = {
    "mat": lambda folder, _: RecordFiles(folder, ".mat", mat),
    "csv": lambda folder, _: RecordFiles(folder, ".csv", csv, csv_metadata),
    "parquet": PartTables,
    "ascii": lambda folder, _: RecordFiles(folder, ".txt", ascii_table),
}
"""Writer of each format, by its name."""


def export(
    folder: Path, out: Path, formats: Sequence[str], *, progress: Callable[[int, int], None] | None = None
) -> tuple[Path, ...]:
    """Write the records of a data set in other formats, from its index and its `data/`; the spec only describes them.

    Each format has a folder `<label>-<format>` of its own; it appears when it is complete.

    Args:
        folder: The data set.
        out: Folder in which the folders of the formats are created.
        formats: Names of `FORMATS`.
        progress: Called with the records done and their total.

    Raises:
        ScenarioError: No data set, an unknown format, a folder that is already there, or a record that is not what the
            index says.
        OSError: A file cannot be written; nothing of the export stays.
    """
    data_set = open_data_set(folder)
    # A file that its checksums do not list would fail its check.
    if out.resolve().is_relative_to(folder.resolve()):
        raise ScenarioError(f"{out} is inside the data set, which is never changed; name another --out")
    if not formats:
        raise ScenarioError(f"no format given of {', '.join(FORMATS)}")
    for name in formats:
        if name not in FORMATS:
            raise ScenarioError(unknown("format", name, FORMATS))
    finals = {name: out / f"{data_set.label}-{name}" for name in formats}
    existing = [str(path) for path in finals.values() if path.exists()]
    if existing:
        raise ScenarioError(
            f"{', '.join(existing)} is already there, and is not overwritten; remove it, or name another --out"
        )
    with working_folder(out) as scratch, ExitStack() as failing:
        writers: dict[str, Writer] = {}
        for name in finals:
            (scratch / name).mkdir()
            writers[name] = FORMATS[name](scratch / name, data_set)
            # Called after success too: to abort a writer that is closed does nothing.
            failing.callback(writers[name].abort)
        listed = _write_records(data_set, writers, progress)
        for name, final in finals.items():
            writers[name].close()
            index = {"data_set": data_set.label, "hash": data_set.records_hash, "format": name, "records": listed[name]}
            _describe_export(scratch / name, index, data_set.folder)
            (scratch / name).rename(final)
    return tuple(finals.values())


def _write_records(
    data_set: DataSet, writers: Mapping[str, Writer], progress: Callable[[int, int], None] | None
) -> dict[str, list[dict[str, object]]]:
    """Write every record in every format, and return what the index of each format lists."""
    listed: dict[str, list[dict[str, object]]] = {name: [] for name in writers}
    records = data_set.records()
    for done, record in enumerate(records, start=1):
        contents = read_record(data_set, record)  # read once for all formats
        facts = {key: getattr(record, key) for key in ("name", "part", "block", "arm", "twin", "joints")}
        for name, writer in writers.items():
            listed[name].append(facts | {"file": writer.add(record, contents)})
        if progress is not None:
            progress(done, len(records))
    return listed


def _describe_export(folder: Path, index: Mapping[str, object], data_set: Path) -> None:
    """Write index, licence, citation and checksums of an export."""
    text = json.dumps(index, indent=1, allow_nan=False)
    (folder / "export.json").write_text(f"{text}\n", encoding="utf-8")
    for file in ("LICENSE", "CITATION.cff"):
        if (data_set / file).is_file():
            shutil.copyfile(data_set / file, folder / file)
    seal(folder)


def read_record(data_set: DataSet, record: DataRecord) -> Contents:
    """Read the file of a record.

    Raises:
        ScenarioError: Its arrays are not those of the index.
    """
    contents = read_netcdf(data_set.folder / record.file)
    if differing := contents.differing(record.arrays):
        raise ScenarioError(
            f"{data_set.folder / record.file}: {', '.join(differing)} differ from what the index says; expected an "
            "undamaged data set, see hmtb dataset check"
        )
    return contents
