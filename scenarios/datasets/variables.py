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


def described(kind: str, values: Mapping[str, object], prefix: str = "") -> dict[str, Variable]:
    """Return the variables of a file by name.

    Args:
        kind: Kind of the file: `data`, `signals`, `arm` or `best_linear`.
        values: Their values by name.
        prefix: Begin of the names of variables and of their dimensions but `part`.
    """
    variables = {}
    for name, value in values.items():
        attributes = dict(_table()[kind][name])
        dims = [dim if dim == "part" else prefix + dim for dim in attributes.pop("along")]
        variables[prefix + name] = Variable(tuple(dims), np.asarray(value), attributes)
    return variables


@cache
def _table() -> dict[str, Any]:
    return package_table("data_set_variables.toml")


def provenance_of(attributes: Mapping[str, Attribute]) -> dict[str, str]:
    """Return the provenance that the attributes of a file state."""
    return {key[11:]: str(value) for key, value in attributes.items() if key.startswith("provenance_")}
