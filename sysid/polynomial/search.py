"""The search for the least prediction error from several beginnings."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sysid.polynomial.initial_conditions import Past
from sysid.polynomial.orders import Orders
from sysid.polynomial.prediction_error import Minimum, admissible, minimise
from sysid.records.arrays import FloatArray
from sysid.records.data import IOData

SCREENING_STEPS = 4
AGREED = 0.1  # N dV/V between two beginnings that have come to the same valley
EASY = 20  # steps of a polishing that raises no suspicion


@dataclass(frozen=True)
class Start:
    """A named beginning.

    Attributes:
        name: Method that made it.
        theta: Parameters (p,).
    """

    name: str
    theta: FloatArray


@dataclass(frozen=True)
class Search:
    """Outcome of a search from several beginnings.

    Attributes:
        best: Minimum reached from the best one.
        costs: Sum of squares of each beginning after a few steps.
        chosen: Name of the one that led to the minimum.
    """

    best: Minimum
    costs: dict[str, float]
    chosen: str


def search(
    experiments: Sequence[IOData],
    orders: Orders,
    starts: Iterable[Start],
    *,
    max_iterations: int = 100,
    past: Past = Past.ESTIMATED,
) -> Search:
    """Screen beginnings by a few steps until two agree, polish the best; where that is laborious, try them all.

    Args:
        experiments: Single-output experiments.
        orders: The structure.
        starts: Beginnings, the most promising first; drawn only as far as they are needed.
        max_iterations: Steps of a polishing at most.
        past: What is assumed about the time before each record.
    """
    samples = sum(len(e) for e in experiments)
    remaining = iter(starts)
    screened: dict[str, Minimum] = {}

    def screen(start: Start, good_enough: float = 0.0) -> None:
        if admissible(orders, start.theta):
            screened[start.name] = minimise(
                experiments, orders, start.theta, max_iterations=SCREENING_STEPS, past=past, good_enough=good_enough
            )

    def polish(name: str) -> Minimum:
        found = screened[name]
        if found.converged:
            return found
        return minimise(experiments, orders, found.at, max_iterations=max_iterations, past=past)

    for start in remaining:
        # as good as the best within what agreement means: there is no need to go on
        least = min((found.at.cost for found in screened.values()), default=0.0)
        screen(start, least * (1.0 + AGREED / samples))
        costs = sorted(found.at.cost for found in screened.values())
        if len(costs) > 1 and samples * (costs[1] - costs[0]) <= AGREED * costs[0]:
            break
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    best = polish(chosen)
    if not best.converged or best.iterations > EASY:
        for start in remaining:
            screen(start)
        for name in sorted(screened, key=lambda name: screened[name].at.cost):
            if name != chosen and (other := polish(name)).at.cost < best.at.cost:
                best, chosen = other, name
    return Search(best, {name: found.at.cost for name, found in screened.items()}, chosen)
