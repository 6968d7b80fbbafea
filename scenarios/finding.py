"""One finding of the thesis, tried on the twin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["reproduced", "partly", "not reproduced", "cannot be told", "not tried"]


@dataclass(frozen=True)
class Finding:
    """A finding with its verdict and the number it rests on.

    Attributes:
        key: F1 to F26.
        claim: What the thesis says.
        where: Where it says so.
        verdict: Whether the twin shows the same.
        value: The number, or one per joint; nothing where it is not tried.
        unit: Its unit and meaning in a few words.
        thesis: The thesis' number or word.
        why: One sentence: what the verdict rests on and the most likely reason.
    """

    key: str
    claim: str
    where: str
    verdict: Verdict
    value: float | Mapping[str, float]
    unit: str
    thesis: str
    why: str


def verdict(passed: int, total: int) -> Verdict:
    """All of the parts, some of them, or none."""
    if passed == total:
        return "reproduced"
    return "partly" if passed else "not reproduced"
