"""Records as text: CSV, and the ASCII flat file of the thesis."""

import json
from dataclasses import dataclass

import numpy as np

from scenarios.datasets.data_record import WINDOW, sampling_time
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import Contents, Variable

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
