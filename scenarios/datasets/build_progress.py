"""How far a build is."""

from collections.abc import Callable
from dataclasses import dataclass

RECORDS = "records"
"""The step in which experiments are run."""


@dataclass(frozen=True)
class Progress:
    """How far a build is.

    Attributes:
        step: What is being done: ``"check"`` of what an earlier run left, `RECORDS`, the name of a stage, ``"finish"``.
        done: Experiments, or pieces of a stage, that are done.
        total: How many there are.
        seconds: Length of the records that are done, and of what is run of others, s; 0 in other steps.
        seconds_total: Length of all records, s; 0 in other steps.
    """

    step: str
    done: int
    total: int
    seconds: float = 0.0
    seconds_total: float = 0.0


Told = Callable[[Progress], None]
"""Called now and then while a build goes on."""
