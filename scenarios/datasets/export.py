"""Export of a data set to formats that other programs read: .mat, CSV, Parquet, ASCII."""

import io
import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from hmtb_twin.files.hashes import file_hash
from hmtb_twin.files.netcdf import Contents, read_netcdf
from scenarios.datasets.data_set import open_data_set, sampling_time
from scenarios.datasets.index import paths_of_files, write_checksums
from scenarios.datasets.plan import SUMS
from scenarios.datasets.variables import WINDOW
from scenarios.files.errors import ScenarioError, unknown

LARGEST = 2**31 - 2**10
"""Bytes of a variable that version 5 of .mat files can hold, with room for its head."""


class ExportColumn(NamedTuple):
    """A column of numbers (N,), whole or float64; `name` is valid in MATLAB, too, and `unit` 1 for plain numbers."""

    name: str
    unit: str
    role: str
    meaning: str
    values: np.ndarray


def columns(contents: Contents) -> tuple[ExportColumn, ...]:
    """Return all numbers of a record, a column per channel, the number of the sample first.

    Withheld samples are NaN; their column holds float64.

    Raises:
        ScenarioError: Numbers that do not run over the samples.
    """
    table: list[ExportColumn] = []
    for name, variable in contents.variables.items():
        if variable.values.dtype.kind == "U" or name == WINDOW:
            continue
        if variable.dims[0] not in ("sample", WINDOW) or variable.values.ndim > 2:
            raise ScenarioError(
                f"{name} has dimensions {', '.join(variable.dims)}, expected sample, or sample and another"
            )
        values = variable.values
        if variable.dims[0] == WINDOW:
            values = np.full((len(contents.variables["sample"].values), *values.shape[1:]), np.nan)
            values[: len(variable.values)] = variable.values
        unit, role, meaning = (str(variable.attributes.get(key, "")) for key in ("units", "role", "long_name"))
        if values.ndim == 1:
            table.append(ExportColumn(name, unit, "index" if name == "sample" else role, meaning, values))
            continue
        pattern = "{}" + name.removeprefix("joint") if name.startswith("joint_") else name + "_{}"
        for channel, column in zip(contents.variables[variable.dims[1]].values, values.T, strict=True):
            table.append(ExportColumn(pattern.format(channel), unit, role, meaning, column))
    return tuple(sorted(table, key=lambda column: column.name != "sample"))


def mat(contents: Contents) -> bytes:
    """Write a record as a .mat file: `u`, `y`, `dt` and the other variables, (N, n), names of channels as cells.

    `units` and `about` are structures: the unit of each variable, and all attributes of the record.

    Raises:
        ScenarioError: A variable that is larger than the format allows.
    """
    from scipy.io import savemat

    units: dict[str, object] = {"dt": "s"}
    variables: dict[str, object] = {"dt": float(sampling_time(contents))}
    for name, variable in contents.variables.items():
        if variable.values.nbytes > LARGEST:
            raise ScenarioError(
                f"{name} has {variable.values.nbytes / 2**30:.3g} GiB, a .mat file of version 5 holds less than 2 per "
                "variable; MATLAB reads the data set's own .nc files of any size by ncread, and Parquet by parquetread"
            )
        if variable.values.dtype.kind == "U":
            variables[f"{name}_names"] = variable.values.astype(object)
        else:
            variables[name] = variable.values
            units[name] = str(variable.attributes["units"])
    stream = io.BytesIO()
    about = {"units": units, "about": dict(contents.attributes)}
    savemat(stream, variables | about, oned_as="column", do_compression=True, long_field_names=True)
    # SciPy's head contains the time of day; with this one equal records give equal files.
    head = b"MATLAB 5.0 MAT-file, a record of a data set of the HMTB twin".ljust(116)
    return head + stream.getvalue()[len(head) :]


def parquet(contents: Contents) -> bytes:
    """Write a record as Parquet: a column per channel, units in the metadata; it needs pyarrow."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise ScenarioError("Parquet needs pyarrow: pip install 'hmtb-twin[parquet]'") from error
    table = columns(contents)
    fields = [
        pa.field(
            column.name,
            pa.from_numpy_dtype(column.values.dtype),
            nullable=False,
            metadata={"unit": column.unit, "role": column.role, "description": column.meaning},
        )
        for column in table
    ]
    about = {key: value if isinstance(value, str) else _json(value) for key, value in contents.attributes.items()}
    arrays = [pa.array(column.values) for column in table]
    stream = io.BytesIO()
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, about)), stream)
    return stream.getvalue()


def csv(contents: Contents) -> bytes:
    """Write a record as CSV: one line of names with units, then a line per sample.

    Numbers have the digits that give every bit back; NaN is a sample that was lost or is withheld.
    """
    table = columns(contents)
    header = ",".join(f"{column.name} [{column.unit}]" for column in table)
    return f"{header}\n{_rows(table, ',')}".encode()


def csv_metadata(contents: Contents, file: str) -> bytes:
    """Write the metadata of a CSV file of that name, in the form of CSV on the Web (W3C)."""
    described = [
        {
            "name": column.name,
            "titles": f"{column.name} [{column.unit}]",
            "dc:description": column.meaning,
            "datatype": "integer" if column.values.dtype.kind in "iu" else "double",
            "hmtb:unit": column.unit,
            "hmtb:role": column.role,
        }
        for column in columns(contents)
    ]
    metadata = {
        "@context": ["http://www.w3.org/ns/csvw", {"hmtb": "urn:hmtb:"}],
        "url": file,
        **{f"hmtb:{key}": value for key, value in contents.attributes.items()},
        "tableSchema": {"columns": described, "primaryKey": "sample"},
    }
    return (_json(metadata, indent=1) + "\n").encode()


def ascii_table(contents: Contents) -> bytes:
    """Write a record as the ASCII flat file [Morris1996, II.5]: lines of comment, then numbers between blanks.

    MATLAB's `load -ascii` and `numpy.loadtxt(..., comments="%")` read it.
    """
    table = columns(contents)
    lines = [
        "hmtb data set ascii 1",
        *(f"{key}: {_json(value)}" for key, value in contents.attributes.items()),
        f"sampling time: {sampling_time(contents)} s",
        f"samples: {len(table[0].values)}",
        "lost samples: NaN",
        *(f"column {k}: {column.name}, {column.unit}" for k, column in enumerate(table, start=1)),
    ]
    return ("".join(f"% {line}\n" for line in lines) + _rows(table, " ")).encode()


def _rows(table: Sequence[ExportColumn], separator: str) -> str:
    text = [[repr(value) for value in column.values.tolist()] for column in table]
    return "".join(separator.join(row) + "\n" for row in zip(*text, strict=True)).replace("nan", "NaN")


def _json(value: object, indent: int | None = None) -> str:
    return json.dumps(value, indent=indent, default=np.ndarray.tolist)


FORMATS: Mapping[str, tuple[str, Callable[[Contents], bytes]]] = {
    "mat": (".mat", mat),
    "csv": (".csv", csv),
    "parquet": (".parquet", parquet),
    "ascii": (".txt", ascii_table),
}
"""Ending and writer of each format, by its name."""


def export(
    folder: Path, out: Path, formats: Sequence[str], *, progress: Callable[[int, int], None] | None = None
) -> tuple[Path, ...]:
    """Write the records of a data set in other formats; nothing but its index and its `data/` is read.

    Each format has a folder `<label>-<format>` of its own, with `<part>/<experiment>` as in the data set; it appears
    when it is complete.

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
    records = data_set.records()
    with working_folder(out) as place:
        for done, one in enumerate(records, start=1):
            contents = read_netcdf(data_set.folder / one.file)
            if differing := contents.differing(one.arrays):
                raise ScenarioError(
                    f"{data_set.folder / one.file}: {', '.join(differing)} differ from what the index says; expected "
                    "an undamaged data set, see hmtb dataset check"
                )
            for name in finals:
                ending, writer = FORMATS[name]
                path = place / name / one.part / f"{one.name}{ending}"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(writer(contents))
                if name == "csv":
                    path.with_name(f"{path.name}-metadata.json").write_bytes(csv_metadata(contents, path.name))
            if progress is not None:
                progress(done, len(records))
        for name, final in finals.items():
            keys = ("name", "part", "block", "arm", "twin", "joints")
            listed = [
                {key: getattr(one, key) for key in keys} | {"file": f"{one.part}/{one.name}{FORMATS[name][0]}"}
                for one in records
            ]
            index = {"data_set": data_set.label, "hash": data_set.hash, "format": name, "records": listed}
            text = json.dumps(index, indent=1, allow_nan=False) + "\n"
            (place / name).mkdir(exist_ok=True)
            (place / name / "export.json").write_text(text, encoding="utf-8")
            for file in ("LICENSE", "CITATION.cff"):
                if (data_set.folder / file).is_file():
                    shutil.copyfile(data_set.folder / file, place / name / file)
            seal(place / name)
            (place / name).rename(final)
    return tuple(finals.values())


@contextmanager
def working_folder(out: Path) -> Iterator[Path]:
    """Make a temporary folder on the disk of the result; it is removed in the end, and on errors `out` with it if new.

    Args:
        out: Folder of the results, made if missing.
    """
    new = [path for path in (out, *out.parents) if not path.exists()]
    out.mkdir(parents=True, exist_ok=True)
    try:
        with TemporaryDirectory(prefix=".export-", dir=out) as place:
            yield Path(place)
    except BaseException:
        with suppress(OSError):  # another program may have written there meanwhile
            for path in new:  # innermost first
                path.rmdir()
        raise


def seal(folder: Path) -> None:
    """Write the checksums of all files in a folder."""
    write_checksums(folder, {path: file_hash(folder / path) for path in paths_of_files(folder) if path != SUMS})
