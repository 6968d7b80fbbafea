"""Estimators on the test bench: their trials are run, measured, and made into figures with verdicts."""

import json
import secrets
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from time import monotonic

import numpy as np

from scenarios.bench.cost import Cost, Pilot, pilot_of, told_time
from scenarios.bench.executor import Executor
from scenarios.bench.journal import IDENTITY, Journal, file_name
from scenarios.bench.key import key_of, machine
from scenarios.bench.measurement import Measurement
from scenarios.bench.metric import DRAWS, Metric, MetricDefinition
from scenarios.bench.metrics import ALL_METRICS, false_alarm_of_each
from scenarios.bench.overwrite_guard import lost, told_effort, trials_within
from scenarios.bench.prepared_records import is_twin, simulate_records
from scenarios.bench.result import Result
from scenarios.bench.run_progress import Counted, Progress
from scenarios.bench.run_trials import PERFECT
from scenarios.bench.source import source_hash
from scenarios.bench.work import FAMILY, Bench, Piece, pieces, spread
from scenarios.estimators.contestant import Contestant, Limits
from scenarios.estimators.outcome import MODEL, REFUSED
from scenarios.estimators.sandbox import open_sandbox
from scenarios.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import versions
from scenarios.problems.registry import problem
from scenarios.problems.trial import Trial

JOURNALS = "journals"
"""Folder of the journals, in that of the results."""

RECORDS = "records"
"""Folder of records that the twin made, beside it."""

AGREEMENT = "agreement"
"""Metric that needs the second implementation."""

LONGEST_NAME = 100
"""Characters of an estimator's name, which files are named by."""

REASONS = 20
"""Reasons of failures that a result keeps."""

TOGETHER = 100
"""Records of the twin that are simulated side by side, and then kept."""

FIT = "fit"
"""What most requests ask."""

SILENCE = 10.0
"""After which it is told how far the simulation is, s."""


@dataclass(frozen=True)
class Plan:
    """What a run does.

    Attributes:
        contestants: Whose results are wanted.
        effort: One of `DRAWS`.
        seed: Of the run.
        limits: What an estimator may use for an answer.
        figures: Those that are made, all by default.
        referee: The second implementation, for the figure of agreement; None: there is none here.
        commands: Command line that makes a result again, by the contestant's name.
        records: How many records of each problem there are at most, for estimators that take long; None: all.
    """

    contestants: tuple[Contestant, ...]
    effort: str = "full"
    seed: int = 0
    limits: Limits = field(default_factory=Limits)
    figures: tuple[MetricDefinition, ...] = ALL_METRICS
    referee: Contestant | None = None
    commands: Mapping[str, str] = field(default_factory=dict)
    records: int | None = None

    def __post_init__(self) -> None:
        if self.effort not in DRAWS:
            raise ScenarioError(f"effort {self.effort!r} given, expected one of {', '.join(DRAWS)}")
        if not 0 <= self.seed < 2**63:
            raise ScenarioError(f"seed {self.seed} given, expected a whole number from 0 to 2^63 - 1")
        if self.records is not None and self.records < 1:
            raise ScenarioError(f"{self.records} records given, expected 1 or more")
        if not self.contestants:
            raise ScenarioError("no estimator given, expected one or several")
        twice = [name for name, count in Counter(file_name(c.name) for c in self.contestants).items() if count > 1]
        if twice:
            raise ScenarioError(f"estimators of the same name given: {', '.join(twice)}; expected a name each")
        for name in (one.name for one in self.contestants):
            if len(name) > LONGEST_NAME or not name.isprintable():
                raise ScenarioError(
                    f"an estimator called {name[:LONGEST_NAME]!r} given, expected at most {LONGEST_NAME} characters "
                    "that can be printed; --name gives it another"
                )

    def all_contestants(self) -> tuple[Contestant, ...]:
        """Those whose results are wanted, and the referee where a figure needs it and it is none of them."""
        asked = any(maker.name == AGREEMENT for maker in self.figures)
        if not asked or self.referee is None or self.referee in self.contestants:
            return self.contestants
        return (*self.contestants, self.referee)

    def trials_of(self, maker: MetricDefinition) -> tuple[Trial, ...]:
        """Trials of a figure.

        Args:
            maker: One of `figures`.
        """
        return trials_within(maker, self.effort, self.records)

    @property
    def told_effort(self) -> str:
        """The effort in words."""
        return told_effort(self.effort, self.records)

    def trials(self, contestant: Contestant) -> tuple[Trial, ...]:
        """Trials that it can be asked, each once, sorted.

        Args:
            contestant: One of `all_contestants`.
        """
        own = contestant in self.contestants
        makers = [maker for maker in self.figures if own or maker.name == AGREEMENT]
        wanted = sorted(set(chain.from_iterable(self.trials_of(maker) for maker in makers)))
        askable: dict[tuple[str, str], bool] = {}
        for trial in wanted:
            if (trial.problem, trial.ask) not in askable:
                task = problem(trial.problem).task(contestant.structure, trial.ask)
                askable[trial.problem, trial.ask] = task is not None
        return tuple(trial for trial in wanted if askable[trial.problem, trial.ask])


def verify(
    plan: Plan,
    folder: Path,
    executor: Executor,
    *,
    progress: Progress = lambda done, total, left: None,
    said: Callable[[str], None] = lambda line: None,
    told: Callable[[Cost], None] = lambda cost: None,
) -> list[Result]:
    """Run what is missing, and make results of all; each is written to a file of the contestant's name.

    Args:
        plan: What is done.
        folder: For results and journals; made where it is missing.
        executor: Who does it.
        progress: Told how far it is.
        said: Told in words what is to be known on the way.
        told: Told what the run will cost, once the first trials of each problem are done.

    Returns:
        A result of each contestant.

    Raises:
        ScenarioError: Something given cannot be used, or workers die; what is done is kept.
        OSError: A file cannot be written.
    """
    everyone = plan.all_contestants()
    for one in plan.contestants:
        _check_place(folder / f"{file_name(one.name)}.json", one, plan)
    records = (folder / RECORDS).resolve() if executor.here else None
    bench = Bench(everyone, plan.limits, plan.seed, records)
    wanted = [plan.trials(contestant) for contestant in everyone]
    with ExitStack() as stack:
        run = secrets.token_hex(6)
        keys = [key_of(one, plan.limits, plan.seed) for one in everyone]
        journals = [
            stack.enter_context(Journal(folder / JOURNALS, one.name, key, run=run, said=said))
            for one, key in zip(everyone, keys, strict=True)
        ]
        left = pieces(wanted, [journal.done for journal in journals])
        of_all = sum(map(len, wanted))
        if kept := of_all - sum(len(piece.asked) for piece in left):
            said(f"{kept} of {of_all} trials are kept from before; remove {folder / JOURNALS} to begin anew")
        if records is not None:
            _try(left, bench)
            _simulate(left, plan.seed, records, said)
        _run(bench, left, executor, Counted(wanted, journals, progress, said), told)
        referee = _of_referee(plan, everyone, journals)
        where = machine() if executor.here else f"{executor.workers} workers of a cluster"
        results = []
        for contestant, journal, trials, key in zip(everyone, journals, wanted, keys, strict=True):
            if source_hash(contestant) != key["source"]:
                said(f"{contestant.name}: its file changed during the run: some answers may be those of the new one")
            if contestant in plan.contestants:
                measured = journal.measured()
                own = {trial: measured[trial] for trial in trials if trial in measured}
                results.append(_result(plan, contestant, (journal.run, where, key["source"]), own, referee))
                write_whole(folder / f"{file_name(contestant.name)}.json", results[-1].to_json(), durable=True)
        return results


def _check_place(path: Path, contestant: Contestant, plan: Plan) -> None:
    """Leave alone what stands in the place of a result, where that is of another estimator, or has more.

    Raises:
        ScenarioError: It is, or has.
    """
    try:
        there = json.loads(path.read_text(encoding="utf-8"))["contestant"]
        theirs = {name: there[name] for name in IDENTITY}
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return
    if theirs != {name: getattr(contestant, name) for name in IDENTITY}:
        raise ScenarioError(
            f"{path} has the result of another estimator of the name {contestant.name!r}, {theirs['target']!r}; "
            "expected another --name, or another --out"
        )
    try:
        more = lost(Result.read(path), plan.figures, plan.effort, plan.records)
    except ScenarioError:  # of another version, or damaged: of no use to anyone
        return
    if more:
        raise ScenarioError(
            f"{path} has the result of a fuller run, with {more}; it is not replaced by less: give another --out, or "
            "move that file away"
        )


def _try(left: Sequence[Piece], bench: Bench) -> None:
    """Start each estimator once before the arm is simulated, which takes time: that it cannot be is told at once.

    Raises:
        ScenarioError: It cannot.
    """
    if any(is_twin(piece.problem) for piece in left):
        for number in sorted({number for piece in left for _, number in piece.asked}):
            if bench.contestants[number].target != PERFECT:
                with open_sandbox(bench.contestants[number], bench.limits):
                    pass


def _simulate(left: Sequence[Piece], seed: int, folder: Path, said: Callable[[str], None]) -> None:
    """Simulate records of the twin, side by side, before anyone is asked."""
    trials = [Trial(piece.problem, piece.draw) for piece in left if is_twin(piece.problem)]
    begun = monotonic()
    made = 0
    for first in range(0, len(trials), TOGETHER):
        made += simulate_records(trials[first : first + TOGETHER], seed, folder)
        # As much as a run of the quick bench has is soon there.
        if made and (spent := monotonic() - begun) > SILENCE:
            looked = min(first + TOGETHER, len(trials))
            said(f"{looked} of {len(trials)} records of the arm simulated in {told_time(spent)}")


def _run(
    bench: Bench,
    left: Sequence[Piece],
    executor: Executor,
    counted: Counted,
    told: Callable[[Cost], None],
) -> None:
    """Do what is left: first a record of each kind of problem, from which the cost of the others is told."""
    if not left:
        return
    names = [contestant.name for contestant in bench.contestants]
    pilot, (first, others) = Pilot(), pilot_of(left)
    with executor.crew(bench) as crew:
        for done in crew(counted.still(spread(first))):
            counted.note(done, names)
            pilot.learn(done)
        if rest := tuple(counted.still(others)):
            told(pilot.cost(rest, executor.workers))
            counted.begin(pilot, rest, executor.workers)
            for done in crew(counted.still(spread(rest))):
                counted.note(done, names)


def _of_referee(plan: Plan, everyone: Sequence[Contestant], journals: Sequence[Journal]) -> tuple[Measurement, ...]:
    makers = [maker for maker in plan.figures if maker.name == AGREEMENT]
    if plan.referee is None or plan.referee not in everyone or not makers:
        return ()
    measured = journals[everyone.index(plan.referee)].measured()
    return tuple(measured[trial] for trial in plan.trials_of(makers[0]) if trial in measured)


def _result(
    plan: Plan,
    contestant: Contestant,
    ran: tuple[str, str, str],
    measured: Mapping[Trial, Measurement],
    referee: Sequence[Measurement],
) -> Result:
    each = false_alarm_of_each()
    figures: dict[str, Metric] = {}
    for maker in plan.figures:
        own = [measured[trial] for trial in plan.trials_of(maker) if trial in measured]
        figures[maker.name] = maker.evaluate(own, contestant, each, referee)
    outcomes = Counter(one.kind for one in measured.values())
    reasons = Counter(f"{one.kind}: {one.why}" for one in measured.values() if one.kind not in (MODEL, REFUSED))
    return Result(
        contestant=contestant,
        limits=plan.limits,
        effort=plan.told_effort,
        seed=plan.seed,
        command=plan.commands.get(contestant.name, ""),
        source=ran[2],
        versions=versions(),
        machine=ran[1],
        outcomes=dict(sorted(outcomes.items())),
        reasons=dict(reasons.most_common(REASONS)),
        seconds=float(np.nansum([one.seconds for one in measured.values()])),
        figures=figures,
        run=ran[0],
        refused=dict(_kinds(one.trial for one in measured.values() if one.kind == REFUSED).most_common()),
    )


def _kinds(trials: Iterable[Trial]) -> Counter[str]:
    """How many trials of each family of problems, and of what is asked where that is no fit."""
    return Counter(f"{FAMILY.split(trial.problem)[0]}{f', {trial.ask}' * (trial.ask != FIT)}" for trial in trials)
