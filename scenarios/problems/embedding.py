"""Embedding of a system in another structure: the orders that hold it, and its polynomials there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polyutils import trimseq

from scenarios.estimators.claims import filled
from scenarios.estimators.task import STRUCTURES
from scenarios.files.errors import ScenarioError
from sysid import Polynomials
from sysid.polynomial.orders import Orders, make_orders
from sysid.records.arrays import FloatArray

ONE = np.ones(1)
SAME = 1e-12
"""Difference of coefficients below which two polynomials are one."""


@dataclass(frozen=True, eq=False)
class Embedding:
    """A system embedded in a structure.

    Attributes:
        structure: One of `STRUCTURES`.
        orders: The least that hold the dynamics from input to output, and the noise where the structure can.
        polynomials: The system in it (state space: as ARMAX); None where its noise is none of the structure's.
    """

    structure: str
    orders: Mapping[str, int]
    polynomials: Polynomials | None


def embedding(truth: Polynomials, structure: str) -> Embedding | None:
    """Embed a system in a structure.

    With several inputs the orders are the same for all. Noise that the structure cannot have leaves the orders of the
    dynamics: B/(A F) is held then, C/(A D) is not.

    Args:
        truth: A y = B/F u + C/D e, without common factors.
        structure: One of `STRUCTURES`.

    Returns:
        The system in it; None where the structure cannot hold the dynamics: `ss` has no direct term.
    """
    a, c, d = truth.A, truth.C, truth.D
    b, f = zip(*(truth.channel(j) for j in range(truth.nu)), strict=True)
    common = _common(f)
    poles = [trimseq(np.convolve(a, one)) for one in f]
    delay = min(int(np.flatnonzero(one)[0]) for one in b)
    white = _same(c, np.convolve(a, d))
    orders = {"nb": _longest(b) - delay, "nf": _longest(poles) - 1, "nk": delay}
    if structure == "oe":
        return Embedding(structure, orders, _polynomials(b, poles) if white else None)
    if structure == "bj":
        c, d = (ONE, ONE) if white else (c, trimseq(np.convolve(a, d)))
        orders = {"nb": orders["nb"], "nc": len(c) - 1, "nd": len(d) - 1, "nf": orders["nf"], "nk": delay}
        return Embedding(structure, orders, _polynomials(b, poles, c=c, d=d))
    # One denominator for all: A F D y = B (F/F_j) D u_j + C F e
    whole = trimseq(np.convolve(a, common))
    zeros = [trimseq(np.convolve(one, np.polydiv(common, fj)[0])) for one, fj in zip(b, f, strict=True)]
    if structure == "arx":
        bare = _same(np.convolve(c, common), d)
        orders = {"na": len(whole) - 1, "nb": _longest(zeros) - delay, "nk": delay}
        return Embedding(structure, orders, _polynomials(zeros, a=whole) if bare else None)
    whole = trimseq(np.convolve(whole, d))
    zeros = [trimseq(np.convolve(one, d)) for one in zeros]
    noise = trimseq(np.convolve(c, common))
    if structure == "armax":
        orders = {"na": len(whole) - 1, "nb": _longest(zeros) - delay, "nc": len(noise) - 1, "nk": delay}
        return Embedding(structure, orders, _polynomials(zeros, a=whole, c=noise))
    if structure == "ss":
        if delay == 0:
            return None
        states = max(len(whole), len(noise), _longest(zeros)) - 1
        return Embedding(structure, {"order": states}, _polynomials(zeros, a=whole, c=noise))
    raise ScenarioError(f"structure {structure!r} given, expected one of {', '.join(STRUCTURES)}")


def own_structure(truth: Polynomials) -> str:
    """The structure with the fewest parameters that holds the system, its noise included."""
    embeddings = [embedding(truth, name) for name in ("oe", "arx", "armax", "bj")]
    holding = [one for one in embeddings if one is not None and one.polynomials is not None]
    return min(holding, key=lambda one: layout(one.structure, one.orders, truth.nu).count).structure


def layout(structure: str, orders: Mapping[str, int], nu: int = 1) -> Orders:
    """Orders with the sequence of their parameters; a state space with one output as ARMAX of its order."""
    if structure == "ss":
        n = orders["order"]
        return make_orders(nu, na=n, nb=n, nc=n, nk=1)
    return make_orders(nu, **orders)


def underfit(embedded: Embedding) -> dict[str, int] | None:
    """Orders of the dynamics too low by one; None where there is nothing to remove.

    B is cut as far as the order of the state needs it, and keeps one coefficient.
    """
    orders = dict(embedded.orders)
    if embedded.structure == "ss":
        orders["order"] -= 1
        return orders if orders["order"] >= 1 else None
    poles = "na" if "na" in orders else "nf"
    if orders[poles] < 2:
        return None
    states = max(orders[poles], orders["nb"] + orders["nk"] - 1)
    orders[poles] -= 1
    orders["nb"] = max(1, min(orders["nb"], states - orders["nk"]))
    return orders


def _common(f: Sequence[FloatArray]) -> FloatArray:
    """Least common denominator, where two denominators are either the same or without common factor."""
    out = ONE
    for j, one in enumerate(f):
        if not any(_same(one, other) for other in f[:j]):
            out = np.convolve(out, one)
    return out


def _polynomials(
    b: Sequence[FloatArray],
    f: Sequence[FloatArray] | None = None,
    *,
    a: FloatArray = ONE,
    c: FloatArray = ONE,
    d: FloatArray = ONE,
) -> Polynomials:
    return Polynomials(a, _stacked(b), c, d, _stacked(f or [ONE] * len(b)))


def _stacked(rows: Sequence[FloatArray]) -> FloatArray:
    return rows[0] if len(rows) == 1 else np.stack([filled("", row, _longest(rows)) for row in rows])


def _longest(rows: Sequence[FloatArray]) -> int:
    return max(len(row) for row in rows)


def _same(one: FloatArray, other: FloatArray) -> bool:
    longest = max(len(one), len(other))
    return bool(np.allclose(filled("", one, longest), filled("", other, longest), rtol=0.0, atol=SAME))
