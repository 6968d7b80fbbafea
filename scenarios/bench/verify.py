"""Estimators on the test bench: trials are run and measured, and metrics with verdicts are made of them."""

import json
import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import chain
from pathlib import Path
from time import monotonic

import numpy as np

from scenarios.bench.estimator_files import EstimatorFiles, source_hash
from scenarios.bench.measurement import Measurement, Measurements
from scenarios.bench.metric import DRAWS, MetricDefinition
from scenarios.bench.metrics import ALL_METRICS, false_alarm_of_each
from scenarios.bench.progress import (
    IDENTITY,
    Cost,
    CostModel,
    Report,
    RunProgress,
    TrialJournal,
    file_name,
    fingerprint_of,
    pilot_jobs,
    time_text,
)
from scenarios.bench.result import Result, effort_text, lost_by, machine, trials_within
from scenarios.bench.runner import (
    FAMILY,
    PERFECT,
    TWIN,
    BenchSetup,
    RecordJob,
    interleaved,
    remaining_jobs,
    run_jobs,
    simulate_records,
)
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.runner import EstimatorProcess
from scenarios.estimators.seeds import draw_run_seed
from scenarios.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.jobs.executor import Executor
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

JOURNALS = "journals"
"""Folder of the journals, in that of the results."""

SEEDS = "drawn-seeds.json"
"""File of the seeds that were drawn, among the journals."""

RECORDS = "records"
"""Folder of simulated records of the arm, beside it."""

AGREEMENT = "agreement"
"""Metric that needs the second implementation."""

LONGEST_NAME = 100
"""Characters of an estimator's name, which files are named by."""

REASONS = 20
"""Reasons of failures that a result keeps."""

TOGETHER = 100
"""Records of the arm that are simulated side by side, and then kept."""

REMOTE_BATCH = 8
"""Records that go to a worker elsewhere at a time: estimators are started once for all of them."""

SILENCE = 10.0
"""Time after which the progress of the simulation is reported, s."""


@dataclass(frozen=True)
class BenchPlan:
    """What to run.

    Attributes:
        contestants: Estimators whose results are wanted.
        effort: One of `DRAWS`.
        seed: Of the run; None: it is drawn once the estimators' files have been hashed.
        limits: Limits of each answer.
        figures: Metrics to compute, all by default.
        referee: The second implementation, for the metric of agreement; None: there is none here.
        commands: Command line that repeats a result, without the seed, by the estimator's name.
        records: Most records of each problem, for slow estimators; None: all.
    """

    contestants: tuple[Estimator, ...]
    effort: str = "full"
    seed: int | None = 0
    limits: Limits = field(default_factory=Limits)
    figures: tuple[MetricDefinition, ...] = ALL_METRICS
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
        if not self.contestants:
            raise ScenarioError("no estimator given, expected one or several")
        twice = [name for name, count in Counter(file_name(c.name) for c in self.contestants).items() if count > 1]
        if twice:
            raise ScenarioError(f"estimators of the same name given: {', '.join(twice)}; expected a name each")
        for name in (estimator.name for estimator in self.contestants):
            if len(name) > LONGEST_NAME or not name.isprintable():
                raise ScenarioError(
                    f"an estimator called {name[:LONGEST_NAME]!r} given, expected at most {LONGEST_NAME} characters "
                    "that can be printed; --name gives it another"
                )

    def all_contestants(self) -> tuple[Estimator, ...]:
        """Estimators whose results are wanted, and the referee where a metric needs it and it is none of them."""
        needed = any(metric.name == AGREEMENT for metric in self.figures)
        if not needed or self.referee is None or self.referee in self.contestants:
            return self.contestants
        return (*self.contestants, self.referee)

    def trials_of(self, metric: MetricDefinition) -> tuple[Trial, ...]:
        """Trials of one of the metrics."""
        return trials_within(metric, self.effort, self.records)

    def trials(self, estimator: Estimator) -> tuple[Trial, ...]:
        """Trials of one of `all_contestants` that its structure allows, each once, sorted."""
        own = estimator in self.contestants
        metrics = [metric for metric in self.figures if own or metric.name == AGREEMENT]
        wanted = sorted(set(chain.from_iterable(self.trials_of(metric) for metric in metrics)))
        allowed = {
            kind: problem(kind[0]).task(estimator.structure, kind[1]) is not None
            for kind in {(trial.problem, trial.ask) for trial in wanted}
        }
        return tuple(trial for trial in wanted if allowed[trial.problem, trial.ask])


def verify(
    plan: BenchPlan,
    folder: Path,
    executor: Executor,
    *,
    report: Report = lambda done, total, left: None,
    notify: Callable[[str], None] = lambda line: None,
    announce: Callable[[Cost], None] = lambda cost: None,
) -> list[Result]:
    """Run the trials that are missing, and write a result for each estimator to a file of its name.

    Args:
        plan: What to run.
        folder: For results and journals; made where it is missing.
        executor: Runs the trials.
        report: Called with the progress.
        notify: Called with lines of information.
        announce: Called with the cost of the run, once the first trials of each kind of problem are finished.

    Returns:
        The results.

    Raises:
        ScenarioError: The plan cannot be run, or workers die; finished trials are kept.
        OSError: A file cannot be written.
    """
    estimators = plan.all_contestants()
    for estimator in plan.contestants:
        _check_place(folder / f"{file_name(estimator.name)}.json", estimator, plan)
    seed = _drawn_seed(folder / JOURNALS / SEEDS, plan.contestants) if plan.seed is None else plan.seed
    records = (folder / RECORDS).resolve() if executor.local else None
    files = None if executor.local else tuple(map(EstimatorFiles.of, estimators))
    setup = BenchSetup(estimators, plan.limits, seed, records, files)
    wanted = [plan.trials(estimator) for estimator in estimators]
    with ExitStack() as stack:
        run = secrets.token_hex(6)
        fingerprints = [fingerprint_of(estimator, plan.limits, seed) for estimator in estimators]
        journals = [
            stack.enter_context(TrialJournal(folder / JOURNALS, estimator.name, fingerprint, run=run, notify=notify))
            for estimator, fingerprint in zip(estimators, fingerprints, strict=True)
        ]
        jobs = remaining_jobs(wanted, [journal.done for journal in journals])
        total = sum(map(len, wanted))
        if kept := total - sum(len(job.requests) for job in jobs):
            notify(f"{kept} of {total} trials are done already; remove {folder / JOURNALS} to run them again")
        if records is not None and any(job.problem.startswith(TWIN) for job in jobs):
            _try_estimators(jobs, setup)
            _simulate(jobs, seed, records, notify)
        names = [estimator.name for estimator in estimators]
        _run(setup, jobs, executor, RunProgress(names, wanted, journals, report, notify), announce)
        measurements = [journal.measurements() for journal in journals]
        reference = _reference(plan, estimators, measurements)
        place = machine() if executor.local else f"{executor.workers} workers of a cluster"
        results = []
        for number, estimator in enumerate(estimators):
            source = fingerprints[number]["source"]
            if source_hash(estimator) != source:
                notify(f"{estimator.name}: its file changed during the run: some answers may be those of the new one")
            if estimator in plan.contestants:
                own = {trial: measurements[number][trial] for trial in wanted[number] if trial in measurements[number]}
                origin = (journals[number].run, place, source, seed)
                results.append(_result(plan, estimator, origin, own, reference))
                write_whole(folder / f"{file_name(estimator.name)}.json", results[-1].to_json(), durable=True)
        return results


def _check_place(path: Path, estimator: Estimator, plan: BenchPlan) -> None:
    """Refuse to overwrite the result of another estimator, or a more complete one.

    Raises:
        ScenarioError: There is one.
    """
    try:
        before = json.loads(path.read_text(encoding="utf-8"))["contestant"]
        identity = {name: before[name] for name in IDENTITY}
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return
    if identity != {name: getattr(estimator, name) for name in IDENTITY}:
        raise ScenarioError(
            f"{path} has the result of another estimator of the name {estimator.name!r}, {identity['target']!r}; "
            "expected another --name, or another --out"
        )
    try:
        lost = lost_by(Result.read(path), plan.figures, plan.effort, plan.records)
    except ScenarioError:  # of another version, or damaged: nothing is lost
        return
    if lost:
        raise ScenarioError(
            f"{path} has the result of a more complete run, with {lost}; it is not overwritten: give another --out, or "
            "move that file away"
        )


def _drawn_seed(path: Path, estimators: Sequence[Estimator]) -> int:
    """The seed of a run that is given none; an interrupted run finds the seed that it drew, and resumes.

    Args:
        path: File of the seeds that were drawn in this folder, by hash of the estimators.
        estimators: Another version of their files has another seed, drawn when that version is fixed.
    """
    hashes = [source_hash(estimator) for estimator in estimators]
    texts = [f"{estimator.target}|{estimator.home}|{text}" for estimator, text in zip(estimators, hashes, strict=True)]
    key = sha256("\n".join(texts).encode()).hexdigest()
    try:
        seeds = dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError):
        seeds = {}
    if type(seeds.get(key)) is not int:
        seeds[key] = draw_run_seed(hashes)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(seeds), durable=True)
    return int(seeds[key])


def _try_estimators(jobs: Sequence[RecordJob], setup: BenchSetup) -> None:
    """Start each estimator once before the long simulation: an error in the command line shows at once.

    Raises:
        ScenarioError: One cannot be started.
    """
    for number in sorted({number for job in jobs for _, number in job.requests}):
        if setup.estimators[number].target != PERFECT:
            with EstimatorProcess(setup.estimators[number], setup.limits):
                pass


def _simulate(jobs: Sequence[RecordJob], seed: int, folder: Path, notify: Callable[[str], None]) -> None:
    """Simulate the arm's records side by side before the estimators are asked."""
    trials = [Trial(job.problem, job.draw) for job in jobs if job.problem.startswith(TWIN)]
    begun = monotonic()
    simulated = 0
    for first in range(0, len(trials), TOGETHER):
        simulated += simulate_records(trials[first : first + TOGETHER], seed, folder)
        if simulated and (spent := monotonic() - begun) > SILENCE:
            ready = min(first + TOGETHER, len(trials))
            notify(f"{ready} of {len(trials)} records of the arm simulated in {time_text(spent)}")


def _run(
    setup: BenchSetup,
    jobs: Sequence[RecordJob],
    executor: Executor,
    progress: RunProgress,
    announce: Callable[[Cost], None],
) -> None:
    """Run the jobs: first a record of each kind of problem, from which the cost of the others is learnt."""
    costs, (first, others) = CostModel(), pilot_jobs(jobs)
    size = 1 if executor.local else REMOTE_BATCH
    if not jobs:
        return
    with executor:
        for result in executor.run(run_jobs, setup, progress.batches(interleaved(first), size), items="records"):
            progress.add(result)
            costs.learn(result)
        if rest := tuple(chain.from_iterable(progress.batches(others, 1))):
            announce(costs.cost(rest, executor.workers))
            progress.start(costs, rest, executor.workers)
            for result in executor.run(run_jobs, setup, progress.batches(interleaved(rest), size), items="records"):
                progress.add(result)


def _reference(
    plan: BenchPlan, estimators: Sequence[Estimator], measurements: Sequence[Mapping[Trial, Measurement]]
) -> Measurements:
    """Measurements of the second implementation on the trials of the metric of agreement."""
    metric = next((metric for metric in plan.figures if metric.name == AGREEMENT), None)
    if plan.referee is None or plan.referee not in estimators or metric is None:
        return ()
    own = measurements[estimators.index(plan.referee)]
    return tuple(own[trial] for trial in plan.trials_of(metric) if trial in own)


def _result(
    plan: BenchPlan,
    estimator: Estimator,
    origin: tuple[str, str, str, int],
    measurements: Mapping[Trial, Measurement],
    reference: Measurements,
) -> Result:
    run, place, source, seed = origin
    command = plan.commands.get(estimator.name, "")
    share = false_alarm_of_each()
    figures = {
        metric.name: metric.evaluate(
            [measurements[trial] for trial in plan.trials_of(metric) if trial in measurements],
            estimator,
            share,
            reference,
        )
        for metric in plan.figures
    }
    outcomes = Counter(m.kind for m in measurements.values())
    reasons = Counter(f"{m.kind}: {m.why}" for m in measurements.values() if m.kind not in (MODEL, REFUSED))
    refused = kinds_of_request(m.trial for m in measurements.values() if m.kind == REFUSED)
    return Result(
        contestant=estimator,
        limits=plan.limits,
        effort=effort_text(plan.effort, plan.records),
        seed=seed,
        command=f"{command} --seed {seed}" if command else "",
        source=source,
        versions=versions(),
        machine=place,
        outcomes=dict(sorted(outcomes.items())),
        reasons=dict(reasons.most_common(REASONS)),
        seconds=float(np.nansum([m.seconds for m in measurements.values()])),
        figures=figures,
        run=run,
        refused=dict(refused.most_common()),
    )


def kinds_of_request(trials: Iterable[Trial]) -> Counter[str]:
    """Number of trials of each family of problems, and of each request where that is no fit."""
    return Counter(f"{FAMILY.split(trial.problem)[0]}{f', {trial.ask}' * (trial.ask != 'fit')}" for trial in trials)
