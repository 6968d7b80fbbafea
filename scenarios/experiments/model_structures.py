"""Model structures of the study, and the order of excitation that they need."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import chain
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
    """The structures of a joint, from the orders of its ARMAX and the method of its model in the thesis."""
    na, nb, nc, nk = armax
    armax_label = f"ARMAX {na}/{nb}/{nc}, delay {nk}"
    sufficient_label = "OE {}/{}, delay {}, sufficient without friction".format(*SUFFICIENT[joint])
    return (
        Structure("armax", "armax", armax, chosen == "armax", armax_label),
        Structure("oe", "oe", (2, 2, nk), chosen == "oe", f"OE 2/2, delay {nk}"),
        # The thesis has a three-joint model by OKID beside that by prediction error.
        Structure("okid", "okid", (2, 5), True, "OKID order 2, p = 5"),
        Structure("oe_high", "oe", SUFFICIENT[joint], False, sufficient_label),
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
    structures = {structure.method: structure for structure in STRUCTURES[joint]}
    na, nb, _, nk = structures["armax"].orders
    arx = Structure("arx", "arx", (na, nb, nk), False, f"ARX {na}/{nb}, delay {nk}")
    iv4 = Structure("iv4", "iv4", (na, nb, nk), False, f"IV4 {na}/{nb}, delay {nk}")
    return arx, structures["armax"], iv4, structures["oe"], structures["okid"]


@cache
def needed_orders() -> Mapping[str, int]:
    """Return the order of excitation that each model of the study needs, by estimator and orders, lowest first."""
    needed: dict[str, int] = {}
    for structure in chain.from_iterable(STRUCTURES.values()):
        label = f"{structure.estimator} {' '.join(map(str, structure.orders))}"
        # Numerator and denominator together, or the observer's p and the direct term.
        if structure.estimator == "okid":
            _, p = structure.orders
            needed[label] = p + 1
        else:
            needed[label] = structure.orders[0] + structure.orders[1]
    return MappingProxyType(dict(sorted(needed.items(), key=lambda label_and_order: label_and_order[::-1])))


def excitation_order_warning(order: int) -> str | None:
    """Return one line that names the models of the study for which an order of excitation is too low, or None."""
    models_of_study = len(needed_orders())
    unmet = {label: needed for label, needed in needed_orders().items() if needed > order}
    if not unmet:
        return None
    if len(unmet) == models_of_study:
        return f"order of excitation {order} is too low for every model of the study: they need {_span(unmet.values())}"
    # By estimator, because a line for each model would be long.
    by_estimator: dict[str, list[int]] = {}
    for label, needed in unmet.items():
        by_estimator.setdefault(label.split()[0], []).append(needed)
    estimators = ", ".join(f"{name} ({_span(needed)})" for name, needed in by_estimator.items())
    share = f"{len(unmet)} of the {models_of_study} models of the study"
    return f"order of excitation {order} is too low for {share}: {estimators}"


def _span(values: Iterable[int]) -> str:
    low, high = min(values := list(values)), max(values)
    return f"{low} to {high}" if high > low else str(low)
