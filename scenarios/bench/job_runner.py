"""Runs the jobs of the test bench: draws a record, passes it to every estimator that needs it, measures the answers."""

import re
import tempfile
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import local
from time import perf_counter

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
from scenarios.problems.linear_problem import LinearProblem
from scenarios.problems.mimo import MimoProblem
from scenarios.problems.problem import Problem
from scenarios.problems.registry import problem as find_problem
from scenarios.problems.trial import ASKS, TWIN, Trial
from sysid import IOData, SysidWarning
from sysid.models.frequency_response import NORMAL_95
from sysid.validation import CramerRaoBound

FAMILY = re.compile("[-@]")
"""Ends the first word of a problem's name, its family."""


@dataclass(frozen=True)
class BenchSetup:
    """Settings that all jobs of a run share.

    Attributes:
        estimators: In the order by which jobs number them.
        limits: Limits of each answer.
        seed: Of the run.
        files: Files of the estimators, by which a worker elsewhere checks or makes its own; None on this machine.
    """

    estimators: tuple[Estimator, ...]
    limits: Limits
    seed: int
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
    """A finished trial: its measurement and its duration.

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
    for estimator, (trials, keys) in enumerate(zip(wanted, done, strict=True)):
        for trial in trials:
            if trial.key not in keys:
                requests.setdefault((trial.draw, trial.problem), []).append((trial.ask, estimator))
    jobs = []
    for (draw, problem), of_record in sorted(requests.items()):
        ordered = sorted(of_record, key=lambda request: (ASKS.index(request[0]), request[1]))
        jobs.append(RecordJob(problem, draw, tuple(ordered)))
    return tuple(jobs)


def interleaved(jobs: Iterable[RecordJob]) -> tuple[RecordJob, ...]:
    """Jobs in an order that spreads each family of problems evenly.

    An estimator that hangs on one family alone then never hangs many times in a row, and is not given up.
    """
    families: dict[str, list[RecordJob]] = {}
    for job in jobs:
        families.setdefault(FAMILY.split(job.problem)[0], []).append(job)
    # Each job stands at its share of its own family; families that meet there go by name.
    shares: dict[RecordJob, tuple[float, str]] = {}
    for name, family in families.items():
        for index, job in enumerate(family):
            shares[job] = ((index + 0.5) / len(family), name)
    return tuple(sorted(shares, key=shares.__getitem__))


def twin_trials(jobs: Iterable[RecordJob]) -> list[Trial]:
    """Trials of the jobs whose records are simulated with the arm."""
    return [Trial(job.problem, job.draw) for job in jobs if job.problem.startswith(TWIN)]


def perfect(problem: Problem, task: Task, seed: int) -> EstimatorOutcome:
    """Answer of a perfect estimator, which knows the truth and the bound.

    The truth with an error of exactly the Cramér-Rao covariance, claiming exactly that; the truth itself where there is
    no noise or no bound. Where the orders are to be chosen, those of the truth; where they are too low, the
    prediction-error fit to the record. An error that makes the model unstable counts as such and is not drawn again:
    the rest of a distribution after redrawing has another covariance. The error belongs to the record, by its seed.
    """
    fit = problem.task(task.structure)
    bound = problem.bound(task.structure)
    if not task.chooses and (fit is None or dict(task.orders) != dict(fit.orders)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SysidWarning)  # a model that is too small is known not to fit
            answer = Answer(prediction_error(problem.draw(seed), task).model)
    elif bound is not None and isinstance(problem, LinearProblem | MimoProblem):
        answer = _efficient_answer(problem, task.structure, seed, bound)
    else:
        answer = Answer(problem.scattered(seed))
    if not answer.model.input_path().is_stable():
        return EstimatorOutcome("unstable", "the error of a perfect estimate makes it unstable", answer=answer)
    return EstimatorOutcome(MODEL, answer=answer)


def _efficient_answer(problem: LinearProblem | MimoProblem, structure: str, seed: int, bound: CramerRaoBound) -> Answer:
    """The truth with an error of the Cramér-Rao covariance, claiming exactly that."""
    model, polynomials = problem.realise(structure, problem.efficient(structure, seed))
    # The coordinates of a state space are its own: no covariance of parameters is claimed.
    if structure == "ss":
        polynomials = None
    covariance = None if polynomials is None else bound.covariance
    # The deviation is that of the logarithm; above the Nyquist frequency a sampled model has no bandwidth.
    hz, factor = model.bandwidth(), np.exp(NORMAL_95 * bound.bandwidth_deviation)
    interval = (hz / factor, np.minimum(hz * factor, 0.5 / model.dt))
    return Answer(model, polynomials, covariance, bound.response_covariance, interval)


class Runner:
    """Runs jobs in this process; estimators stay open from one job to the next."""

    def __init__(self, setup: BenchSetup) -> None:
        self._setup = setup
        self._processes: dict[int, EstimatorProcess] = {}
        self._opened: set[int] = set()

    def close(self) -> None:
        """End the estimators."""
        with ExitStack() as stack:
            # The stack ends all of them, also where ending one fails.
            while self._processes:
                stack.push(self._processes.popitem()[1])

    def run(self, job: RecordJob) -> Iterator[TrialResult]:
        """Run a job.

        Args:
            job: Its requests; those that an estimator's structure does not allow are left out.

        Yields:
            All results at the end: the reference time is measured before the first request and after the last.
        """
        problem = find_problem(job.problem)
        requests = self._requests(job, problem)
        if not requests:
            return
        # Bounds and starts are outside the time of any trial, because they are made once for many of them.
        for estimator, _, task in requests:
            problem.bound(task.structure)
            # An error of the first start is one of the command line, and ends the run.
            if estimator not in self._opened and not self._setup.estimators[estimator].is_perfect:
                self._process(estimator)
        begun = perf_counter()
        seed = requests[0][1].seed(self._setup.seed)
        record = problem.draw(seed)
        # On the same record, so that its length and the state of the machine are those of the estimators.
        ruler = Ruler(record)
        ruler.measure()
        shared = (perf_counter() - begun) / len(requests)
        outcomes: list[tuple[EstimatorOutcome, float]] = []
        for estimator, trial, task in requests:
            begun = perf_counter()
            seeded = replace(task, seed=task_seed(self._setup.seed, trial.key))
            outcomes.append((self._ask(estimator, problem, seeded, record, seed), perf_counter() - begun))
        ruler.measure()
        for (estimator, trial, task), (outcome, wall) in zip(requests, outcomes, strict=True):
            begun = perf_counter()
            measurement = measure(problem, trial, task, record, outcome, ruler_seconds=ruler.seconds)
            yield TrialResult(estimator, measurement, shared + wall + perf_counter() - begun)

    def _requests(self, job: RecordJob, problem: Problem) -> list[tuple[int, Trial, Task]]:
        """Estimator, trial and task of each request that the estimator's structure allows."""
        # The first estimator finds caches as the record left them: another one at every draw.
        first = job.draw % max(1, len(job.requests))
        requests = []
        for ask, estimator in job.requests[first:] + job.requests[:first]:
            task = problem.task(self._setup.estimators[estimator].structure, ask)
            if task is not None:
                requests.append((estimator, Trial(job.problem, job.draw, ask), task))
        return requests

    def _ask(self, estimator: int, problem: Problem, task: Task, record: IOData, seed: int) -> EstimatorOutcome:
        """The outcome of one request; an error of the bench itself counts as a crash of the estimator."""
        if self._setup.estimators[estimator].is_perfect:
            return perfect(problem, task, seed)  # its error belongs to the noise of the record
        try:
            return self._process(estimator).ask(record, task)
        # An estimator that makes the bench's own code fail has failed; the others go on.
        except Exception as error:
            with suppress(Exception):
                self._processes.pop(estimator).__exit__(None, None, None)
            return EstimatorOutcome("crash", f"its process failed: {type(error).__name__}: {error}"[:300])

    def _process(self, estimator: int) -> EstimatorProcess:
        """The open process of an estimator, started where there is none."""
        if estimator not in self._processes:
            process = EstimatorProcess(self._setup.estimators[estimator], self._setup.limits)
            self._processes[estimator] = process.__enter__()
            self._opened.add(estimator)
        return self._processes[estimator]


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
            # Processes of estimators end with the worker that started them.
            at_worker_exit(_THREAD.runner.close)
        for job in jobs:
            yield from _THREAD.runner.run(job)
        return
    # A worker elsewhere serves many runs: it closes the estimators after each batch.
    with tempfile.TemporaryDirectory(prefix="hmtb-verify-") as folder:
        estimators = []
        for index, (estimator, files) in enumerate(zip(setup.estimators, setup.files, strict=True)):
            estimators.append(files.unpacked(estimator, Path(folder) / str(index)))
        if twins := twin_trials(jobs):
            from scenarios.problems.twin_records import prepare  # it loads the physics

            prepare(twins, setup.seed, threads=1)
        with closing(Runner(replace(setup, estimators=tuple(estimators)))) as runner:
            for job in jobs:
                yield from runner.run(job)
