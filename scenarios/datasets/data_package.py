"""The data set as a Data Package of the Frictionless standards: every file with size and hash, tables with a schema."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

from scenarios.datasets.experiment_table import COLUMNS
from scenarios.datasets.license import NAME, SPDX, URL
from scenarios.datasets.listing import Listed
from scenarios.datasets.spec import DataSetSpec

KINDS = (("integer", int), ("number", float))
"""Kinds of columns but for texts, narrowest first."""


def data_package(
    spec: DataSetSpec, whole: str, files: Sequence[Listed], schemas: Mapping[str, Mapping[str, Any]]
) -> Mapping[str, Any]:
    """The description.

    Args:
        spec: The data set.
        whole: Hash of its arrays.
        files: Its files.
        schemas: Of those that are tables, by path.
    """
    names: dict[str, str] = {}
    return {
        "profile": "data-package",
        "name": _name(spec.label, {}),
        "id": f"sha256:{whole}",
        "title": spec.title,
        **({"description": spec.description} if spec.description else {}),
        **({"homepage": spec.url} if spec.url else {}),
        "version": f"{spec.version}.0.0",
        "licenses": [{"name": SPDX, "title": NAME, "path": URL}],
        "contributors": [{"title": name, "role": "author"} for name in spec.creators],
        "keywords": list(spec.keywords),
        "resources": [_resource(one, _name(one.path, names), schemas.get(one.path)) for one in files],
    }


def experiments_schema() -> Mapping[str, Any]:
    """Schema of the table of experiments."""
    return {
        "fields": [
            {
                "name": column.name,
                "type": column.kind,
                "description": column.description,
                "constraints": {"required": True, **({"unique": True} if column.name == "name" else {})},
            }
            for column in COLUMNS
        ],
        "primaryKey": ["name"],
    }


def table_schema(text: str) -> Mapping[str, Any]:
    """Schema of a table by what stands in it.

    Args:
        text: CSV, a heading first.
    """
    heading, *rows = csv.reader(io.StringIO(text))
    return {"fields": [{"name": name, "type": _kind([row[i] for row in rows])} for i, name in enumerate(heading)]}


def _kind(cells: Sequence[str]) -> str:
    filled = [cell for cell in cells if cell]
    for kind, convert in KINDS:
        if filled and all(_is(cell, convert) for cell in filled):
            return kind
    return "string"


def _is(cell: str, convert: type[int] | type[float]) -> bool:
    # The standard writes numbers as XML Schema does: no underscores, no spaces.
    try:
        convert(cell)
    except ValueError:
        return False
    return "_" not in cell and cell == cell.strip()


def _resource(one: Listed, name: str, schema: Mapping[str, Any] | None) -> Mapping[str, Any]:
    return {
        "name": name,
        "path": one.path,
        "format": one.suffix.lstrip(".") or "txt",
        "mediatype": one.media,
        "bytes": one.size,
        "hash": f"sha256:{one.sha256}",
        **({"profile": "tabular-data-resource", "encoding": "utf-8", "schema": schema} if schema else {}),
    }


def _name(path: str, taken: dict[str, str]) -> str:
    """A name as the standard wants it: lower case, and each once."""
    plain = re.sub(r"[^a-z0-9._/-]", "-", path.lower())
    name, number = plain, 2
    while taken.setdefault(name, path) != path:
        name, number = f"{plain}-{number}", number + 1
    return name
