"""Model structures of the study, and the order of excitation that they need."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType


@dataclass(frozen=True)
class Structure:
    """A model structure to identify.

    Attributes:
        method: Key of the method in tables and figures.
        estimator: Name of the estimator.
        orders: Its orders.
        chosen: Whether the thesis takes it into a three-joint model.
        label: Text for tables and legends.
    """

    method: str
    estimator: str
    orders: tuple[int, ...]
    chosen: bool
    label: str


SUFFICIENT = {"shoulder_yaw": (4, 3, 2), "shoulder_pitch": (5, 3, 1), "elbow_pitch": (4, 3, 2)}
"""nb, nf, nk of the output-error model whose order suffices without friction; on the arm as it is, none does.

The Bayesian information criterion [Schwarz1978] chose them, summed over five frictionless records of small amplitude
with seeds that nothing else here uses, nb up to 6, nf up to 5, nk as published; `tests/benchmarks/test_order.py`
chooses again.
"""


def _sufficient(joint: str) -> "Structure":
    nb, nf, nk = SUFFICIENT[joint]
    return Structure("oe_high", "oe", (nb, nf, nk), False, f"OE {nb}/{nf}, delay {nk}, sufficient without friction")


_OKID = Structure("okid", "okid", (2, 5), True, "OKID order 2, p = 5")

STRUCTURES: Mapping[str, tuple[Structure, ...]] = {
    "shoulder_yaw": (
        Structure("armax", "armax", (5, 3, 5, 2), True, "ARMAX 5/3/5, delay 2"),
        Structure("oe", "oe", (2, 2, 2), False, "OE 2/2, delay 2"),
        _OKID,
        _sufficient("shoulder_yaw"),
    ),
    "shoulder_pitch": (
        Structure("armax", "armax", (2, 2, 2, 1), False, "ARMAX 2/2/2, delay 1"),
        Structure("oe", "oe", (2, 2, 1), True, "OE 2/2, delay 1"),
        _OKID,
        _sufficient("shoulder_pitch"),
    ),
    "elbow_pitch": (
        Structure("armax", "armax", (2, 2, 2, 2), True, "ARMAX 2/2/2, delay 2"),
        Structure("oe", "oe", (2, 2, 2), False, "OE 2/2, delay 2"),
        _OKID,
        _sufficient("elbow_pitch"),
    ),
}
"""What is identified: the thesis' structures, those it does not use filled in so that the table is complete, and one
of sufficient order beside them."""


def every_structure(joint: str) -> tuple[Structure, ...]:
    """ARX, ARMAX, IV4 and OE with the thesis' orders of a joint, and OKID beside them [Morris1996, ch. IV and V].

    The thesis gives no orders for ARX and IV4: they get those that they share with its ARMAX.
    """
    own = {entry.method: entry for entry in STRUCTURES[joint]}
    na, nb, _, nk = own["armax"].orders
    equation_error = {
        name: Structure(name, name, (na, nb, nk), False, f"{name.upper()} {na}/{nb}, delay {nk}")
        for name in ("arx", "iv4")
    }
    return equation_error["arx"], own["armax"], equation_error["iv4"], own["oe"], own["okid"]


NEEDED: Mapping[str, Callable[[tuple[int, ...]], int]] = MappingProxyType(
    {
        "arx": lambda orders: orders[1],
        "armax": lambda orders: orders[0] + orders[1],
        "oe": lambda orders: orders[0] + orders[1],
        "okid": lambda orders: orders[1] + 1,
    }
)
"""Order of excitation that an estimator needs, by its orders as the command line takes them."""


@cache
def needed_orders() -> Mapping[str, int]:
    """Order of excitation that each model of the study needs, by estimator and orders, the undemanding first."""
    entries = {entry for structures in STRUCTURES.values() for entry in structures}
    needed = {
        f"{entry.estimator} {' '.join(map(str, entry.orders))}": NEEDED[entry.estimator](entry.orders)
        for entry in entries
    }
    return MappingProxyType(dict(sorted(needed.items(), key=lambda item: (item[1], item[0]))))


def excitation_order_warning(order: int) -> str | None:
    """Say for which models of the study an order of excitation is too low.

    Args:
        order: Order of persistent excitation.

    Returns:
        One line, which takes the models of an estimator together, or None if it is enough for all.
    """
    missed = {label: needed for label, needed in needed_orders().items() if needed > order}
    if not missed:
        return None
    every = len(needed_orders())
    if len(missed) == every:
        return (
            f"order of excitation {order} is too low for every model of the study: they need {_span(missed.values())}"
        )
    by_estimator: dict[str, list[int]] = {}
    for label, needed in missed.items():
        by_estimator.setdefault(label.split()[0], []).append(needed)
    models = ", ".join(f"{name} ({_span(needed)})" for name, needed in by_estimator.items())
    return f"order of excitation {order} is too low for {len(missed)} of the {every} models of the study: {models}"


def _span(values: Iterable[int]) -> str:
    low, high = min(values := list(values)), max(values)
    return f"{low} to {high}" if high > low else str(low)
