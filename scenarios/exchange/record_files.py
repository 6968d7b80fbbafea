"""A record in the files of other programs: .mat, CSV with its metadata, the ASCII flat file."""

import io
import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hmtb_twin.files.netcdf import Contents
from scenarios.datasets.data_set import sampling_time
from scenarios.datasets.variables import WINDOW
from scenarios.files.errors import ScenarioError

LARGEST = 2**31 - 2**10
"""Bytes of a variable that version 5 of .mat files can hold, with room for its head."""


class ExportColumn(NamedTuple):
    """A column of numbers (N,), whole or float64; `name` is valid in MATLAB, too, and `unit` 1 for plain numbers.

    Where outputs are withheld, `values` ends with the initialisation window, and `withheld` samples follow.
    """

    name: str
    unit: str
    role: str
    meaning: str
    values: np.ndarray
    withheld: int = 0

    @property
    def with_nan(self) -> np.ndarray:
        """Values of all samples; withheld ones are NaN, and the column then holds float64."""
        if not self.withheld:
            return self.values
        return np.concatenate([self.values, np.full(self.withheld, np.nan)])


def columns(contents: Contents) -> tuple[ExportColumn, ...]:
    """Return all numbers of a record, a column per channel, number and time of the sample first.

    Raises:
        ScenarioError: Numbers that do not run over the samples.
    """
    table: list[ExportColumn] = []
    for name, variable in contents.variables.items():
        # Names of channels are in those of the columns, and the window counts samples that are there already.
        if variable.values.dtype.kind == "U" or name == WINDOW:
            continue
        if variable.dims[0] not in ("sample", WINDOW) or variable.values.ndim > 2:
            raise ScenarioError(
                f"{name} has dimensions {', '.join(variable.dims)}, expected sample, or sample and another"
            )
        values = variable.values
        withheld = 0
        if variable.dims[0] == WINDOW:
            withheld = len(contents.variables["sample"].values) - len(values)
        unit, role, meaning = (str(variable.attributes.get(key, "")) for key in ("units", "role", "long_name"))
        if values.ndim == 1:
            table.append(ExportColumn(name, unit, role, meaning, values, withheld))
            continue
        # joint_measured becomes elbow_pitch_measured, and force becomes force_x.
        is_of_joints = name.startswith("joint_")
        pattern = "{}" + name.removeprefix("joint") if is_of_joints else name + "_{}"
        for channel, column in zip(contents.variables[variable.dims[1]].values, values.T, strict=True):
            table.append(ExportColumn(pattern.format(channel), unit, role, meaning, column, withheld))
    # The sort keeps the order of all others.
    return tuple(sorted(table, key=lambda column: ("sample", "t", column.name).index(column.name)))


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
    # Without long names a field of a structure has at most 31 letters.
    savemat(stream, variables | about, oned_as="column", do_compression=True, long_field_names=True)
    # SciPy's head contains the time of day; with this one equal records give equal files.
    head = b"MATLAB 5.0 MAT-file, a record of a data set of the HMTB twin".ljust(116)
    return head + stream.getvalue()[len(head) :]


def csv(contents: Contents) -> bytes:
    """Write a record as CSV: one line of names with units, then a line per sample.

    Numbers have the digits that give every bit back; NaN is a sample that was lost or is withheld.
    """
    table = columns(contents)
    header = ",".join(f"{column.name} [{column.unit}]" for column in table)
    return f"{header}\n{_rows(table, ',')}".encode()


def csv_metadata(contents: Contents, file: str) -> bytes:
    """Write the metadata of a CSV file of that name, in the form of CSV on the Web (W3C)."""
    attributes = {f"hmtb:{key}": value for key, value in contents.attributes.items()}
    metadata = {
        "@context": ["http://www.w3.org/ns/csvw", {"hmtb": "urn:hmtb:"}],
        "url": file,
        **attributes,
        "tableSchema": {"columns": [_csvw_column(column) for column in columns(contents)], "primaryKey": "sample"},
    }
    return (_json(metadata, indent=1) + "\n").encode()


def _csvw_column(column: ExportColumn) -> dict[str, str]:
    """A column in the terms of CSV on the Web."""
    # Withheld samples make NaN, which no whole number is.
    datatype = "integer" if column.with_nan.dtype.kind in "iu" else "double"
    return {
        "name": column.name,
        "titles": f"{column.name} [{column.unit}]",
        "dc:description": column.meaning,
        "datatype": datatype,
        "hmtb:unit": column.unit,
        "hmtb:role": column.role,
    }


def ascii_table(contents: Contents) -> bytes:
    """Write a record as the ASCII flat file [Morris1996, II.5]: lines of comment, then numbers between blanks.

    MATLAB's `load -ascii` and `numpy.loadtxt(..., comments="%")` read it.
    """
    table = columns(contents)
    lines = ["hmtb data set ascii 1"]
    lines += [f"{key}: {_json(value)}" for key, value in contents.attributes.items()]
    lines += [f"sampling time: {sampling_time(contents)} s", f"samples: {len(table[0].with_nan)}", "lost samples: NaN"]
    lines += [f"column {k}: {column.name}, {column.unit}" for k, column in enumerate(table, start=1)]
    header = "".join(f"% {line}\n" for line in lines)
    return f"{header}{_rows(table, ' ')}".encode()


def _rows(table: Sequence[ExportColumn], separator: str) -> str:
    """Lines of numbers, a line per sample; NaN as MATLAB and NumPy write it."""
    # `repr` gives the shortest digits from which every bit comes back.
    words_of_columns = [list(map(repr, column.with_nan.tolist())) for column in table]
    rows = zip(*words_of_columns, strict=True)
    return "".join(f"{separator.join(row)}\n" for row in rows).replace("nan", "NaN")


def _json(value: object, indent: int | None = None) -> str:
    return json.dumps(value, indent=indent, default=np.ndarray.tolist)
