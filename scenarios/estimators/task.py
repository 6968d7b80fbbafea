"""Task of an estimator: structure, orders, frequencies; and how a method refuses what it does not do."""

from collections.abc import Mapping
from dataclasses import dataclass

from scenarios.files.errors import ScenarioError
from sysid import IOData
from sysid.polynomial.structures import STRUCTURES
from sysid.records.arrays import FloatArray, Locked, lock

PROTOCOL = 1
"""Version of the protocol in docs/estimator-protocol.md. It changes when an old program would fail."""


@dataclass(frozen=True, eq=False)
class Task(Locked):
    """Request to an estimator for one record.

    Attributes:
        structure: One of `STRUCTURES`: the one that the estimator declares, or else that of the system.
        orders: By the names of the structure; empty where the estimator chooses them.
        most_order: Where it chooses: the highest order of the dynamics from input to output.
        frequencies: At which a claimed covariance of the response is judged (nf,), Hz.
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
        """Whether the estimator chooses the orders."""
        return not self.orders


def require(
    task: Task,
    structure: str,
    data: IOData | None = None,
    *,
    inputs: int | None = None,
    delayed: bool = False,
    no_choice: str = "",
) -> None:
    """Refuse a task that a method does not do, before anything is computed; a refusal is no failure.

    Args:
        task: What is asked.
        structure: The only structure of the method.
        data: The record, where the method takes one output only.
        inputs: Most inputs that it takes then; None: any number.
        delayed: Whether the method needs a delay of one sample at least.
        no_choice: Why the method cannot choose orders; empty where it can.

    Raises:
        NotImplementedError: The method does not do this.
    """
    if task.structure != structure:
        raise NotImplementedError(f"structure {task.structure!r} asked for, this method has {structure!r}")
    if data is not None and data.ny > 1:
        raise NotImplementedError(f"{data.ny} outputs given, this method takes 1")
    if data is not None and inputs is not None and data.nu > inputs:
        raise NotImplementedError(f"{data.nu} inputs given, this method takes {inputs}")
    if delayed and task.orders.get("nk", 1) < 1:
        raise NotImplementedError("nk = 0 asked for, this method has a delay of one sample at least")
    if no_choice and task.chooses:
        raise NotImplementedError(f"no choice of orders: {no_choice}")
