"""Planted faults go through the real bench, sandbox and all, and are caught by the figures that should catch them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scenarios.bench.measured import Measured
from scenarios.bench.metric import Figure, FigureMaker
from scenarios.bench.metrics import ALL_FIGURES
from scenarios.bench.noise_free_recovery import NoiseFreeRecovery
from scenarios.bench.normalised_error import NormalisedError
from scenarios.bench.planted_faults import PLANTED_FAULTS
from scenarios.bench.reliability import Reliability
from scenarios.bench.speed import Speed
from scenarios.bench.verify import Plan, verify
from scenarios.estimators.contestant import Contestant
from scenarios.estimators.entries_faulty import FAULTY
from scenarios.estimators.known_estimators import contestant
from scenarios.problems.trial import Trial
from tests.scenarios.bench.few import Here


@dataclass(frozen=True)
class Some:
    """A figure on the problems that take least time, and on not so many records."""

    maker: FigureMaker
    problems: tuple[str, ...]
    records: int

    @property
    def name(self) -> str:
        """Its own."""
        return self.maker.name

    @property
    def title(self) -> str:
        """Its own."""
        return self.maker.title

    def trials(self, effort: str) -> tuple[Trial, ...]:
        """Those of a few problems."""
        return tuple(t for t in self.maker.trials(effort) if t.problem in self.problems and t.draw < self.records)

    def verdicts(self) -> int:
        """Its own."""
        return self.maker.verdicts()

    def figure(
        self, measured: Sequence[Measured], contestant: Contestant, false_alarm: float, referee: Sequence[Measured]
    ) -> Figure:
        """Its own."""
        return self.maker.figure(measured, contestant, false_alarm, referee)


def test_each_is_caught_by_the_figures_that_should_and_by_no_other(tmp_path: Path) -> None:
    """Of four figures: exactly those that the table has."""
    few = (Some(NoiseFreeRecovery(), ("quiet-1-1", "quiet-1-2"), 1), Some(NormalisedError(), ("p5",), 30))
    figures = (*few, Reliability(few), Speed(few))
    names = ("delayed", "overconfident")
    plan = Plan(tuple(map(contestant, names)), effort="quick", figures=figures)
    for result in verify(plan, tmp_path, Here()):
        found = {name for name, figure in result.figures.items() if figure.passed is False}
        assert found == set(PLANTED_FAULTS[result.contestant.name]) & {maker.name for maker in figures}
        assert None not in {figure.passed for figure in result.figures.values()}


def test_every_fault_has_its_figures() -> None:
    """Each that is planted, figures that there are, and each with a reason."""
    assert set(PLANTED_FAULTS) == {entry.contestant.name for entry in FAULTY}
    reasons = [reason for found in PLANTED_FAULTS.values() for reason in found.items()]
    assert {name for name, _ in reasons} <= {maker.name for maker in ALL_FIGURES}
    assert all(why for _, why in reasons)
