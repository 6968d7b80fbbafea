"""The model structures that the study identifies: the thesis' own, and one of sufficient order beside them."""

from collections.abc import Mapping
from dataclasses import dataclass


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
