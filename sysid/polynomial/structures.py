"""Structures of models by name: their orders, and a system of one structure embedded in another."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polysub
from numpy.polynomial.polyutils import trimseq

from sysid.models.polynomials import Polynomials
from sysid.polynomial.orders import Orders, make_orders, padded_rows
from sysid.records.arrays import FloatArray
from sysid.records.errors import SysidError

STRUCTURES = {
    "arx": ("na", "nb", "nk"),
    "armax": ("na", "nb", "nc", "nk"),
    "oe": ("nb", "nf", "nk"),
    "bj": ("nb", "nc", "nd", "nf", "nk"),
    "ss": ("order",),
}
"""Structures with the names of their orders; `nk = 1`: y(t) depends on u(t-1) first. `ss` is without direct term."""

ONE = np.ones(1)
SAME = 1e-12  # difference of coefficients below which two polynomials are one


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

    Raises:
        SysidError: No such structure.
    """
    if structure not in STRUCTURES:
        raise SysidError(f"structure {structure!r} given, expected one of {', '.join(STRUCTURES)}")
    a, c, d = truth.A, truth.C, truth.D
    b, f = ([truth.channel(j)[k] for j in range(truth.nu)] for k in (0, 1))
    delay = min(int(np.flatnonzero(row)[0]) for row in b)
    held = True
    if structure in ("oe", "bj"):
        a, f, noise_poles = ONE, [trimseq(np.convolve(a, row)) for row in f], trimseq(np.convolve(a, d))
        white = _same(c, noise_poles)
        held = white or structure == "bj"
        c, d = (ONE, ONE) if white else (c, noise_poles)
    else:
        # One denominator for all: A F D y = B (F/F_j) D u_j + C F e. Two of the F_j are the same or coprime.
        common = ONE
        for j, row in enumerate(f):
            if not any(_same(row, other) for other in f[:j]):
                common = np.convolve(common, row)
        a = trimseq(np.convolve(a, common))
        b = [trimseq(np.convolve(row, np.polydiv(common, fj)[0])) for row, fj in zip(b, f, strict=True)]
        c, f = trimseq(np.convolve(c, common)), [ONE] * truth.nu
        if structure == "arx":
            held = _same(c, d)
            c = ONE
        else:
            a, b = trimseq(np.convolve(a, d)), [trimseq(np.convolve(row, d)) for row in b]
        d = ONE
    sizes = {"na": len(a) - 1, "nb": max(map(len, b)) - delay, "nc": len(c) - 1, "nd": len(d) - 1}
    sizes |= {"nf": max(map(len, f)) - 1, "nk": delay, "order": max(len(a), len(c), *map(len, b)) - 1}
    if structure == "ss" and delay == 0:
        return None
    polynomials = Polynomials(a, padded_rows(b), c, d, padded_rows(f)) if held else None
    return Embedding(structure, {name: sizes[name] for name in STRUCTURES[structure]}, polynomials)


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


def _same(one: FloatArray, other: FloatArray) -> bool:
    return bool(np.abs(polysub(one, other)).max() <= SAME)
