"""The search for the least prediction error from several beginnings."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sysid.arrays import FloatArray
from sysid.data import IOData
from sysid.orders import Orders
from sysid.past import Past
from sysid.prediction_error import Minimum, admissible, minimise

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

    def descend(theta: FloatArray, steps: int) -> Minimum:
        return minimise(experiments, orders, theta, max_iterations=steps, past=past)

    def polish(name: str) -> Minimum:
        found = screened[name]
        return found if found.converged else descend(found.at.theta, max_iterations)

    agreed = False
    for start in remaining:
        if admissible(orders, start.theta):
            found = descend(start.theta, SCREENING_STEPS)
            agreed = any(_agree(found, other, samples) for other in screened.values())
            screened[start.name] = found
        if agreed:
            break
    chosen = min(screened, key=lambda name: screened[name].at.cost)
    best = polish(chosen)
    if not best.converged or best.iterations > EASY:
        for start in remaining:
            if admissible(orders, start.theta):
                screened[start.name] = descend(start.theta, SCREENING_STEPS)
        for name in sorted(screened, key=lambda name: screened[name].at.cost):
            if name != chosen and (other := polish(name)).at.cost < best.at.cost:
                best, chosen = other, name
    return Search(best, {name: found.at.cost for name, found in screened.items()}, chosen)


def _agree(one: Minimum, other: Minimum, samples: int) -> bool:
    return samples * abs(one.at.cost - other.at.cost) <= AGREED * min(one.at.cost, other.at.cost)
