"""Problems by name."""

import re
from collections.abc import Callable, Collection
from functools import lru_cache

from scenarios.files.errors import ScenarioError, unknown
from scenarios.problems.common_waveform import SHARED, shared
from scenarios.problems.mimo import MIMO, mimo
from scenarios.problems.noise_free import DELAYS, ORDERS, noise_free
from scenarios.problems.problem import Problem
from scenarios.problems.random_problems import DIFFICULTIES, random_problem
from scenarios.problems.textbook import FEEDBACK, PUBLISHED, SYSTEMS, textbook
from scenarios.problems.trial import TWIN

FEWEST = 200
"""Samples that a record has at least."""

LISTED = 3
"""Random problems of each difficulty that `names` lists."""

_FAMILIES: dict[str, tuple[Collection[str], Callable[[str, str, int | None], Problem]]] = {
    "textbook": (SYSTEMS, textbook),
    "published": (PUBLISHED, textbook),
    "feedback": (FEEDBACK, textbook),
    "shared": (SHARED, shared),
    "mimo": (MIMO, mimo),
}


@lru_cache(maxsize=256)
def problem(name: str) -> Problem:
    """A problem, the same in any process.

    Args:
        name: One of `names`, or another of its family; of synthetic problems `@SAMPLES` may end it: `p2@2000`.

    Raises:
        ScenarioError: There is none of that name.
    """
    if name.startswith(TWIN):
        # It loads the physics, which takes a second.
        from scenarios.problems.twin_name import twin_name
        from scenarios.problems.twin_problem import TwinProblem

        return TwinProblem(twin_name(name))
    plain, at, length = name.partition("@")
    if at and not (re.fullmatch(r"[1-9]\d{0,6}", length) and int(length) >= FEWEST):
        raise ScenarioError(f"{name!r}: expected a whole number of samples from {FEWEST} on behind @, got {length!r}")
    samples = int(length) if at else None
    for family, make in _FAMILIES.values():
        if plain in family:
            return make(plain, name, samples)
    if plain in names()["quiet"]:
        _, order, delay = plain.split("-")
        return noise_free(int(order), int(delay), name, samples)
    if match := re.fullmatch(rf"random-({'|'.join(DIFFICULTIES)})-([1-9]\d{{0,3}})", plain):
        return random_problem(match[1], int(match[2]), name, samples)
    raise ScenarioError(unknown("problem", plain, [entry for family in names().values() for entry in family]))


def names() -> dict[str, tuple[str, ...]]:
    """Names of all problems but those of the arm, by family; of random ones the first few of 9999."""
    drawn = {
        "quiet": tuple(f"quiet-{order}-{delay}" for order in ORDERS for delay in DELAYS),
        "random": tuple(f"random-{name}-{number}" for name in DIFFICULTIES for number in range(1, LISTED + 1)),
    }
    return {family: tuple(entries) for family, (entries, _) in _FAMILIES.items()} | drawn
