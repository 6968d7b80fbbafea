"""One palette: fixed styles of truth, measurement and every method in all figures."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Style:
    """Style of a kind of item in all figures.

    Attributes:
        colour: Colour, readable by the colour-blind.
        line: Line pattern, which distinguishes lines in greyscale print; empty for markers only.
        width: Line width in points.
        marker: Marker for points.
    """

    colour: str
    line: str = "-"
    width: float = 1.4
    marker: str = "o"


PALETTE: Mapping[str, Style] = MappingProxyType(
    {
        # The widest line: `line` puts wide lines behind narrow ones, so that an estimate on the truth hides none of it.
        "truth": Style("#000000", "-", 2.2, "o"),
        "measured": Style("#8a8a8a", "-", 1.0, "."),
        "armax": Style("#0072b2", "-", 1.4, "s"),
        "oe": Style("#d55e00", "--", 1.4, "^"),
        "okid": Style("#009e73", "-.", 1.4, "D"),
        "arx": Style("#56b4e9", ":", 1.4, "v"),
        "bj": Style("#7a5195", "--", 1.4, "P"),
        "iv4": Style("#a6761d", ":", 1.4, "X"),
        "n4sid": Style("#006d5b", ":", 1.4, "h"),
        "spa": Style("#cc79a7", "-", 1.0, "."),
        # No line: neighbouring values of a raw estimate scatter independently.
        "etfe": Style("#a9b4c2", "", 1.0, "."),
        "pem_ss": Style("#e69f00", "-", 1.4, "d"),
        "bla": Style("#882255", "", 1.2, "o"),
        "cra": Style("#6b6b00", "", 1.2, "o"),
        "welch": Style("#332288", "-", 1.0, "."),
        "spafdr": Style("#5b2a86", "-", 1.0, "."),
        "impulseest": Style("#117733", "-", 1.4, "o"),
        "tfest": Style("#44aa99", "-", 1.4, "<"),
        "polyest": Style("#661100", "-.", 1.4, ">"),
        "ivx": Style("#cc6677", ":", 1.4, "p"),
        "published": Style("#b8860b", (0, (4, 1.5, 1, 1.5, 1, 1.5)), 1.4, "*"),  # type: ignore[arg-type]
    }
)
"""Styles of truth, measurement and every method, with the colours of Okabe and Ito's palette."""

NOISE = Style("#8a8a8a", "", 1.0, "x")
DISTORTION = Style("#d55e00", "", 1.0, "^")
BOUND = Style("#666666", "--", 0.9)
GRID = "#d9d9d9"
INK = "#222222"
