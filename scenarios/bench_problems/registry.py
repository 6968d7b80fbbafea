"""Problems by name."""

import re
from functools import lru_cache

from scenarios.bench_problems.problem import Problem
from scenarios.bench_problems.textbook import TEXTBOOK, textbook
from scenarios.errors import ScenarioError
from scenarios.suggest import unknown

FEWEST = 200
"""Samples that a record has at least."""


@lru_cache(maxsize=256)
def problem(name: str) -> Problem:
    """A problem, the same in any process.

    Args:
        name: One of `names`, or another of its family; of synthetic problems `@SAMPLES` may end it: `p2@2000`.

    Raises:
        ScenarioError: There is none of that name.
    """
    if name.startswith("twin-"):
        # it loads the physics
        from scenarios.bench_problems.twin_problem import twin_problem

        return twin_problem(name)
    plain, at, length = name.partition("@")
    if at and not (re.fullmatch(r"[1-9]\d{0,6}", length) and int(length) >= FEWEST):
        raise ScenarioError(f"{name!r}: expected a whole number of samples from {FEWEST} on behind @, got {length!r}")
    samples = int(length) if at else None
    if plain in TEXTBOOK:
        return textbook(plain, name, samples)
    raise ScenarioError(unknown("problem", plain, [entry for family in names().values() for entry in family]))


def names() -> dict[str, tuple[str, ...]]:
    """Synthetic problems by family; of endless families the first few."""
    return {"textbook": tuple(TEXTBOOK)}
