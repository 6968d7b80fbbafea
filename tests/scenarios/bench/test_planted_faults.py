"""Planted faults go through the real bench, sandbox and all, and are caught by the figures that should catch them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from scenarios.bench.claims import NormalisedError
from scenarios.bench.consistency import NoiseFreeRecovery
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Metric, MetricDefinition
from scenarios.bench.metrics import ALL_METRICS, Reliability, Speed
from scenarios.bench.verify import BenchPlan, verify
from scenarios.estimators.estimator import Estimator
from scenarios.problems.trial import Trial
from tests.benchmarks.faulty_estimators import FAULTY
from tests.benchmarks.planted_faults import PLANTED_FAULTS
from tests.scenarios.bench.few import Here


@dataclass(frozen=True)
class Some:
    definition: MetricDefinition
    problems: tuple[str, ...]
    records: int

    @property
    def name(self) -> str:
        return self.definition.name

    @property
    def title(self) -> str:
        return self.definition.title

    def trials(self, effort: str) -> tuple[Trial, ...]:
        return tuple(t for t in self.definition.trials(effort) if t.problem in self.problems and t.draw < self.records)

    def verdicts(self) -> int:
        return self.definition.verdicts

    def evaluate(
        self,
        measured: Sequence[Measurement],
        contestant: Estimator,
        false_alarm: float,
        referee: Sequence[Measurement],
    ) -> Metric:
        return self.definition.evaluate(measured, contestant, false_alarm, referee)


@pytest.mark.slow
def test_each_is_caught_by_the_figures_that_should_and_by_no_other(tmp_path: Path) -> None:
    few = (Some(NoiseFreeRecovery(), ("quiet-1-1", "quiet-1-2"), 1), Some(NormalisedError(), ("p5",), 30))
    figures = (*few, Reliability(few), Speed(few))
    names = ("delayed", "overconfident")
    plan = BenchPlan(tuple(FAULTY[name] for name in names), effort="quick", figures=figures)
    for result in verify(plan, tmp_path, Here()):
        found = {name for name, metric in result.figures.items() if metric.passed is False}
        assert found == set(PLANTED_FAULTS[result.contestant.name]) & {definition.name for definition in figures}
        assert None not in {metric.passed for metric in result.figures.values()}


def test_every_fault_has_its_figures() -> None:
    assert set(PLANTED_FAULTS) == set(FAULTY)
    reasons = [reason for found in PLANTED_FAULTS.values() for reason in found.items()]
    assert {name for name, _ in reasons} <= {definition.name for definition in ALL_METRICS}
    assert all(why for _, why in reasons)
