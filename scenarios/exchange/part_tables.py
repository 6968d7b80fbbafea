"""Parquet: one table for each part of a data set, with a card for Hugging Face and a Croissant entry that reads it."""

import json
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hmtb_twin.files.hashes import file_hash
from hmtb_twin.files.netcdf import Contents, read_netcdf
from scenarios.datasets.data_set import DataRecord, DataSet
from scenarios.datasets.metadata import ENVIRONMENT, LICENSE_URL, bibtex
from scenarios.datasets.plan import LICENSE
from scenarios.datasets.record_block import PARTS
from scenarios.datasets.spec import shipped
from scenarios.exchange.record_files import ExportColumn, columns
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    import pyarrow as pa

LABELS = {
    "experiment": "name of the record",
    "block": "block of the spec that asks for the record",
    "arm": "arm under its conditions",
    "joints": "joints that are commanded and measured, separated by blanks",
}
"""Columns that are the same for all samples of a record, and their meaning."""

SIZES = ("n<1K", "1K<n<10K", "10K<n<100K", "100K<n<1M", "1M<n<10M", "10M<n<100M", "100M<n<1B", "1B<n<10B")
"""Size categories of Hugging Face, a factor of ten each."""


class PartTables:
    """A table `PART.parquet` for each part: all samples of its records in order, a row group for each record.

    All tables have the same columns: the name of the record, its block, arm and joints; number and time of the sample;
    a column for each channel that a record of the data set has. A cell is null where its record has no such channel or
    withholds it, and NaN where the sample was lost. Units stand in the metadata of the columns.

    Args:
        folder: Folder of the tables.
        data_set: The data set; its spec is in its folder.

    Raises:
        ScenarioError: No pyarrow, no spec, or records whose channels contradict each other.
    """

    def __init__(self, folder: Path, data_set: DataSet) -> None:
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError as error:
            raise ScenarioError("Parquet needs pyarrow: pip install 'hmtb-twin[parquet]'") from error
        self._pa, self._pq = pa, pq
        self._folder, self._data_set, self._spec = folder, data_set, data_set.spec
        self._columns = _all_columns(data_set)
        fields = [pa.field(name, pa.dictionary(pa.int32(), pa.string()), nullable=False) for name in LABELS]
        for column in self._columns:
            about = {"unit": column.unit, "role": column.role, "description": column.meaning}
            cell_type = pa.from_numpy_dtype(column.values.dtype)
            fields.append(pa.field(column.name, cell_type, nullable=column.role != "index", metadata=about))
        facts = {"data_set": data_set.label, "hash": data_set.records_hash, "sampling_time": "1/50 s"}
        facts["license"] = LICENSE
        self._schema = pa.schema(fields, facts)
        self._tables: dict[str, Any] = {}
        self._rows, self._records = Counter[str](), Counter[str]()

    def add(self, record: DataRecord, contents: Contents) -> str:
        """Append a record to the table of its part."""
        path = f"{record.part}.parquet"
        if record.part not in self._tables:
            self._tables[record.part] = self._pq.ParquetWriter(self._folder / path, self._schema, compression="zstd")
        columns_of_record = {column.name: column for column in columns(contents)}
        count = len(columns_of_record["sample"].values)
        if unexpected := columns_of_record.keys() - {column.name for column in self._columns}:
            raise ScenarioError(
                f"{record.name} has the channels {', '.join(sorted(unexpected))}, unlike others of its block"
            )
        # In the order of `LABELS`.
        labels = (record.name, record.block, record.arm, " ".join(record.joints))
        arrays = [self._label(label, count) for label in labels]
        for field in list(self._schema)[len(LABELS) :]:
            column = columns_of_record.get(field.name)
            present = np.zeros(0) if column is None else column.values
            values = self._pa.array(present, field.type)
            # Behind the window of withheld outputs, and where the record has no such channel, cells are null.
            arrays.append(self._pa.concat_arrays([values, self._pa.nulls(count - len(values), field.type)]))
        # Written as a row group: readers skip the records that they do not want.
        self._tables[record.part].write_table(self._pa.Table.from_arrays(arrays, schema=self._schema))
        self._rows[record.part] += count
        self._records[record.part] += 1
        return path

    def abort(self) -> None:
        """Close the files of an export that failed."""
        for table in self._tables.values():
            with suppress(Exception):
                table.close()
            table.is_open = False  # pyarrow would try again when the object goes

    def close(self) -> None:
        """Finish the tables; write the card README.md, croissant.json, and the datasheet if the data set has it."""
        for table in self._tables.values():
            table.close()
        context = self._context()
        card = ENVIRONMENT.get_template("dataset_card.md.j2").render(context)
        catalogue_entry = json.loads(ENVIRONMENT.get_template("croissant_tables.json.j2").render(context))
        croissant = json.dumps(catalogue_entry, indent=1, ensure_ascii=False, allow_nan=False)
        (self._folder / "README.md").write_text(card, encoding="utf-8")
        (self._folder / "croissant.json").write_text(f"{croissant}\n", encoding="utf-8")
        if (datasheet := self._data_set.folder / "README.md").is_file():
            (self._folder / "datasheet.md").write_bytes(datasheet.read_bytes())

    def _context(self) -> dict[str, Any]:
        """Template variables of the card README.md and of croissant.json."""
        parts, objects = [], []
        for part in PARTS:
            if part in self._tables:
                path = self._folder / f"{part}.parquet"
                parts.append((part, self._records[part], self._rows[part]))
                objects.append((path.name, path.stat().st_size, file_hash(path)))
        input_names = {column.name for column in self._columns if column.role == "input"}
        return {
            "spec": self._spec,
            "label": self._data_set.label,
            "shipped": self._data_set.label in shipped(),
            "bibtex": bibtex(self._spec, self._data_set.records_hash),
            "license_url": LICENSE_URL,
            "labels": LABELS,
            "columns": self._columns,
            "parts": parts,
            "size": _size_category(self._rows.total()),
            "objects": objects,
            "kind": _croissant_type,
            "several": len(input_names) > 1,
        }

    def _label(self, label: str, count: int) -> "pa.Array":
        """A column with the same label in every row: stored once, with an index in each row."""
        indices = self._pa.array(np.zeros(count, np.int32))
        return self._pa.DictionaryArray.from_arrays(indices, self._pa.array([label]))


def _size_category(rows: int) -> str:
    """The size category of Hugging Face: the first is below a thousand rows."""
    powers_reached = sum(rows >= 10**power for power in range(3, len(SIZES) + 2))
    return SIZES[powers_reached]


def _croissant_type(column: ExportColumn) -> str:
    return "sc:Integer" if column.values.dtype.kind in "iu" else "sc:Float"


def _all_columns(data_set: DataSet) -> Sequence[ExportColumn]:
    """The columns of all records; those of one block with the same joints have the same."""
    # Backwards, so that the first record of each kind stays.
    examples = {(record.part, record.block, record.joints): record for record in reversed(data_set.records())}
    if not examples:
        raise ScenarioError(f"{data_set.label}: no experiment has a record, so there is nothing to write")
    by_name: dict[str, ExportColumn] = {}
    for record in sorted(examples.values(), key=lambda record: PARTS.index(record.part)):
        for column in columns(read_netcdf(data_set.folder / record.file)):
            if by_name.setdefault(column.name, column)[:3] != column[:3]:
                raise ScenarioError(f"{record.name}: {column.name} has another unit or role than in other records")
            if by_name[column.name].values.dtype != column.values.dtype:
                raise ScenarioError(f"{record.name}: {column.name} has another type than in other records")
    index_names = ("sample", "t")
    ordered = sorted(by_name.values(), key=lambda column: _ROLES.get(column.role, len(_ROLES)))
    return [by_name[name] for name in index_names] + [c for c in ordered if c.name not in index_names]


# Other roles stand behind these, in the order in which they came.
_ROLES = {"index": 0, "input": 1, "output": 2}
