"""What a figure says of an estimator, in four words."""

from collections.abc import Iterable
from enum import Enum

from scenarios.bench.leaderboard_reading import FIGURES, TOLD
from scenarios.bench.metric import Metric, Part
from scenarios.bench.result import Result


class Verdict(Enum):
    """A verdict: its word, and the sign that tells it apart without colour."""

    PASSES = ("passes", "✓")
    FAILS = ("fails", "✗")
    FAILS_AS_THEORY_SAYS = ("fails as theory says", "△")
    NONE = ("no verdict", "–")

    @property
    def word(self) -> str:
        """In words."""
        return self.value[0]

    @property
    def sign(self) -> str:
        """As one character."""
        return self.value[1]


ORDER = (Verdict.PASSES, Verdict.FAILS_AS_THEORY_SAYS, Verdict.NONE, Verdict.FAILS)
"""From good to bad, by which tables sort."""


def verdict(figure: Metric | None) -> Verdict:
    """The verdict of a figure: a part that fails where theory expects it to pass outweighs all others.

    Args:
        figure: The figure; None where the run made none of it.
    """
    if figure is None:
        return Verdict.NONE
    if figure.passed is False or any(part.surprises for part in figure.parts):
        return Verdict.FAILS
    if any(part.passed is False for part in figure.parts):
        return Verdict.FAILS_AS_THEORY_SAYS
    return Verdict.NONE if figure.passed is None else Verdict.PASSES


def part_verdict(part: Part) -> Verdict:
    """The verdict of a part of a figure."""
    if part.passed is None:
        return Verdict.NONE
    if part.passed:
        return Verdict.PASSES
    return Verdict.FAILS if part.theory else Verdict.FAILS_AS_THEORY_SAYS


def judged_figures(results: Iterable[Result]) -> tuple[str, ...]:
    """Names of the figures by which rows are compared: all that give verdicts, whether a row has them or not.

    Args:
        results: Of all rows; what they judge that this version does not know counts too.
    """
    others = {name for result in results for name, f in result.figures.items() if verdict(f) is not Verdict.NONE}
    return (*(name for name in FIGURES if name not in TOLD), *sorted(others - set(FIGURES)))


def count(figures: Iterable[Metric | None]) -> dict[Verdict, int]:
    """How many figures have which verdict."""
    found = dict.fromkeys(ORDER, 0)
    for figure in figures:
        found[verdict(figure)] += 1
    return found
