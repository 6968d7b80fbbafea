"""Jobs of a run: one record each is drawn, given to every estimator that needs it, and the answers are measured."""

import re
import tempfile
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import local
from time import perf_counter
from types import TracebackType
from typing import Protocol, runtime_checkable

import numpy as np

from scenarios.bench.estimator_files import EstimatorFiles
from scenarios.bench.measurement import Measurement, measure
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.ours import prediction_error
from scenarios.estimators.outcome import MODEL, Answer, EstimatorOutcome
from scenarios.estimators.reference_time import Ruler
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.seeds import task_seed
from scenarios.estimators.task import Task
from scenarios.jobs.executor import at_worker_exit
from scenarios.problems.bound import response_covariance
from scenarios.problems.problem import Bound, Problem
from scenarios.problems.registry import problem as find_problem
from scenarios.problems.trial import ASKS, Trial
from sysid import IOData, Polynomials, StateSpace, SysidWarning
from sysid.models.frequency_response import NORMAL_95
from sysid.records.arrays import FloatArray

FAMILY = re.compile("[-@]")
"""Ends the first word of a problem's name, its family."""

TWIN = "twin-"
"""Names of problems whose records come from the physics begin so."""

PERFECT = "bench:perfect"
"""Target of the perfect estimator; it runs in the bench's own process, since no other process sees the truth."""

LONGEST_REASON = 300
"""Characters of an error that are kept."""


@dataclass(frozen=True)
class BenchSetup:
    """What all jobs of a run share.

    Attributes:
        estimators: In the order by which jobs number them.
        limits: Limits of each answer.
        seed: Of the run.
        records: Folder of records that were simulated before; None: there is none.
        files: Files of the estimators, by which a worker elsewhere checks or makes its own; None on this machine.
    """

    estimators: tuple[Estimator, ...]
    limits: Limits
    seed: int
    records: Path | None = None
    files: tuple[EstimatorFiles, ...] | None = None


@dataclass(frozen=True)
class RecordJob:
    """All requests on one record; estimators take turns, so that a disturbance of the machine hits all of them.

    Attributes:
        problem: Name of the problem.
        draw: Number of the record.
        requests: Pairs of the kind of request and the number of the estimator.
    """

    problem: str
    draw: int
    requests: tuple[tuple[str, int], ...]

    def __str__(self) -> str:
        return f"{self.problem}, record {self.draw}"


@dataclass(frozen=True)
class TrialResult:
    """A finished trial.

    Attributes:
        estimator: Number of the estimator.
        measurement: Its measurements.
        wall: Time that it took, its share of drawing the record included, s.
    """

    estimator: int
    measurement: Measurement
    wall: float


def remaining_jobs(wanted: Sequence[Iterable[Trial]], done: Sequence[Collection[str]]) -> tuple[RecordJob, ...]:
    """Jobs for all trials that are not done, sorted by draw: the first draws of all problems come first.

    Args:
        wanted: Trials of each estimator.
        done: Keys of those that are done, by estimator.
    """
    requests: dict[tuple[int, str], list[tuple[str, int]]] = {}
    for number, (trials, keys) in enumerate(zip(wanted, done, strict=True)):
        for trial in trials:
            if trial.key not in keys:
                requests.setdefault((trial.draw, trial.problem), []).append((trial.ask, number))
    return tuple(
        RecordJob(problem, draw, tuple(sorted(pairs, key=lambda one: (ASKS.index(one[0]), one[1]))))
        for (draw, problem), pairs in sorted(requests.items())
    )


def interleaved(jobs: Iterable[RecordJob]) -> tuple[RecordJob, ...]:
    """Jobs in an order that spreads each family of problems evenly.

    An estimator that hangs on one family alone then never hangs many times in a row, and is not given up.
    """
    families: dict[str, list[RecordJob]] = {}
    for job in jobs:
        families.setdefault(FAMILY.split(job.problem)[0], []).append(job)
    places = [
        ((place + 0.5) / len(family), name, job)
        for name, family in families.items()
        for place, job in enumerate(family)
    ]
    return tuple(job for _, _, job in sorted(places, key=lambda one: one[:2]))


@runtime_checkable
class Efficient(Protocol):
    """A problem with a perfect estimate for each record."""

    def efficient(self, structure: str, seed: int) -> FloatArray:
        """Its parameters (p,)."""

    def realise(self, structure: str, theta: FloatArray) -> tuple[StateSpace, Polynomials | None]:
        """The model with these parameters, and its polynomials."""


@runtime_checkable
class Scattered(Protocol):
    """A problem without bound, with an estimate as good as any for each record."""

    def scattered(self, seed: int) -> StateSpace:
        """The model."""


def perfect(problem: Problem, task: Task, seed: int) -> EstimatorOutcome:
    """Answer as well as possible.

    The truth with an error of exactly the Cramér-Rao covariance, claiming exactly that; the truth itself where there is
    no noise or no bound. Where the orders are to be chosen, those of the truth; where they are too low, the
    prediction-error fit to the record. An error that makes the model unstable counts as such and is not drawn again:
    the rest of a distribution after redrawing has another covariance.

    Args:
        problem: With its truth.
        task: The task.
        seed: Of the record; the error belongs to it.
    """
    fit = problem.task(task.structure)
    if not task.chooses and (fit is None or dict(task.orders) != dict(fit.orders)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)  # a model that is too small is known not to fit
            answer = Answer(prediction_error(problem.draw(seed), task).model)
    else:
        bound = problem.bound(task.structure)
        if bound is not None and isinstance(problem, Efficient):
            model, polynomials = problem.realise(task.structure, problem.efficient(task.structure, seed))
            answer = _with_claims(bound, model, None if task.structure == "ss" else polynomials)
        elif isinstance(problem, Scattered):
            answer = Answer(problem.scattered(seed))
        else:
            answer = Answer(problem.truth)
    if not answer.model.input_path().is_stable():
        return EstimatorOutcome("unstable", "the error of a perfect estimate makes it unstable", answer=answer)
    return EstimatorOutcome(MODEL, answer=answer)


def _with_claims(bound: Bound, model: StateSpace, polynomials: Polynomials | None) -> Answer:
    hz = model.bandwidth()
    factor = np.exp(NORMAL_95 * bound.bandwidth_deviation)
    return Answer(
        model,
        polynomials,
        None if polynomials is None else bound.covariance,
        response_covariance(bound),
        (hz / factor, np.minimum(hz * factor, 0.5 / model.dt)),
    )


class Runner:
    """Runs jobs in this process; estimators stay open from one job to the next.

    Args:
        setup: What the jobs share.
    """

    def __init__(self, setup: BenchSetup) -> None:
        self._setup = setup
        self._processes: dict[int, EstimatorProcess] = {}
        self._opened: set[int] = set()
        self._bounds: dict[tuple[str, str | None], Bound | None] = {}

    def __enter__(self) -> "Runner":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with ExitStack() as stack:
            while self._processes:
                stack.push(self._processes.popitem()[1])

    def run(self, job: RecordJob) -> Iterator[TrialResult]:
        """Run a job.

        Args:
            job: Its requests; those that an estimator's structure does not allow are left out.

        Yields:
            All results at the end: the reference time is measured before the first request and after the last.
        """
        if self._setup.records is not None and job.problem.startswith(TWIN):
            from scenarios.problems.twin_records import use_folder

            use_folder(self._setup.records)
        problem = find_problem(job.problem)
        # the first estimator finds caches as the record left them: another one at every draw
        first = job.draw % max(1, len(job.requests))
        requests = [
            (number, Trial(job.problem, job.draw, ask), task)
            for ask, number in job.requests[first:] + job.requests[:first]
            if (task := problem.task(self._setup.estimators[number].structure, ask)) is not None
        ]
        if not requests:
            return
        for number, _, _ in requests:
            # outside the time of any trial, because it is done once for many of them
            self._prepare(number, problem)
        begun = perf_counter()
        seed = requests[0][1].seed(self._setup.seed)
        record = problem.draw(seed)
        ruler = Ruler(record)
        ruler.measure()
        shared = (perf_counter() - begun) / len(requests)
        outcomes: list[tuple[EstimatorOutcome, float]] = []
        for number, trial, task in requests:
            begun = perf_counter()
            seeded = replace(task, seed=task_seed(self._setup.seed, trial.key))
            outcomes.append((self._ask(number, problem, seeded, record, seed), perf_counter() - begun))
        ruler.measure()
        for (number, trial, task), (outcome, wall) in zip(requests, outcomes, strict=True):
            begun = perf_counter()
            bound = self._bounds[problem.name, self._setup.estimators[number].structure]
            measurement = measure(problem, trial, task, bound, record, outcome, ruler_seconds=ruler.seconds)
            yield TrialResult(number, measurement, shared + wall + perf_counter() - begun)

    def _ask(self, number: int, problem: Problem, task: Task, record: IOData, seed: int) -> EstimatorOutcome:
        if self._setup.estimators[number].target == PERFECT:
            return perfect(problem, task, seed)  # its error belongs to the noise of the record
        try:
            if number not in self._processes:
                self._open(number)
            return self._processes[number].ask(record, task)
        # An estimator that makes the bench's own code fail has failed; the others go on.
        except Exception as error:
            process = self._processes.pop(number, None)
            if process is not None:
                with suppress(Exception):
                    process.__exit__(None, None, None)
            return EstimatorOutcome("crash", f"its process failed: {type(error).__name__}: {error}"[:LONGEST_REASON])

    def _prepare(self, number: int, problem: Problem) -> None:
        estimator = self._setup.estimators[number]
        if (problem.name, estimator.structure) not in self._bounds:
            self._bounds[problem.name, estimator.structure] = problem.bound(estimator.structure)
        if number not in self._opened and estimator.target != PERFECT:
            self._open(number)

    def _open(self, number: int) -> None:
        """Open a process; an error of the first time is one of the command line, and ends the run."""
        process = EstimatorProcess(self._setup.estimators[number], self._setup.limits)
        process.__enter__()
        self._processes[number] = process
        self._opened.add(number)


_THREAD = local()
"""The runner of this worker, which stays from one batch to the next."""


def run_jobs(setup: BenchSetup, jobs: Sequence[RecordJob]) -> Iterator[TrialResult]:
    """Run jobs; executors call it in their workers.

    Raises:
        ScenarioError: The files of an estimator differ here.
    """
    if setup.files is None:
        if getattr(_THREAD, "setup", None) != setup:
            _THREAD.setup, _THREAD.runner = setup, Runner(setup)
            at_worker_exit(partial(Runner.__exit__, _THREAD.runner, None, None, None))
        for job in jobs:
            yield from _THREAD.runner.run(job)
        return
    # A worker elsewhere serves many runs: it closes the estimators after each batch.
    with tempfile.TemporaryDirectory(prefix="hmtb-verify-") as folder:
        estimators = tuple(
            files.unpacked(estimator, Path(folder) / str(number))
            for number, (estimator, files) in enumerate(zip(setup.estimators, setup.files, strict=True))
        )
        simulate_records([Trial(job.problem, job.draw) for job in jobs], setup.seed, None, threads=1)
        with Runner(replace(setup, estimators=estimators)) as runner:
            for job in jobs:
                yield from runner.run(job)


def simulate_records(trials: Sequence[Trial], seed: int, folder: Path | None, *, threads: int | None = None) -> int:
    """Simulate the records of the twin's trials in one batch, which takes a tenth of the time of single simulations.

    Args:
        trials: Trials of any problems.
        seed: Of the run.
        folder: Where records are kept for other processes; None: they are kept in this process.
        threads: Threads for the physics, all processors by default.

    Returns:
        Number of records that were simulated: not those that existed, nor those of other problems.
    """
    of_twin = [trial for trial in trials if trial.problem.startswith(TWIN)]
    if not of_twin:
        return 0
    # imported late: it loads the physics
    from scenarios.problems.twin_records import prepare

    return prepare(of_twin, seed, folder=folder, threads=threads)
