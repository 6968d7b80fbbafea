"""One finding of the thesis, tried on the twin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from scenarios.thesis.claims import CLAIMS

Verdict = Literal["reproduced", "partly", "not reproduced", "cannot be told"]


@dataclass(frozen=True)
class Finding:
    """A finding with its verdict and the number it rests on.

    Attributes:
        key: F1 to F26.
        claim: What the thesis says.
        where: Where it says so.
        verdict: Whether the twin shows the same.
        value: The number, or several by name (joints, as a rule); nothing where it cannot be told. One named `of`, or
            `of ...`, is the whole of which the number before it counts a part.
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


def decided(key: str, verdict: Verdict, value: float | Mapping[str, float], unit: str, why: str) -> Finding:
    """A finding on the claim of that key.

    Args:
        key: F1 to F26.
        verdict: Whether the twin shows the same.
        value: The number, or several by name.
        unit: Its unit and meaning.
        why: What the verdict rests on.

    Returns:
        The finding.
    """
    claim = CLAIMS[key]
    return Finding(key, claim.text, claim.where, verdict, value, unit, claim.thesis, why)


def undecided(key: str, why: str) -> Finding:
    """Return a finding that cannot be decided, and the reason."""
    return decided(key, "cannot be told", {}, "", why)


def verdict(passed: int, total: int) -> Verdict:
    """All of the parts, some of them, or none."""
    if passed == total:
        return "reproduced"
    return "partly" if passed else "not reproduced"
