"""Records as text: CSV, and the ASCII flat file of the thesis."""

import json

import numpy as np

from scenarios.datasets.columns import Column, columns
from scenarios.datasets.data_record import sampling_time
from scenarios.datasets.netcdf import Contents

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
