"""A bench of a few trials."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from scenarios.bench.executor import Crew
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import Metric
from scenarios.bench.run_trials import Runner
from scenarios.bench.work import Bench, Done, Piece
from scenarios.estimators.contestant import Contestant
from scenarios.problems.trial import Trial

ROOT = Path(__file__).parents[3]
PERFECT = Contestant("perfect", "bench:perfect", method="pem")


@dataclass(frozen=True)
class Few:
    draws: int = 2
    problems: tuple[str, ...] = ("p1@300", "p2@300")
    name: str = "few"
    title: str = "Parameters within their intervals"

    def trials(self, effort: str) -> tuple[Trial, ...]:
        return tuple(Trial(name, draw) for name in self.problems for draw in range(self.draws))

    def verdicts(self) -> int:
        return 1

    def evaluate(
        self,
        measured: Sequence[Measurement],
        contestant: Contestant,
        false_alarm: float,
        referee: Sequence[Measurement],
    ) -> Metric:
        answered = [m.normalised_error for m in measured if m.kind == "model"]
        value = sum(answered) / max(1, len(answered))
        passed = len(answered) == len(self.trials("quick"))
        return Metric(self.name, self.title, "", value, 2.0, (1.0, 3.0), passed, false_alarm, f"of {len(answered)}")


@dataclass
class Here:
    after: int = 10**6
    error: BaseException = field(default_factory=KeyboardInterrupt)
    workers: int = 1
    here: bool = True
    asked: int = 0

    @contextmanager
    def crew(self, bench: Bench) -> Iterator[Crew]:
        with Runner(bench) as runner:
            yield lambda pieces: self._done(runner, pieces)

    def _done(self, runner: Runner, pieces: Sequence[Piece]) -> Iterator[Done]:
        for piece in pieces:
            for done in runner.run(piece):
                if self.asked >= self.after:
                    raise self.error
                self.asked += 1
                yield done


def child_environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), *filter(None, sys.path)))}
