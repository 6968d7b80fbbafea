"""The analyst's estimators by name, for the command line; each with its orders in the field's notation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import sysid
from scenarios.files.errors import ScenarioError, unknown
from sysid import Estimate, IOData


@dataclass(frozen=True)
class Estimator:
    """An estimator and what its orders are called.

    Attributes:
        orders: Names of the orders that must be given.
        optional: Names of those that may follow, with their defaults.
        run: Estimate from data and all orders.
        meaning: One line for help.
        outputs: Whether it takes several outputs.
        gaps: Whether it uses records in which outputs are missing.
    """

    orders: tuple[str, ...]
    optional: Mapping[str, int]
    run: Callable[[IOData | Sequence[IOData], Sequence[int]], Estimate]
    meaning: str
    outputs: bool = False
    gaps: bool = True

    def complete(self, name: str, given: Sequence[int]) -> dict[str, int]:
        """All orders by name.

        Args:
            name: Name of the estimator, for the message.
            given: Orders as typed.

        Returns:
            Orders by name, defaults filled in.

        Raises:
            ScenarioError: Too few, too many, or negative.
        """
        names = (*self.orders, *self.optional)
        usage = " ".join([*self.orders, *(f"[{entry}]" for entry in self.optional)])
        if not len(self.orders) <= len(given) <= len(names):
            shown = " ".join(map(str, given)) or "nothing"
            raise ScenarioError(f"{name} takes the orders {usage}; given {shown}")
        if any(order < 0 for order in given):
            raise ScenarioError(f"orders must be 0 or more, given {' '.join(map(str, given))}; {name} takes {usage}")
        defaults = list(self.optional.values())[len(given) - len(self.orders) :]
        return dict(zip(names, (*given, *defaults), strict=True))


SHORTEST = 100
"""Parts with fewer samples between two gaps are left out: the past of a model would take most of them."""

ESTIMATORS: Mapping[str, Estimator] = MappingProxyType(
    {
        "arx": Estimator(
            ("na", "nb"),
            {"nk": 1},
            lambda data, n: sysid.arx(data, n[0], n[1], n[2]),
            "A y = B u + e, linear least squares",
        ),
        "armax": Estimator(
            ("na", "nb", "nc"),
            {"nk": 1},
            lambda data, n: sysid.armax(data, n[0], n[1], n[2], n[3]),
            "A y = B u + C e, prediction error",
        ),
        "oe": Estimator(
            ("nb", "nf"),
            {"nk": 1},
            lambda data, n: sysid.oe(data, n[0], n[1], n[2]),
            "y = B/F u + e, output error",
        ),
        "bj": Estimator(
            ("nb", "nc", "nd", "nf"),
            {"nk": 1},
            lambda data, n: sysid.bj(data, n[0], n[1], n[2], n[3], n[4]),
            "y = B/F u + C/D e, Box-Jenkins, prediction error",
        ),
        "iv4": Estimator(
            ("na", "nb"),
            {"nk": 1},
            lambda data, n: sysid.iv4(data, n[0], n[1], n[2]),
            "A y = B u + noise of any colour, instrumental variables",
        ),
        "okid": Estimator(
            ("order",),
            {"p": 5},
            lambda data, n: sysid.okid(data, n[0], p=n[1]),
            "observer/Kalman filter identification, p observer Markov parameters",
            outputs=True,
        ),
        "n4sid": Estimator(
            ("order",),
            {},
            lambda data, n: sysid.n4sid(data, n[0]),
            "state space, subspace method",
            outputs=True,
            gaps=False,
        ),
        "pem_ss": Estimator(
            ("order",),
            {},
            lambda data, n: sysid.pem_ss(data, _start(data, n[0])),
            "state space, prediction error",
            outputs=True,
        ),
    }
)
"""Every estimator of the command line."""


def _start(data: IOData | Sequence[IOData], order: int) -> Estimate:
    """Where `pem_ss` begins: N4SID on what is complete, OKID where nothing is long enough."""
    parts = (data,) if isinstance(data, IOData) else tuple(data)
    whole = [one for part in parts for one in _complete(part)]
    try:
        return sysid.n4sid(whole, order)
    except sysid.SysidError:
        if all(part.complete for part in parts):
            raise
        return sysid.okid(parts, order, p=max(order, 5))


def _complete(part: IOData) -> tuple[IOData, ...]:
    try:
        return part.complete_parts(shortest=SHORTEST)
    except sysid.SysidError:
        return ()


def estimate(data: IOData | Sequence[IOData], method: str, orders: Sequence[int]) -> tuple[Estimate, dict[str, int]]:
    """Run an estimator by name.

    Args:
        data: Input and output, of one experiment or several.
        method: One of `ESTIMATORS`.
        orders: Its orders in their usual sequence; the last ones may be left out where they have defaults.

    Returns:
        The estimate and all orders by name.

    Raises:
        ScenarioError: Unknown method, or orders that do not fit it.
    """
    if method not in ESTIMATORS:
        raise ScenarioError(unknown("method", method, ESTIMATORS))
    complete = ESTIMATORS[method].complete(method, orders)
    return ESTIMATORS[method].run(data, list(complete.values())), complete
