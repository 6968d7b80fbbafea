"""A system in another structure than its own: the orders that hold it, and the polynomials that it then has."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenarios.estimators.task import STRUCTURES
from scenarios.files.errors import ScenarioError
from sysid import Polynomials
from sysid.polynomial.orders import Orders, make_orders
from sysid.records.arrays import FloatArray

SAME = 1e-12
"""Difference of coefficients below which two polynomials are one."""


@dataclass(frozen=True, eq=False)
class Embedding:
    """A system in a structure.

    Attributes:
        structure: One of `STRUCTURES`.
        orders: The least that hold the dynamics from input to output, and the noise where the structure can.
        polynomials: The system in it (state space: as ARMAX); None where its noise is none of the structure's.
    """

    structure: str
    orders: Mapping[str, int]
    polynomials: Polynomials | None


def embedding(truth: Polynomials, structure: str) -> Embedding | None:
    """Put a system into a structure.

    With several inputs the orders are the same for all. Noise that the structure cannot have leaves the orders of the
    dynamics: B/(A F) is held then, C/(A D) is not.

    Args:
        truth: A y = B/F u + C/D e, without common factors.
        structure: One of `STRUCTURES`.

    Returns:
        The system in it; None where the structure cannot hold the dynamics: `ss` has no direct term.
    """
    a, c, d = truth.A, truth.C, truth.D
    b, f = _rows(truth)
    common = _common(f)
    poles = [_trim(np.convolve(a, one)) for one in f]
    delay = min(int(np.flatnonzero(one)[0]) for one in b)
    white = _same(c, np.convolve(a, d))
    if structure == "oe":
        return Embedding(
            structure,
            {"nb": _longest(b) - delay, "nf": max(len(one) for one in poles) - 1, "nk": delay},
            _polynomials(b=b, f=poles) if white else None,
        )
    if structure == "bj":
        numerator, denominator = (np.ones(1), np.ones(1)) if white else (c, _trim(np.convolve(a, d)))
        orders = {"nb": _longest(b) - delay, "nc": len(numerator) - 1, "nd": len(denominator) - 1}
        orders |= {"nf": max(len(one) for one in poles) - 1, "nk": delay}
        return Embedding(structure, orders, _polynomials(b=b, c=numerator, d=denominator, f=poles))
    # one denominator for all: A F D y = B (F/F_j) D u_j + C F e
    whole = _trim(np.convolve(a, common))
    zeros = [_trim(np.convolve(one, np.polydiv(common, fj)[0])) for one, fj in zip(b, f, strict=True)]
    if structure == "arx":
        bare = _same(np.convolve(c, common), np.convolve(d, np.ones(1)))
        orders = {"na": len(whole) - 1, "nb": _longest(zeros) - delay, "nk": delay}
        return Embedding(structure, orders, _polynomials(whole, zeros) if bare else None)
    whole = _trim(np.convolve(whole, d))
    zeros = [_trim(np.convolve(one, d)) for one in zeros]
    noise = _trim(np.convolve(c, common))
    if structure == "armax":
        orders = {"na": len(whole) - 1, "nb": _longest(zeros) - delay, "nc": len(noise) - 1, "nk": delay}
        return Embedding(structure, orders, _polynomials(whole, zeros, noise))
    if structure == "ss":
        if delay == 0:
            return None
        states = max(len(whole), len(noise), _longest(zeros)) - 1
        return Embedding(structure, {"order": states}, _polynomials(whole, zeros, noise))
    raise ScenarioError(f"structure {structure!r} given, expected one of {', '.join(STRUCTURES)}")


def own_structure(truth: Polynomials) -> str:
    """The structure with the fewest parameters that is the system, its noise included."""
    found = [embedding(truth, name) for name in ("oe", "arx", "armax", "bj")]
    held = [one for one in found if one is not None and one.polynomials is not None]
    return min(held, key=lambda one: layout(one.structure, one.orders, truth.nu).count).structure


def layout(structure: str, orders: Mapping[str, int], nu: int = 1) -> Orders:
    """Sequence of the parameters of a structure; of a state space with one output that of ARMAX of its order."""
    if structure == "ss":
        n = orders["order"]
        return make_orders(nu, na=n, nb=n, nc=n, nk=1)
    rest = {key: value for key, value in orders.items() if key in ("na", "nc", "nd", "nf")}
    return make_orders(nu, nb=orders["nb"], nk=orders["nk"], **rest)


def parameters(polynomials: Polynomials, orders: Orders) -> FloatArray:
    """Parameters (p,) of polynomials in the sequence A, B, C, D, F; what is short is zero there.

    Raises:
        ScenarioError: The polynomials are longer than the orders.
    """
    b, f = _rows(polynomials)
    nb = [n + k for n, k in zip(orders.nb, orders.nk, strict=True)]
    return orders.join(
        _fitted("A", polynomials.A, orders.na + 1),
        [_fitted("B", one, length) for one, length in zip(b, nb, strict=True)],
        _fitted("C", polynomials.C, orders.nc + 1),
        _fitted("D", polynomials.D, orders.nd + 1),
        [_fitted("F", one, length + 1) for one, length in zip(f, orders.nf, strict=True)],
    )


def underfit(embedded: Embedding) -> dict[str, int] | None:
    """Orders whose dynamics are one too low; None where there is nothing to take away.

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


def _rows(truth: Polynomials) -> tuple[list[FloatArray], list[FloatArray]]:
    channels = [truth.channel(j) for j in range(truth.nu)]
    return [b for b, _ in channels], [f for _, f in channels]


def _common(f: list[FloatArray]) -> FloatArray:
    """Least denominator of all inputs, where two of them are either the same or without common factor."""
    different: list[FloatArray] = []
    for one in f:
        if not any(_same(one, other) for other in different):
            different.append(one)
    out = np.ones(1)
    for one in different:
        out = np.convolve(out, one)
    return out


def _polynomials(
    a: FloatArray | None = None,
    b: list[FloatArray] | None = None,
    c: FloatArray | None = None,
    d: FloatArray | None = None,
    f: list[FloatArray] | None = None,
) -> Polynomials:
    one = np.ones(1)
    zeros = b or [np.zeros(1)]
    poles = f or [one] * len(zeros)
    return Polynomials(
        one if a is None else a, _stacked(zeros), one if c is None else c, one if d is None else d, _stacked(poles)
    )


def _stacked(rows: list[FloatArray]) -> FloatArray:
    if len(rows) == 1:
        return rows[0]
    out = np.zeros((len(rows), _longest(rows)))
    for place, row in zip(out, rows, strict=True):
        place[: len(row)] = row
    return out


def _fitted(name: str, row: FloatArray, length: int) -> FloatArray:
    if len(_trim(row)) > length:
        raise ScenarioError(f"{name} has {len(_trim(row))} coefficients, expected at most {length}")
    return np.concatenate((row, np.zeros(max(0, length - len(row)))))[:length]


def _longest(rows: list[FloatArray]) -> int:
    return max(len(row) for row in rows)


def _trim(row: FloatArray) -> FloatArray:
    kept = np.flatnonzero(row)
    return row[: kept[-1] + 1] if len(kept) else row[:1]


def _same(one: FloatArray, other: FloatArray) -> bool:
    longest = max(len(one), len(other))
    return bool(np.allclose(_fitted("", one, longest), _fitted("", other, longest), rtol=0.0, atol=SAME))
