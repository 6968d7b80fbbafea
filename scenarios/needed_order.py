"""How much an input must excite for the models of the study.

An experiment without feedback informs on a model if its input is persistently exciting of the order of numerator and
denominator together: na + nb for ARMAX, nb + nf for OE; a least-squares regression on p past inputs and the present
one, as OKID's, takes p + 1 [Ljung1999, sec. 13.2; Soderstrom1989, sec. 5.4]. `sysid` warns by the same rule.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from types import MappingProxyType

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
    from scenarios.thesis.structures import STRUCTURES

    entries = {entry for structures in STRUCTURES.values() for entry in structures}
    needed = {
        f"{entry.estimator} {' '.join(map(str, entry.orders))}": NEEDED[entry.estimator](entry.orders)
        for entry in entries
    }
    return MappingProxyType(dict(sorted(needed.items(), key=lambda item: (item[1], item[0]))))


def shortcoming(order: int) -> str | None:
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
