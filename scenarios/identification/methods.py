"""The analyst's estimators by name, each with its orders in the field's notation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

import sysid
from scenarios.files.errors import ScenarioError, unknown
from sysid import Estimate, IOData
from sysid.validation.structure_scan import Order

Records = IOData | Sequence[IOData]


@dataclass(frozen=True)
class Structure:
    """Names of the orders of a method.

    Attributes:
        orders: Names of the required orders.
        optional: Names of the optional orders that follow, with their defaults.
    """

    orders: tuple[str, ...]
    optional: Mapping[str, int]

    @property
    def usage(self) -> str:
        """The orders in their sequence, optional ones in brackets."""
        return " ".join([*self.orders, *(f"[{name}]" for name in self.optional)])

    def complete(self, name: str, given: Sequence[Order]) -> dict[str, Order]:
        """Return all orders by name, defaults filled in.

        Raises:
            ScenarioError: Too few, too many, or negative.
        """
        names = (*self.orders, *self.optional)
        if not len(self.orders) <= len(given) <= len(names):
            shown = " ".join(map(str, given)) or "nothing"
            raise ScenarioError(f"{name} takes the orders {self.usage}; given {shown}")
        if any(np.min(order) < 0 for order in given):
            raise ScenarioError(
                f"orders must be 0 or more, given {' '.join(map(str, given))}; {name} takes {self.usage}"
            )
        defaults = list(self.optional.values())[len(given) - len(self.orders) :]
        return dict(zip(names, (*given, *defaults), strict=True))


@dataclass(frozen=True)
class Estimator(Structure):
    """An estimator and the names of its orders.

    Attributes:
        run: Estimate from data and all orders, with options of the estimator.
        title: What it is, in words.
        outputs: Whether it takes several outputs.
    """

    run: Callable[..., Estimate]
    title: str
    outputs: bool = False


ESTIMATORS: Mapping[str, Estimator] = MappingProxyType(
    {
        "arx": Estimator(("na", "nb"), {"nk": 1}, lambda data, n: sysid.arx(data, *n), "least squares"),
        "armax": Estimator(("na", "nb", "nc"), {"nk": 1}, lambda data, n: sysid.armax(data, *n), "prediction error"),
        "oe": Estimator(
            ("nb", "nf"), {"nk": 1}, lambda data, n, **options: sysid.oe(data, *n, **options), "output error"
        ),
        "bj": Estimator(("nb", "nc", "nd", "nf"), {"nk": 1}, lambda data, n: sysid.bj(data, *n), "Box-Jenkins"),
        "iv4": Estimator(("na", "nb"), {"nk": 1}, lambda data, n: sysid.iv4(data, *n), "instrumental variables"),
        "okid": Estimator(
            ("order",), {"p": 5}, lambda data, n: sysid.okid(data, n[0], p=n[1]), "observer, realisation", outputs=True
        ),
        "n4sid": Estimator(("order",), {}, lambda data, n: sysid.n4sid(data, n[0]), "subspace", outputs=True),
        "pem_ss": Estimator(
            ("order",),
            {},
            lambda data, n: sysid.pem_ss(data, sysid.n4sid(data, n[0])),
            "state space, prediction error",
            outputs=True,
        ),
    }
)
"""Every estimator of the command line."""


def estimate(data: Records, method: str, orders: Sequence[Order], **options: bool) -> Estimate:
    """Run an estimator by name.

    Args:
        data: Input and output, of one experiment or several.
        method: One of `ESTIMATORS`.
        orders: Its orders in their usual sequence; optional ones may be left out.
        options: Options of the estimator, such as `coloured` of oe.

    Raises:
        ScenarioError: Unknown method, or orders that do not fit it.
    """
    if method not in ESTIMATORS:
        raise ScenarioError(unknown("method", method, ESTIMATORS))
    records = data if isinstance(data, IOData) or len(data) != 1 else data[0]
    return ESTIMATORS[method].run(records, list(ESTIMATORS[method].complete(method, orders).values()), **options)
