"""Randomised twins of a data set."""

from collections.abc import Mapping
from dataclasses import dataclass

from scenarios.errors import ScenarioError
from scenarios.suggest import unknown
from scenarios.toml_values import typed, written

MOST = 10**7
"""More twins than that are a slip of the keyboard."""


@dataclass(frozen=True)
class Twins:
    """How many twins are drawn.

    Attributes:
        count: How many.
    """

    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST:
            raise ScenarioError(f"twins: count = {self.count} given, expected 1 to {MOST}")

    @classmethod
    def from_table(cls, table: object) -> "Twins":
        """Build it from parsed TOML, strictly.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping):
            raise ScenarioError(f"twins must be a table, given {table!r}")
        for key in table:
            if key != "count":
                raise ScenarioError(f"twins: {unknown('key', key, ('count',))}")
        if "count" not in table:
            raise ScenarioError("twins needs count")
        return cls(typed("twins.count", table["count"], int))

    def to_toml(self) -> str:
        """Write it as a TOML table."""
        return f"[twins]\ncount = {written(self.count)}\n"
