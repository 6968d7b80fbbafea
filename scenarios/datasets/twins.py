"""Randomised twins of a data set."""

from collections.abc import Mapping
from dataclasses import dataclass

from hmtb_twin.errors import TwinError
from hmtb_twin.specimen_draw import TwinDistributions
from scenarios.errors import ScenarioError
from scenarios.toml_values import typed, written

MOST = 10**7
"""More twins than that are a slip of the keyboard."""


@dataclass(frozen=True)
class Twins:
    """Arms drawn at random, on each of which every experiment is run.

    Attributes:
        count: How many.
        distributions: How they differ from the variant, and their surroundings from what the block says.
    """

    count: int
    distributions: TwinDistributions = TwinDistributions()  # noqa: RUF009

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST:
            raise ScenarioError(f"twins: count = {self.count} given, expected 1 to {MOST}")

    @classmethod
    def from_table(cls, table: object) -> "Twins":
        """Build it from parsed TOML, strictly: count, and a table of kind, spread and centre per quantity.

        Raises:
            ScenarioError: No table, an unknown key, or a value of a wrong type or out of range.
        """
        if not isinstance(table, Mapping):
            raise ScenarioError(f"twins must be a table, given {table!r}")
        if "count" not in table:
            raise ScenarioError("twins needs count")
        quantities = {key: value for key, value in table.items() if key != "count"}
        try:
            distributions = TwinDistributions.from_table(quantities)
        except TwinError as error:
            raise ScenarioError(f"twins: {error}") from error
        return cls(typed("twins.count", table["count"], int), distributions)

    def to_toml(self) -> str:
        """Write it as a TOML table."""
        return f"[twins]\ncount = {written(self.count)}\n{self.distributions.to_toml()}"
