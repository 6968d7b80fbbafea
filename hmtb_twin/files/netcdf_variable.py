"""Variables of NetCDF4 files."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

Attribute = str | int | float | np.ndarray
"""Types of an attribute."""

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
"""Beginning of the name that NetCDF4 gives an array which only states the length of a dimension."""


@dataclass(frozen=True)
class Variable:
    """A variable of a file.

    Attributes:
        dims: Names of its dimensions, one per axis.
        values: Numbers, or texts.
        attributes: Unit, meaning, role.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: Mapping[str, Attribute]
