"""Pieces of a run done in this process: a record is drawn, each contestant asked in its sandbox, answers measured."""

from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from time import perf_counter
from types import TracebackType

from scenarios.bench.measurement import measure
from scenarios.bench.perfect import perfect
from scenarios.bench.prepared_records import is_twin, use_records
from scenarios.bench.work import Bench, Done, Piece
from scenarios.estimators.outcome import Outcome
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.sandbox import Sandbox, open_sandbox
from scenarios.estimators.seeds import task_seed
from scenarios.estimators.task import Task
from scenarios.problems.problem import Bound, Problem
from scenarios.problems.registry import problem as find_problem
from scenarios.problems.trial import Trial
from sysid import IOData

PERFECT = "bench:perfect"
"""Target of the contestant that knows the truth; it runs here, because a sandbox would not let it see it."""

TOLD = 300
"""Characters of an error that are told."""


class Runner:
    """Does pieces of a run; sandboxes stay open from one to the next.

    Args:
        bench: What the pieces share.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._sandboxes: dict[int, Sandbox] = {}
        self._opened: set[int] = set()
        self._bounds: dict[tuple[str, str | None], Bound | None] = {}

    def __enter__(self) -> "Runner":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with ExitStack() as stack:
            while self._sandboxes:
                stack.push(self._sandboxes.popitem()[1])

    def run(self, piece: Piece) -> Iterator[Done]:
        """Do a piece.

        Args:
            piece: Its trials; those in which a contestant cannot be asked are left out.

        Yields:
            What was measured, for all of a piece at once: the ruler is laid on before the first and after the last.
        """
        if self._bench.records is not None and is_twin(piece.problem):
            use_records(self._bench.records)
        problem = find_problem(piece.problem)
        contestants = self._bench.contestants
        asked = [
            (number, Trial(piece.problem, piece.draw, ask), task)
            for ask, number in _in_turn(piece)
            if (task := problem.task(contestants[number].structure, ask)) is not None
        ]
        if not asked:
            return
        for number, _, _ in asked:
            # What is done once for many trials belongs to none of them.
            self._make_ready(number, problem)
        begun = perf_counter()
        record = problem.draw(asked[0][1].seed(self._bench.seed))
        ruler = Ruler(record)
        ruler.measure()
        shared = (perf_counter() - begun) / len(asked)
        outcomes: list[tuple[Outcome, float]] = []
        for number, trial, task in asked:
            begun = perf_counter()
            seed = trial.seed(self._bench.seed)
            seeded = replace(task, seed=task_seed(self._bench.seed, trial.key))
            outcomes.append((self._ask(number, problem, seeded, record, seed), perf_counter() - begun))
        ruler.measure()
        for (number, trial, task), (outcome, wall) in zip(asked, outcomes, strict=True):
            begun = perf_counter()
            bound = self._bounds[problem.name, contestants[number].structure]
            measured = measure(problem, trial, task, bound, record, outcome, ruler_seconds=ruler.seconds)
            yield Done(number, measured, shared + wall + perf_counter() - begun)

    def _ask(self, number: int, problem: Problem, task: Task, record: IOData, seed: int) -> Outcome:
        contestant = self._bench.contestants[number]
        if contestant.target == PERFECT:
            return perfect(problem, task, seed)  # its error belongs to the record's noise
        try:
            if number not in self._sandboxes:
                self._open(number)
            return self._sandboxes[number].ask(record, task)
        # Whatever an estimator brings about in the bench's own process is a fault of it, not the end of all others.
        except Exception as error:
            self._give_back(number)
            return Outcome("crash", f"its sandbox failed: {type(error).__name__}: {error}"[:TOLD])

    def _make_ready(self, number: int, problem: Problem) -> None:
        contestant = self._bench.contestants[number]
        if (problem.name, contestant.structure) not in self._bounds:
            self._bounds[problem.name, contestant.structure] = problem.bound(contestant.structure)
        if number not in self._opened and contestant.target != PERFECT:
            self._open(number)

    def _open(self, number: int) -> None:
        """Open a sandbox; that it cannot be opened the first time is a mistake in what was given."""
        sandbox = open_sandbox(self._bench.contestants[number], self._bench.limits)
        sandbox.__enter__()
        self._sandboxes[number] = sandbox
        self._opened.add(number)

    def _give_back(self, number: int) -> None:
        sandbox = self._sandboxes.pop(number, None)
        if sandbox is not None:
            with suppress(Exception):
                sandbox.__exit__(None, None, None)


def _in_turn(piece: Piece) -> tuple[tuple[str, int], ...]:
    """What is asked of whom, another one first at every draw: the first finds caches as the record left them."""
    first = piece.draw % len(piece.asked) if piece.asked else 0
    return piece.asked[first:] + piece.asked[:first]
