"""Estimators on the test bench: trials are run and measured, and metrics with verdicts are made of them."""

import json
import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from itertools import chain
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from hmtb_twin.files.atomic_write import write_whole
from scenarios.bench.accuracy import Agreement
from scenarios.bench.estimator_files import EstimatorFiles, source_hash
from scenarios.bench.job_runner import (
    FAMILY,
    BenchSetup,
    RecordJob,
    interleaved,
    remaining_jobs,
    run_jobs,
    twin_trials,
)
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import DRAWS, Evidence, MetricDefinition
from scenarios.bench.metrics import ALL_METRICS, false_alarm_of_each
from scenarios.bench.result import Result, machine
from scenarios.bench.run_progress import (
    IDENTITY,
    RunProgress,
    TrialJournal,
    file_name,
    fingerprint_of,
    pilot_jobs,
    remaining_cost,
)
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.seeds import draw_run_seed
from scenarios.files.codec import from_json
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.jobs.executor import Executor
from scenarios.jobs.progress import Progress, Report, duration_text
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

JOURNALS = "journals"
"""Folder of the journals, in that of the results; beside them a file of the seeds that were drawn."""

RECORDS = "records"
"""Folder of simulated records of the arm, in that of the results."""

LONGEST_NAME = 100
"""Characters of an estimator's name, which files are named by."""

TOGETHER = 100
"""Records of the arm that are simulated side by side, and then kept."""

REMOTE_BATCH = 8
"""Records that go to a worker elsewhere at a time: estimators are started once for all of them."""


@dataclass(frozen=True)
class BenchPlan:
    """Settings of a run.

    Attributes:
        estimators: Estimators whose results are wanted.
        effort: One of `DRAWS`.
        seed: Of the run; None: it is drawn once the estimators' files have been hashed.
        limits: Limits of each answer.
        metrics: Metrics to compute, all by default.
        referee: The second implementation, for the metric of agreement; None: there is none here.
        commands: Command line that repeats a result, without the seed, by the estimator's name.
        records: Most records of each problem, for slow estimators; None: all.
    """

    estimators: tuple[Estimator, ...]
    effort: str = "full"
    seed: int | None = 0
    limits: Limits = field(default_factory=Limits)
    metrics: tuple[MetricDefinition, ...] = ALL_METRICS
    referee: Estimator | None = None
    commands: Mapping[str, str] = field(default_factory=dict)
    records: int | None = None

    def __post_init__(self) -> None:
        if self.effort not in DRAWS:
            raise ScenarioError(f"effort {self.effort!r} given, expected one of {', '.join(DRAWS)}")
        if self.seed is not None and not 0 <= self.seed < 2**63:
            raise ScenarioError(f"seed {self.seed} given, expected a whole number from 0 to 2^63 - 1")
        if self.records is not None and self.records < 1:
            raise ScenarioError(f"{self.records} records given, expected 1 or more")
        if not self.estimators:
            raise ScenarioError("no estimator given, expected one or several")
        # Names that differ only in characters that no file may have would share a file.
        counts = Counter(file_name(estimator.name) for estimator in self.estimators)
        if repeated := [name for name, times in counts.items() if times > 1]:
            raise ScenarioError(f"estimators of the same name given: {', '.join(repeated)}; expected a name each")
        for estimator in self.estimators:
            name = estimator.name
            if len(name) > LONGEST_NAME or not name.isprintable():
                raise ScenarioError(
                    f"an estimator called {name[:LONGEST_NAME]!r} given, expected at most {LONGEST_NAME} characters "
                    "that can be printed; --name gives it another"
                )

    @property
    def effort_text(self) -> str:
        """The effort in words, as results have it."""
        if self.records is None:
            return self.effort
        records = "1 record" if self.records == 1 else f"{self.records} records"
        return f"{self.effort}, at most {records} of a problem"

    @property
    def requests_text(self) -> str:
        """Number of requests in words: to the estimators, and to the referee beside them."""
        counts = {estimator.name: len(self.trials(estimator)) for estimator in self.all_estimators()}
        wanted = sum(counts.pop(estimator.name) for estimator in self.estimators)
        beside = "".join(f" and {count} to {name} for the figure of agreement" for name, count in counts.items())
        return f"{wanted} requests{beside}"

    def all_estimators(self) -> tuple[Estimator, ...]:
        """Estimators whose results are wanted, and the referee where a metric needs it and it is none of them."""
        needed = any(metric.name == Agreement.name for metric in self.metrics)
        if not needed or self.referee is None or self.referee in self.estimators:
            return self.estimators
        return (*self.estimators, self.referee)

    def trials_of(self, metric: MetricDefinition) -> tuple[Trial, ...]:
        """Trials of one of the metrics."""
        trials = metric.trials(self.effort)
        return trials if self.records is None else tuple(trial for trial in trials if trial.draw < self.records)

    def trials(self, estimator: Estimator) -> tuple[Trial, ...]:
        """Trials of one of `all_estimators` that its structure allows, each once, sorted."""
        metrics = list(self.metrics)
        # The referee is asked beside the others, for agreement alone.
        if estimator not in self.estimators:
            metrics = [metric for metric in metrics if metric.name == Agreement.name]
        wanted = sorted(set(chain.from_iterable(self.trials_of(metric) for metric in metrics)))
        requests = {(trial.problem, trial.ask) for trial in wanted}
        allowed = {request for request in requests if _has_task(estimator, *request)}
        return tuple(trial for trial in wanted if (trial.problem, trial.ask) in allowed)


def _has_task(estimator: Estimator, problem_name: str, ask: str) -> bool:
    return problem(problem_name).task(estimator.structure, ask) is not None


def verify(
    plan: BenchPlan,
    folder: Path,
    executor: Executor,
    *,
    replaces: Callable[[Path], None] = lambda path: None,
    report: Report = lambda progress: None,
    notify: Callable[[str], None] = lambda line: None,
) -> list[Result]:
    """Run the trials that are missing, and write a result for each estimator to a file of its name.

    Args:
        plan: What to run.
        folder: For results and journals; made where it is missing.
        executor: Runs the trials.
        replaces: Called with a result file of another run before it is replaced; it may refuse with an error.
        report: Called with the progress.
        notify: Called with lines of information, among them the cost of the run, once the first trials of each kind of
            problem are finished.

    Raises:
        ScenarioError: The plan cannot be run, or workers die; finished trials are kept.
        OSError: A file cannot be written.
    """
    estimators = plan.all_estimators()
    seed = _prepare_folder(plan, folder, replaces)
    records = (folder / RECORDS).resolve() if executor.local else None
    # Workers elsewhere get the files of functions, and check those of programs.
    files = None if executor.local else tuple(map(EstimatorFiles.of, estimators))
    setup = BenchSetup(estimators, plan.limits, seed, files)
    wanted = [plan.trials(estimator) for estimator in estimators]
    with ExitStack() as stack:
        # Results of one run share a mark: their speeds were measured side by side.
        run = secrets.token_hex(6)
        journals = []
        for estimator in estimators:
            fingerprint = fingerprint_of(estimator, plan.limits, seed)
            journal = TrialJournal(folder / JOURNALS, estimator.name, fingerprint, run=run, notify=notify)
            journals.append(stack.enter_context(closing(journal)))
        jobs = remaining_jobs(wanted, [journal.done for journal in journals])
        total = sum(map(len, wanted))
        # Trials of an interrupted run are in its journal.
        if kept := total - sum(len(job.requests) for job in jobs):
            notify(f"{kept} of {total} trials are done already; remove {folder / JOURNALS} to run them again")
        if records is not None and (twins := twin_trials(jobs)):
            # Started once before the long simulation, so that an error in the command line shows at once.
            _try_to_start(plan, jobs)
            _simulate(twins, seed, records, report, notify)
        _run(plan, setup, jobs, executor, RunProgress(wanted, journals, report, notify), notify)
        computer = machine() if executor.local else f"{executor.workers} workers of a cluster"
        return _write_results(plan, folder, wanted, journals, {"seed": seed, "machine": computer}, notify)


def _prepare_folder(plan: BenchPlan, folder: Path, replaces: Callable[[Path], None]) -> int:
    """Check that results may be written, ask about those of other runs, and return the seed of the run."""
    # All are checked before the first question, so that no answer is given in vain.
    results_before = {}
    for estimator in plan.estimators:
        results_before[estimator] = _check_place(_result_file(folder, estimator), estimator, plan)
    seed = plan.seed
    if seed is None:
        seed = _drawn_seed(folder / JOURNALS / "drawn-seeds.json", plan.estimators)
    for estimator, before in results_before.items():
        made_with = (seed, source_hash(estimator), plan.limits)
        if before is None or (before.seed, before.source, before.limits) != made_with:
            replaces(_result_file(folder, estimator))
    return seed


def _result_file(folder: Path, estimator: Estimator) -> Path:
    return folder / f"{file_name(estimator.name)}.json"


def _try_to_start(plan: BenchPlan, jobs: Iterable[RecordJob]) -> None:
    """Start and end each estimator that jobs ask; an error of the command line ends the run."""
    asked: set[int] = set()
    for job in jobs:
        asked |= {estimator for _, estimator in job.requests}
    for index in sorted(asked):
        estimator = plan.all_estimators()[index]
        if not estimator.is_perfect:
            with EstimatorProcess(estimator, plan.limits):
                pass


def _write_results(
    plan: BenchPlan,
    folder: Path,
    wanted: Sequence[Sequence[Trial]],
    journals: Sequence[TrialJournal],
    origin: Mapping[str, Any],
    notify: Callable[[str], None],
) -> list[Result]:
    """Compute and write the results of the estimators whose results are wanted."""
    estimators = plan.all_estimators()
    measurements = [journal.measurements() for journal in journals]
    referee = measurements[estimators.index(plan.referee)] if plan.referee in estimators else {}
    results = []
    for estimator, trials, journal, done in zip(estimators, wanted, journals, measurements, strict=True):
        if source_hash(estimator) != journal.source:
            notify(f"{estimator.name}: its file changed during the run: some answers may be those of the new one")
        if estimator in plan.estimators:
            # The journal may have trials of other efforts too.
            measured = {trial: done[trial] for trial in trials if trial in done}
            origin_of_result = {**origin, "run": journal.run, "source": journal.source}
            results.append(_result(plan, estimator, measured, referee, origin_of_result))
            write_whole(_result_file(folder, estimator), results[-1].to_json(), durable=True)
    return results


def _check_place(path: Path, estimator: Estimator, plan: BenchPlan) -> Result | None:
    """Refuse to overwrite the result of another estimator, or a more complete one; return the result that is there."""
    try:
        before = Result.read(path)
    # There is none, or it is damaged or of another version: nothing that could be lost.
    except ScenarioError:
        return None
    if any(getattr(before.estimator, name) != getattr(estimator, name) for name in IDENTITY):
        raise ScenarioError(
            f"{path} has the result of another estimator of the name {estimator.name!r}, {before.estimator.target!r}; "
            "expected another --name, or another --out"
        )
    asked = len(replace(plan, estimators=(before.estimator,)).trials(before.estimator))
    if missing := before.metrics.keys() - {metric.name for metric in plan.metrics}:
        lost = f"figures that this run does not make ({', '.join(sorted(missing))})"
    elif sum(before.outcomes.values()) > asked:
        lost = f"records that this run does not ask ({before.effort}; now {plan.effort_text})"
    else:
        return before
    raise ScenarioError(
        f"{path} has the result of a more complete run, with {lost}; it is not overwritten: give another --out, or "
        "move that file away"
    )


def _drawn_seed(path: Path, estimators: Sequence[Estimator]) -> int:
    """Draw the seed of a run, or read that of an interrupted run, which a file has by hash of the estimators."""
    hashes = [source_hash(estimator) for estimator in estimators]
    identities = []
    for estimator, source in zip(estimators, hashes, strict=True):
        identities.append(f"{estimator.target}|{estimator.home}|{source}")
    key = sha256("\n".join(identities).encode()).hexdigest()
    seeds: dict[str, int] = {}
    # A file that is missing or damaged has no seed of an interrupted run.
    with suppress(OSError, ScenarioError):
        seeds = from_json(dict[str, int], path.read_bytes(), str(path))
    if key not in seeds:
        # Drawn behind the hashes, so that no file could have been written for the seed.
        seeds[key] = draw_run_seed(hashes)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(seeds), durable=True)
    return seeds[key]


def _simulate(trials: Sequence[Trial], seed: int, folder: Path, report: Report, notify: Callable[[str], None]) -> None:
    """Simulate the arm's records side by side before the estimators are asked."""
    from scenarios.problems.twin_records import prepare  # it loads the physics

    begun = monotonic()
    simulated = 0
    # Kept batch by batch: an interrupted run loses one batch at most.
    for first in range(0, len(trials), TOGETHER):
        batch = trials[first : first + TOGETHER]

        # Defaults bind the values of this batch: a closure would see those of the last one.
        def share(done: int, total: int, first: int = first, size: int = len(batch)) -> None:
            report(Progress("records of the arm", first + size * done // total, len(trials)))

        share(0, 1)
        simulated += prepare(batch, seed, folder=folder, progress=share)
        if simulated and (spent := monotonic() - begun) > 10.0:  # short work is not worth a line
            ready = min(first + TOGETHER, len(trials))
            notify(f"{ready} of {len(trials)} records of the arm simulated in {duration_text(spent)}")


def _run(
    plan: BenchPlan,
    setup: BenchSetup,
    jobs: Sequence[RecordJob],
    executor: Executor,
    progress: RunProgress,
    notify: Callable[[str], None],
) -> None:
    """Run the jobs: first a record of each kind of problem, from which the cost of the others is learnt."""
    first, later = pilot_jobs(jobs)
    # On this machine a worker takes one record at a time, so that none waits at the end.
    size = 1 if executor.local else REMOTE_BATCH
    if not jobs:
        return
    finished = []
    with executor:
        for result in executor.run(run_jobs, setup, progress.batches(interleaved(first), size), items="records"):
            progress.add(result)
            finished.append(result)
        if rest := tuple(chain.from_iterable(progress.batches(later, 1))):
            cost = remaining_cost(finished, rest, executor.workers)
            notify(f"hmtb verify: still to do, of {plan.requests_text}: {cost}")
            progress.note = ""
            for result in executor.run(run_jobs, setup, progress.batches(interleaved(rest), size), items="records"):
                progress.add(result)


def _result(
    plan: BenchPlan,
    estimator: Estimator,
    measured: Mapping[Trial, Measurement],
    referee: Mapping[Trial, Measurement],
    origin: Mapping[str, Any],
) -> Result:
    """Compute the metrics of an estimator; those of agreement need the measurements of the referee too."""
    command = plan.commands.get(estimator.name, "")
    if command:
        # The seed may have been drawn: with it the command repeats the result.
        command += f" --seed {origin['seed']}"
    share = false_alarm_of_each()
    metrics = {}
    for metric in plan.metrics:
        trials = plan.trials_of(metric)
        on_trials = [measured[trial] for trial in trials if trial in measured]
        of_referee = [referee[trial] for trial in trials if trial in referee]
        metrics[metric.name] = metric.evaluate(Evidence(on_trials, estimator, share, of_referee))
    outcomes = Counter(m.kind for m in measured.values())
    failed = [m for m in measured.values() if m.kind not in (MODEL, REFUSED)]
    reasons = Counter(f"{m.kind}: {m.why}" for m in failed)
    refused = kinds_of_request(m.trial for m in measured.values() if m.kind == REFUSED)
    return Result(
        estimator=estimator,
        limits=plan.limits,
        effort=plan.effort_text,
        command=command,
        versions=versions(),
        outcomes=dict(sorted(outcomes.items())),
        reasons=dict(reasons.most_common(20)),  # where each failure has another reason, they would fill the file
        seconds=float(np.nansum([m.seconds for m in measured.values()])),
        metrics=metrics,
        refused=dict(refused.most_common()),
        **origin,
    )


def kinds_of_request(trials: Iterable[Trial]) -> Counter[str]:
    """Number of trials of each family of problems, and of each request where that is no fit."""
    counts: Counter[str] = Counter()
    for trial in trials:
        family = FAMILY.split(trial.problem)[0]
        request = family if trial.ask == "fit" else f"{family}, {trial.ask}"
        counts[request] += 1
    return counts
