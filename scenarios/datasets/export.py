"""Export of a data set to formats that other programs read: .mat, CSV, Parquet, ASCII."""

import io
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from scenarios.datasets.data_set import WINDOW, DataSet, IndexEntry, open_data_set, sampling_time
from scenarios.datasets.layout import SUMS
from scenarios.files.errors import ScenarioError, unknown
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf import Contents, Variable, read_netcdf

_NAMES = {
    "u": "u_{}",
    "y": "y_{}",
    "joint_commanded": "{}_commanded",
    "joint_measured": "{}_measured",
}
"""How the columns of a variable are named after its channels; others are prefixed by their own name."""


@dataclass(frozen=True)
class Column:
    """A column.

    Attributes:
        name: Its name, e.g. `u_elbow_pitch`; a valid name in MATLAB, too.
        unit: Of the values, `1` for whole numbers without one.
        role: What the values are for: `input`, `output`, `auxiliary`, or `index`.
        meaning: In words; empty where the file says none.
        values: The values (N,), whole numbers or float64.
    """

    name: str
    unit: str
    role: str
    meaning: str
    values: np.ndarray


def columns(contents: Contents) -> tuple[Column, ...]:
    """All numbers of a record, a column per channel, the sample's number first.

    What is withheld of a record with hidden truth is NaN in its column, which then holds float64.

    Args:
        contents: What its file holds.

    Raises:
        ScenarioError: Numbers that do not run over the samples.
    """
    made: list[Column] = []
    for name, variable in contents.variables.items():
        if variable.values.dtype.kind == "U" or name == WINDOW:
            continue
        if variable.dims[0] not in ("sample", WINDOW) or variable.values.ndim > 2:
            raise ScenarioError(
                f"{name} has dimensions {', '.join(variable.dims)}, expected sample, or sample and another"
            )
        all_values = variable.values if variable.dims[0] == "sample" else _with_gaps(variable.values, contents)
        if all_values.ndim == 1:
            made.append(_column(name, variable, all_values))
            continue
        channels = contents.variables[variable.dims[1]].values
        for channel, values in zip(channels, all_values.T, strict=True):
            full = _NAMES.get(name, name + "_{}").format(channel)
            made.append(_column(full, variable, values))
    return tuple(sorted(made, key=lambda column: column.name != "sample"))


def _with_gaps(values: np.ndarray, contents: Contents) -> np.ndarray:
    """Values of the window, NaN behind it."""
    samples = len(contents.variables["sample"].values)
    whole = np.full((samples, *values.shape[1:]), np.nan)
    whole[: len(values)] = values
    return whole


def _column(name: str, variable: Variable, values: np.ndarray) -> Column:
    told = {key: str(variable.attributes.get(key, "")) for key in ("role", "long_name")}
    role = "index" if name == "sample" else told["role"]
    return Column(name, str(variable.attributes["units"]), role, told["long_name"], values)


ASCII = "hmtb data set ascii 1"
"""Marks the ASCII files of this version, in their first line."""


def csv(contents: Contents) -> bytes:
    """Write a record as CSV: one line of names with units, then a line per sample.

    Numbers have the digits that bring every bit back; NaN is a sample that was lost.

    Args:
        contents: What the file of the record holds.
    """
    table = columns(contents)
    header = ",".join(f"{column.name} [{column.unit}]" for column in table)
    return f"{header}\n{_rows(table, ',')}".encode()


def csv_metadata(contents: Contents, file: str) -> bytes:
    """Write what is said of a CSV file, in the form of CSV on the Web (W3C).

    Args:
        contents: What the file of the record holds.
        file: Name of the CSV file beside it.
    """
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
    said = {
        "@context": ["http://www.w3.org/ns/csvw", {"hmtb": "urn:hmtb:"}],
        "url": file,
        **{f"hmtb:{key}": value for key, value in contents.attributes.items()},
        "tableSchema": {"columns": described, "primaryKey": "sample"},
    }
    return (json.dumps(said, indent=1, allow_nan=False, default=np.ndarray.tolist) + "\n").encode()


def ascii_table(contents: Contents) -> bytes:
    """Write a record as the ASCII flat file [Morris1996, II.5]: lines of comment, then numbers between blanks.

    MATLAB's `load -ascii` and `numpy.loadtxt(..., comments="%")` read it.

    Args:
        contents: What the file of the record holds.
    """
    table = columns(contents)
    said = {key: json.dumps(value, default=np.ndarray.tolist) for key, value in contents.attributes.items()}
    lines = [
        ASCII,
        *(f"{key}: {value}" for key, value in said.items()),
        f"sampling time: {sampling_time(contents)} s",
        f"samples: {len(table[0].values)}",
        "lost samples: NaN",
        *(f"column {k}: {column.name}, {column.unit}" for k, column in enumerate(table, start=1)),
    ]
    return ("".join(f"% {line}\n" for line in lines) + _rows(table, " ")).encode()


def _rows(table: tuple[Column, ...], separator: str) -> str:
    text = [[repr(value) for value in column.values.tolist()] for column in table]
    return "".join(separator.join(row) + "\n" for row in zip(*text, strict=True)).replace("nan", "NaN")


LARGEST = 2**31 - 2**10
"""Bytes of a variable that version 5 of the format can hold, with room for its head."""

_HEAD = b"MATLAB 5.0 MAT-file, a record of a data set of the HMTB twin"
_HEAD_LENGTH = 116


def mat(contents: Contents) -> bytes:
    """Write a record as a .mat file: `u`, `y`, `dt` and the other variables, (N, n), names of channels as cells.

    `units` and `about` are structures: the unit of each variable, and all attributes of the record.

    Args:
        contents: What the file of the record holds.

    Raises:
        ScenarioError: A variable that is larger than the format allows.
    """
    from scipy.io import savemat

    for name, variable in contents.variables.items():
        if variable.values.nbytes > LARGEST:
            raise ScenarioError(
                f"{name} has {variable.values.nbytes / 2**30:.3g} GiB, a .mat file of version 5 holds less than 2 per "
                "variable; MATLAB reads the data set's own .nc files of any size by ncread, and Parquet by parquetread"
            )
    units: dict[str, object] = {"dt": "s"}
    variables: dict[str, object] = {"dt": float(sampling_time(contents))}
    for name, variable in contents.variables.items():
        if variable.values.dtype.kind == "U":
            variables[f"{name}_names"] = variable.values.astype(object)
        else:
            variables[name] = variable.values
            units[name] = str(variable.attributes["units"])
    variables |= {"units": units, "about": dict(contents.attributes)}
    target = io.BytesIO()
    savemat(target, variables, oned_as="column", do_compression=True, long_field_names=True)
    made = target.getvalue()
    # The head is a text with the time of day; equal records give equal files.
    return _HEAD.ljust(_HEAD_LENGTH) + made[_HEAD_LENGTH:]


def parquet(contents: Contents) -> bytes:
    """Write a record as Parquet: a column per channel; units stand in the metadata of the columns.

    Args:
        contents: What the file of the record holds.

    Raises:
        ScenarioError: pyarrow is not installed.
    """
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
    about = {
        key: value if isinstance(value, str) else json.dumps(value, default=np.ndarray.tolist)
        for key, value in contents.attributes.items()
    }
    made = pa.Table.from_arrays([pa.array(column.values) for column in table], schema=pa.schema(fields, about))
    target = io.BytesIO()
    pq.write_table(made, target)
    return target.getvalue()


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
    lines = [line for line in data_set.index if line.failed is None]
    with working_folder(out) as place:
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
def working_folder(out: Path) -> Iterator[Path]:
    """Make a temporary folder on the disk of the result; it is removed in the end, and on errors `out` with it if new.

    Args:
        out: Folder of the results, made if missing.
    """
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


def _checked(data_set: DataSet, line: IndexEntry) -> Contents:
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


def _describe(data_set: DataSet, lines: Sequence[IndexEntry], folder: Path, name: str) -> None:
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
    write_checksums(folder)


def write_checksums(folder: Path) -> None:
    """Write the checksums of all files in a folder, as `sha256sum --check` reads them."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    sums = "".join(f"{file_hash(path)}  {path.relative_to(folder).as_posix()}\n" for path in files)
    (folder / SUMS).write_text(sums, encoding="utf-8")
