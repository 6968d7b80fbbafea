"""Variables of the files of a data set, each with dimensions, unit and meaning from one table."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from hmtb_twin.files.netcdf import Attribute, Variable
from scenarios.files.toml_file import package_table

GIVEN = ("sample", "t", "u", "joint_commanded")
"""Variables of a scored record that are published for all samples even where the truth is withheld."""

WINDOW = "window_sample"
"""Dimension of what is published for the initialisation window alone."""


def netcdf_variables(file_kind: str, values: Mapping[str, object], prefix: str = "") -> dict[str, Variable]:
    """Return values as variables of a NetCDF file, with the dimensions and attributes of the table of variables.

    Args:
        file_kind: Kind of the file: `data`, `signals`, `arm` or `best_linear`.
        values: Their values by name.
        prefix: Begin of the names of variables and of their dimensions but `part`.
    """
    variables = {}
    for name, value in values.items():
        attributes = dict(_table()[file_kind][name])
        dims = tuple(_with_prefix(dim, prefix) for dim in attributes.pop("along"))
        variables[f"{prefix}{name}"] = Variable(dims, np.asarray(value), attributes)
    return variables


def _with_prefix(dim: str, prefix: str) -> str:
    # Real and imaginary part are those of every joint: the dimension is there once, without prefix.
    return dim if dim == "part" else f"{prefix}{dim}"


@cache
def _table() -> dict[str, Any]:
    return package_table("data_set_variables.toml")


PROVENANCE = "provenance_"
"""Begin of the names of attributes that state the provenance of a file."""


def provenance_attributes(provenance: Mapping[str, str]) -> dict[str, str]:
    """Return a provenance as attributes of a file."""
    return {f"{PROVENANCE}{key}": value for key, value in provenance.items()}


def provenance_of(attributes: Mapping[str, Attribute]) -> dict[str, str]:
    """Return the provenance that the attributes of a file state."""
    stated = {name: value for name, value in attributes.items() if name.startswith(PROVENANCE)}
    return {name.removeprefix(PROVENANCE): str(value) for name, value in stated.items()}
