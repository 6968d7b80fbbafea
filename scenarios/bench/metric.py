"""A figure of the test bench: a number, what theory expects, how sure the number is, and a verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from scenarios.bench.measured import Measured
from scenarios.estimators.contestant import Contestant
from scenarios.problems.trial import Trial

DRAWS = {"quick": 1, "full": 10}
"""Efforts, with the factor on the number of records that each figure takes."""

FALSE_ALARM = 0.005
"""Probability that a perfect estimator fails any verdict of a run: shared among all that are given."""


@dataclass(frozen=True)
class Part:
    """A figure on one problem.

    Attributes:
        label: Problem, or what else it is a part of.
        value: The number; NaN where it could not be measured.
        expected: What it is where all is well.
        interval: 95 % Monte-Carlo interval of the value.
        limits: Within which the value passes; infinite where any will do on that side.
        passed: Whether the value lies within; None where no verdict is given.
        theory: Whether theory expects it to pass.
        why: What theory says, or why there is no verdict.
        draws: Records that it rests on.
    """

    label: str
    value: float
    expected: float
    interval: tuple[float, float]
    limits: tuple[float, float]
    passed: bool | None
    theory: bool = True
    why: str = ""
    draws: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "passed", _verdict(self.passed))

    @property
    def surprises(self) -> bool:
        """Whether it fails where theory expects it to pass."""
        return self.passed is False and self.theory


@dataclass(frozen=True)
class Figure:
    """A figure: that of its worst part.

    Attributes:
        name: Key in results.
        title: In words.
        unit: Of the value.
        value: That of the part furthest beyond its limits: of those that fail where theory expects them to pass, else
            of those that theory expects to fail, or nearest to its limits where all pass; NaN where nothing could be
            measured. `reliability`, `speed` and `bandwidth` say themselves what theirs is of.
        expected: Of that part.
        interval: Of that part.
        passed: Whether all parts pass that theory expects to: those that it expects to fail are left out here alone.
            None where no verdict is given.
        false_alarm: Probability that a perfect estimator fails it.
        why: In words: what the verdict rests on, and what theory says.
        parts: All parts.
        curves: For drawing, numbers by name.
    """

    name: str
    title: str
    unit: str
    value: float
    expected: float
    interval: tuple[float, float]
    passed: bool | None
    false_alarm: float
    why: str
    parts: tuple[Part, ...] = ()
    curves: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "passed", _verdict(self.passed))


class FigureMaker(Protocol):
    """Says which trials a figure needs, and makes it from what was measured."""

    @property
    def name(self) -> str:
        """Key in results."""

    @property
    def title(self) -> str:
        """In words."""

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Trials that it needs; those that figures share are run once.

        Args:
            effort: One of `DRAWS`.
        """

    def verdicts(self) -> int:
        """How many verdicts it gives at most that chance can turn; false alarms are shared among all of them."""

    def figure(
        self,
        measured: Sequence[Measured],
        contestant: Contestant,
        false_alarm: float,
        referee: Sequence[Measured],
    ) -> Figure:
        """Make it.

        Args:
            measured: Its own trials among those that were run, in the order of `trials`.
            contestant: Whose.
            false_alarm: Allowed probability of a false alarm, of each of its verdicts.
            referee: Trials of the second implementation that were run, those of the figure of agreement.
        """


def _verdict(passed: bool | None) -> bool | None:
    """Without NumPy's truth values, of which none is True or False itself."""
    if passed is not None and not isinstance(passed, bool | np.bool_):
        raise TypeError(f"passed {passed!r} given, expected true, false or none")
    return None if passed is None else bool(passed)


def trials_of(makers: Sequence[FigureMaker], effort: str) -> tuple[Trial, ...]:
    """Trials of several figures, each once, in the order of the figures.

    Args:
        makers: The figures.
        effort: One of `DRAWS`.
    """
    return tuple(dict.fromkeys(trial for maker in makers for trial in maker.trials(effort)))
