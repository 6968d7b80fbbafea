"""Model structures of the study, and the order of excitation that they need."""

from collections.abc import Iterable, Mapping
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
        chosen: Whether the thesis uses it in a three-joint model.
        label: Text for tables and legends.
    """

    method: str
    estimator: str
    orders: tuple[int, ...]
    chosen: bool
    label: str


SUFFICIENT = {"shoulder_yaw": (3, 3, 2), "shoulder_pitch": (6, 5, 1), "elbow_pitch": (5, 3, 2)}
"""nb, nf, nk of the output-error model whose order suffices without friction; on the arm as it is, none does.

The Bayesian information criterion [Schwarz1978] chose them, summed over five frictionless records of small amplitude
with seeds that nothing else here uses, nb up to 6, nf up to 5, nk as published; `tests/benchmarks/test_order.py`
chooses again.
"""


def _structures(joint: str, armax: tuple[int, int, int, int], chosen: str) -> tuple[Structure, ...]:
    na, nb, nc, nk = armax
    sufficient = "OE {}/{}, delay {}, sufficient without friction".format(*SUFFICIENT[joint])
    return (
        Structure("armax", "armax", armax, chosen == "armax", f"ARMAX {na}/{nb}/{nc}, delay {nk}"),
        Structure("oe", "oe", (2, 2, nk), chosen == "oe", f"OE 2/2, delay {nk}"),
        Structure("okid", "okid", (2, 5), True, "OKID order 2, p = 5"),
        Structure("oe_high", "oe", SUFFICIENT[joint], False, sufficient),
    )


STRUCTURES: Mapping[str, tuple[Structure, ...]] = {
    "shoulder_yaw": _structures("shoulder_yaw", (5, 3, 3, 2), "armax"),
    "shoulder_pitch": _structures("shoulder_pitch", (2, 2, 2, 1), "oe"),
    "elbow_pitch": _structures("elbow_pitch", (2, 2, 2, 2), "armax"),
}
"""Structures by joint: those of the thesis, further ones so that every joint has all methods, and one of sufficient
order.

Yaw's ARMAX has three coefficients of C: with the printed K, C = A + K ends after the third [Morris1996, eq. 4.9].
"""


def every_structure(joint: str) -> tuple[Structure, ...]:
    """Return ARX, ARMAX, IV4 and OE with the thesis' orders of a joint, and OKID [Morris1996, ch. IV and V].

    The thesis gives no orders for ARX and IV4: they get those that they share with its ARMAX.
    """
    own = {entry.method: entry for entry in STRUCTURES[joint]}
    na, nb, _, nk = own["armax"].orders
    arx, iv4 = (
        Structure(name, name, (na, nb, nk), False, f"{name.upper()} {na}/{nb}, delay {nk}") for name in ("arx", "iv4")
    )
    return arx, own["armax"], iv4, own["oe"], own["okid"]


@cache
def needed_orders() -> Mapping[str, int]:
    """Return the order of excitation that each model of the study needs, by estimator and orders, lowest first."""
    # Numerator and denominator together, or the observer's p and the direct term.
    needed = {
        f"{entry.estimator} {' '.join(map(str, entry.orders))}": (
            entry.orders[1] + (1 if entry.estimator == "okid" else entry.orders[0])
        )
        for structures in STRUCTURES.values()
        for entry in structures
    }
    return MappingProxyType(dict(sorted(needed.items(), key=lambda item: (item[1], item[0]))))


def excitation_order_warning(order: int) -> str | None:
    """Return one line that names the models of the study for which an order of excitation is too low, or None."""
    every = len(needed_orders())
    unmet = {label: needed for label, needed in needed_orders().items() if needed > order}
    if not unmet:
        return None
    if len(unmet) == every:
        return f"order of excitation {order} is too low for every model of the study: they need {_span(unmet.values())}"
    by_estimator: dict[str, list[int]] = {}
    for label, needed in unmet.items():
        by_estimator.setdefault(label.split()[0], []).append(needed)
    models = ", ".join(f"{name} ({_span(needed)})" for name, needed in by_estimator.items())
    return f"order of excitation {order} is too low for {len(unmet)} of the {every} models of the study: {models}"


def _span(values: Iterable[int]) -> str:
    low, high = min(values := list(values)), max(values)
    return f"{low} to {high}" if high > low else str(low)
