"""The nonlinear baselines of data sets by name, each with its orders."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from scenarios.files.errors import ScenarioError
from scenarios.identification.methods import Structure
from sysid import IOData
from sysid.records.arguments import shortened
from sysid.validation.predictors import Predictor


class Known(NamedTuple):
    """What a method may know besides the records.

    Attributes:
        seed: Of its random draws; that of the data set's spec.
        dead_zones: Half width of the dead zone of each training record's arm, rad, from the truth.
        dead_zone: That of the arm to predict, rad.
    """

    seed: int = 0
    dead_zones: tuple[float, ...] = ()
    dead_zone: float = 0.0


MOST_ORDER = 100
"""Largest order that is tried at all: a slip of the keyboard would fill the memory."""

RECORDS_ALONE = Known()
"""Nothing is known besides the records."""


@dataclass(frozen=True)
class NonlinearMethod(Structure):
    """A method that makes a predictor of one output.

    Attributes:
        run: Make the predictor from records of one output, all orders and what is known.
        title: What it is, in words.
        least: Least value of each order.
        truth: Whether it needs the dead zones of the truth.
    """

    run: Callable[[Sequence[IOData], Sequence[int], Known], Predictor]
    title: str
    least: Mapping[str, int]
    truth: bool = False

    def checked(self, name: str, given: Sequence[int]) -> dict[str, int]:
        """Return all orders by name, defaults filled in.

        Raises:
            ScenarioError: Too few, too many, or below the least.
        """
        orders = {order: int(np.max(value)) for order, value in self.complete(name, given).items()}
        for order, lowest in self.least.items():
            value = orders[order]
            if value < lowest:
                raise ScenarioError(
                    f"{name}: {order} = {value} given, expected {lowest} or more; it takes {self.usage}"
                )
            if value > MOST_ORDER:
                shown = shortened(str(value), 20)
                raise ScenarioError(f"{name}: {order} = {shown} given, expected {MOST_ORDER} or less")
        return orders


# The models are imported when they are first used: Numba and the fits would slow the command line's help.
def _narx(records: Sequence[IOData], orders: Sequence[int], _: Known) -> Predictor:
    from scenarios.identification.narx import narx

    na, nb, nk, degree = orders
    return narx(records, na, nb, nk, degree)


def _neural_ss(records: Sequence[IOData], orders: Sequence[int], known: Known) -> Predictor:
    from scenarios.identification.neural_state_space import neural_ss

    order, neurons = orders
    return neural_ss(records, order, neurons, seed=known.seed)


def _hammerstein(records: Sequence[IOData], orders: Sequence[int], known: Known) -> Predictor:
    from scenarios.identification.hammerstein_loop import hammerstein_loop

    nb, nf, nk = orders
    return hammerstein_loop(records, nb, nf, nk, widths=known.dead_zones, width=known.dead_zone)


NONLINEAR: Mapping[str, NonlinearMethod] = MappingProxyType(
    {
        "narx": NonlinearMethod(
            ("na", "nb", "nk", "degree"),
            {},
            _narx,
            "polynomial NARX, terms by forward regression",
            {"na": 1, "nb": 1, "degree": 1},
        ),
        "neural_ss": NonlinearMethod(
            ("order", "neurons"), {}, _neural_ss, "neural state space", {"order": 1, "neurons": 1}
        ),
        "hammerstein": NonlinearMethod(
            ("nb", "nf"),
            {"nk": 1},
            _hammerstein,
            "linear loop with the known dead zone",
            {"nb": 1, "nf": 1, "nk": 1},
            truth=True,
        ),
    }
)
"""Methods of baselines that are no estimators of the command line's `hmtb identify`: their models are not linear."""
