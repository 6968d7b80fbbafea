"""A bench of a few trials."""

from contextlib import closing
from dataclasses import dataclass, field

from scenarios.bench.job_runner import Runner
from scenarios.bench.metric import Metric, MetricDefinition
from scenarios.estimators.estimator import PERFECT as TARGET
from scenarios.estimators.estimator import Estimator
from scenarios.jobs.executor import Executor
from scenarios.problems.trial import Trial

PERFECT = Estimator("perfect", TARGET, method="pem")


@dataclass(frozen=True)
class Few(MetricDefinition):
    """The mean normalised error on four short records of two problems."""

    draws: int = 2
    problems: tuple[str, ...] = ("p1@300", "p2@300")
    name: str = "few"
    title = "Parameters within their intervals"
    verdicts = 1

    def trials(self, effort):
        return tuple(Trial(name, draw) for name in self.problems for draw in range(self.draws))

    def evaluate(self, evidence):
        answered = [m.normalised_error for m in evidence.measurements if m.kind == "model"]
        value = sum(answered) / max(1, len(answered))
        passed = len(answered) == len(self.trials("quick"))
        return Metric(
            self.name, self.title, "", value, 2.0, (1.0, 3.0), passed, evidence.false_alarm, f"of {len(answered)}"
        )


@dataclass
class Here(Executor):
    """Runs jobs in this process; after some trials it is interrupted, or dies of an error."""

    after: int = 10**6
    error: BaseException = field(default_factory=KeyboardInterrupt)
    workers: int = 1
    asked: int = 0

    def run(self, task, shared, batches, **names):
        with closing(Runner(shared)) as runner:
            for batch in batches:
                for result in (result for job in batch for result in runner.run(job)):
                    if self.asked >= self.after:
                        raise self.error
                    self.asked += 1
                    yield result

    def _close(self) -> None:
        pass

    _room = _submit = _finished = _results = _close
