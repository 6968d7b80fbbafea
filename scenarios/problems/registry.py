"""Names of all problems of the test bench, and the problem of each name."""

import re
from collections.abc import Callable, Collection
from functools import lru_cache
from itertools import chain, product

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

_Maker = Callable[[str, str, int | None], Problem]
"""Makes a problem from the name of its system, its own name and the number of samples, where that is stated."""

_FAMILIES: dict[str, tuple[Collection[str], _Maker]] = {
    "textbook": (SYSTEMS, textbook),
    "published": (PUBLISHED, textbook),
    "feedback": (FEEDBACK, textbook),
    "shared": (SHARED, shared),
    "mimo": (MIMO, mimo),
}


@lru_cache(maxsize=256)
def problem(name: str) -> Problem:
    """Make the problem of a name, the same in any process.

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
    # A problem of another length has the same system and the same noise.
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
    raise ScenarioError(unknown("problem", plain, list(chain.from_iterable(names().values()))))


def names() -> dict[str, tuple[str, ...]]:
    """Names of all problems but those of the arm, by family; of random ones the first few of 9999."""
    by_family = {family: tuple(members) for family, (members, _) in _FAMILIES.items()}
    by_family["quiet"] = tuple(f"quiet-{order}-{delay}" for order, delay in product(ORDERS, DELAYS))
    numbered = product(DIFFICULTIES, range(1, LISTED + 1))
    by_family["random"] = tuple(f"random-{difficulty}-{index}" for difficulty, index in numbered)
    return by_family
