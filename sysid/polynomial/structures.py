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


System = tuple[FloatArray, list[FloatArray], FloatArray, FloatArray, list[FloatArray]]
"""Polynomials A, [B], C, D, [F] of A y = B/F u + C/D e."""


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
    nk = min(int(np.flatnonzero(truth.channel(j)[0])[0]) for j in range(truth.nu))
    if structure == "ss" and nk == 0:
        return None
    if structure in ("oe", "bj"):
        a, b, c, d, f = _without_a(truth)
        white = len(c) == len(d) == 1
        noise_held = white or structure == "bj"
    elif structure == "arx":
        a, b, c, d, f = _with_common_denominator(truth)
        noise_held = _same(c, d)
        c, d = ONE, ONE
    else:
        a, b, c, d, f = _with_common_denominator(truth)
        noise_held = True
        a, b, d = trimseq(np.convolve(a, d)), [trimseq(np.convolve(bj, d)) for bj in b], ONE
    sizes = {
        "na": len(a) - 1,
        "nb": max(map(len, b)) - nk,
        "nc": len(c) - 1,
        "nd": len(d) - 1,
        "nf": max(map(len, f)) - 1,
        "nk": nk,
        "order": max(len(a), len(c), *map(len, b)) - 1,
    }
    polynomials = Polynomials(a, padded_rows(b), c, d, padded_rows(f)) if noise_held else None
    return Embedding(structure, {name: sizes[name] for name in STRUCTURES[structure]}, polynomials)


def own_structure(truth: Polynomials) -> str:
    """The structure with the fewest parameters that holds the system, its noise included."""
    embeddings = [embedding(truth, name) for name in ("oe", "arx", "armax", "bj")]
    holding = [held for held in embeddings if held is not None and held.polynomials is not None]
    return min(holding, key=lambda held: layout(held.structure, held.orders, truth.nu).count).structure


def layout(structure: str, orders: Mapping[str, int], nu: int = 1) -> Orders:
    """Orders with the sequence of their parameters; a state space with one output as ARMAX of its order."""
    if structure == "ss":
        n = orders["order"]
        return make_orders(nu, na=n, nb=n, nc=n, nk=1)
    return make_orders(nu, **orders)


def _without_a(truth: Polynomials) -> System:
    """The system as y = B/(A F) u + C/(A D) e, where the noise is white with C = D = 1."""
    b, f = [], []
    for j in range(truth.nu):
        numerator, denominator = truth.channel(j)
        b.append(numerator)
        f.append(trimseq(np.convolve(truth.A, denominator)))
    noise_poles = trimseq(np.convolve(truth.A, truth.D))
    if _same(truth.C, noise_poles):
        return ONE, b, ONE, ONE, f
    return ONE, b, truth.C, noise_poles, f


def _with_common_denominator(truth: Polynomials) -> System:
    """The system with one denominator for all inputs, A F y = B_j F/F_j u_j + C F/D e, F the product of the F_j."""
    channels = [truth.channel(j) for j in range(truth.nu)]
    # two of the F_j are taken to be the same or coprime
    common = ONE
    factors: list[FloatArray] = []
    for _, denominator in channels:
        if not any(_same(denominator, factor) for factor in factors):
            common = np.convolve(common, denominator)
        factors.append(denominator)
    b = []
    for numerator, denominator in channels:
        b.append(trimseq(np.convolve(numerator, np.polydiv(common, denominator)[0])))
    a, c = trimseq(np.convolve(truth.A, common)), trimseq(np.convolve(truth.C, common))
    return a, b, c, truth.D, [ONE] * truth.nu


def _same(first: FloatArray, second: FloatArray) -> bool:
    return bool(np.abs(polysub(first, second)).max() <= SAME)
