"""The numbers of a record as columns of a table, each with a name and a unit."""

from dataclasses import dataclass

import numpy as np

from scenarios.datasets.hidden_record import WINDOW
from scenarios.datasets.netcdf import Contents, Variable
from scenarios.errors import ScenarioError

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
