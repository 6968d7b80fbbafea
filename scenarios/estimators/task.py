"""What an estimator is asked beside the data."""

from collections.abc import Mapping
from dataclasses import dataclass

from scenarios.files.errors import ScenarioError
from sysid.records.arrays import FloatArray, Locked, lock

PROTOCOL = 1
"""Version of the contract: of what is given and what is taken back. It changes when an old program would fail."""

STRUCTURES = {
    "arx": ("na", "nb", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "oe": ("nb", "nf", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
    "ss": ("order",),
}
"""Structures by name, with their orders; `nk = 1`: y(t) depends on u(t-1) first. `ss` is without direct term."""


@dataclass(frozen=True, eq=False)
class Task(Locked):
    """What is asked of an estimator.

    Attributes:
        structure: One of `STRUCTURES`: the one that the estimator says it has, or else that of the system.
        orders: By the names of the structure; empty where the estimator is to choose them.
        most_order: Where it is to choose: the highest order of the dynamics from input to output.
        frequencies: At which a claimed covariance of the response counts (nf,), Hz.
        seed: For estimators that draw random numbers.
    """

    structure: str
    orders: Mapping[str, int]
    most_order: int
    frequencies: FloatArray
    seed: int = 0

    def __post_init__(self) -> None:
        if self.structure not in STRUCTURES:
            raise ScenarioError(f"structure {self.structure!r} given, expected one of {', '.join(STRUCTURES)}")
        if self.orders and set(self.orders) != set(STRUCTURES[self.structure]):
            raise ScenarioError(
                f"orders {', '.join(self.orders)} given, expected {', '.join(STRUCTURES[self.structure])} or none"
            )
        object.__setattr__(self, "frequencies", lock(self.frequencies))

    @property
    def chooses(self) -> bool:
        """Whether the estimator is to choose the orders."""
        return not self.orders
