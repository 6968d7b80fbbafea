"""Progress of a run: finished trials in journals, the cost of the rest, and estimators that are given up."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

import numpy as np

from scenarios.bench.estimator_files import source_hash
from scenarios.bench.measurement import Measurement
from scenarios.bench.runner import RecordJob, TrialResult
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.task import PROTOCOL
from scenarios.jobs.bitwise_compatibility import bit_fingerprint
from scenarios.jobs.journal import Journal, read_fingerprint
from scenarios.problems.trial import Trial

ENDING = ".sqlite"
RUN = "run"
"""Entry of a journal with the mark of the run that began it."""

HANG = "hang"
GIVEN_UP = "given up"
"""Beginning of the reason of trials that an estimator was not asked any more."""

HANGS = 10
"""An estimator that has hung so often in a row is given up."""

OUTDATING = {"source": "its file", "software": "this software, or a package that it uses,"}
"""Entries of a fingerprint that no options bring back: a journal with another one is of no more use."""

IDENTITY = ("target", "home", "program")
"""Fields that identify an estimator whatever its options: journals of others of the same name are left alone."""

WAVEFORM = re.compile(r"-w\d+")
"""Part of a problem's name that makes no difference to its cost."""

SURE = 0.05
"""Share of the work after which the pace of the run predicts the rest better than the first trials do."""

Report = Callable[[int, int, float | None], None]
"""Called with the number of finished trials, of all trials, and the remaining time, s; None while it is unknown."""


def fingerprint_of(estimator: Estimator, limits: Limits, seed: int) -> dict[str, Any]:
    """Everything that the outcomes of an estimator depend on, as JSON holds it."""
    return {
        "estimator": asdict(estimator),
        "limits": asdict(limits),
        "seed": seed,
        "protocol": PROTOCOL,
        "source": source_hash(estimator),
        "software": sha256(repr(sorted(bit_fingerprint().items())).encode()).hexdigest(),
    }


def file_name(name: str) -> str:
    """An estimator's name as that of a file, without an ending; with a hash where the two differ."""
    plain = re.sub(r"[^A-Za-z0-9_.+-]+", "-", name).strip(".-")
    return plain if plain == name else f"{plain or 'estimator'}-{sha256(name.encode()).hexdigest()[:6]}"


class TrialJournal:
    """Finished trials of one estimator, on file as soon as they are measured.

    Args:
        folder: For journals.
        name: Of the estimator.
        fingerprint: See `fingerprint_of`.
        run: Mark of this run, for a new journal.
        notify: Called with a line where an earlier journal is of no more use.

    Attributes:
        path: The file.
        run: Mark of the run that began it.
        done: Keys of its trials.
        hangs: Number of trials that hung at its end, one after the other, without those that were not asked.

    Raises:
        ScenarioError: Another run has it open.
    """

    def __init__(
        self, folder: Path, name: str, fingerprint: Mapping[str, Any], *, run: str, notify: Callable[[str], None]
    ) -> None:
        values = {entry: json.dumps(value, sort_keys=True) for entry, value in fingerprint.items()}
        stem, mark = file_name(name), sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
        self.path = folder / f"{stem}-{mark}{ENDING}"
        for why in _remove_outdated(folder, stem, self.path, values):
            notify(f"{name}: {why}")
        self._journal = Journal(self.path, values)
        self.done = set[str]()
        self.hangs = 0
        for key, payload in self._journal.items():
            if key != RUN:
                self._count(key, payload["kind"], payload["why"])
        if (first := self._journal.get(RUN)) is None:
            self._journal.add(RUN, run)
        self.run: str = first or run

    def __enter__(self) -> "TrialJournal":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._journal.close()
        if not self.done:
            self.path.unlink(missing_ok=True)

    def add(self, measurement: Measurement) -> None:
        """Add a trial; a trial that it has stays as it is."""
        key = measurement.trial.key
        if key not in self.done:
            self._journal.add(key, measurement.to_table())
            self._count(key, measurement.kind, measurement.why)

    def measurements(self) -> dict[Trial, Measurement]:
        """All trials."""
        read = (Measurement.from_table(payload) for key, payload in self._journal.items() if key != RUN)
        return {measurement.trial: measurement for measurement in read}

    def _count(self, key: str, kind: str, why: str) -> None:
        self.done.add(key)
        self.hangs = self.hangs + 1 if kind == HANG and not why.startswith(GIVEN_UP) else 0


def _remove_outdated(folder: Path, stem: str, path: Path, values: Mapping[str, str]) -> Iterator[str]:
    """Remove journals of the same estimator that no options can bring back, and say why."""
    for other in sorted(folder.glob(f"{stem}-{'[0-9a-f]' * 12}{ENDING}")):
        theirs = read_fingerprint(other)  # None while another run has it open
        if other == path or not theirs or _identity(theirs) != _identity(values):
            continue
        if changed := [words for entry, words in OUTDATING.items() if theirs.get(entry) != values[entry]]:
            other.unlink(missing_ok=True)
            yield f"{' and '.join(changed)} changed since the last run: its trials start again"


def _identity(values: Mapping[str, str]) -> tuple[object, ...]:
    estimator = json.loads(values.get("estimator", "{}"))
    return tuple(estimator.get(name) for name in IDENTITY)


@dataclass(frozen=True)
class Cost:
    """Cost of the trials that are left.

    Attributes:
        requests: Requests to estimators.
        core_seconds: Time of one core, s.
        wall: Time with all workers, s.
    """

    requests: int
    core_seconds: float
    wall: float

    def __str__(self) -> str:
        return (
            f"{self.requests} requests, {time_text(self.core_seconds)} of one core, about {time_text(self.wall)} with "
            "all workers"
        )


class CostModel:
    """Predicts the time of trials from those that are done."""

    def __init__(self) -> None:
        self._walls: dict[tuple[str, str, int], list[float]] = defaultdict(list)

    def learn(self, result: TrialResult) -> None:
        """Take a finished trial into account."""
        trial = result.measurement.trial
        self._walls[problem_kind(trial.problem), trial.ask, result.estimator].append(result.wall)

    def of_trial(self, problem: str, ask: str, estimator: int) -> float:
        """Expected time of a trial, s; 0 where nothing is known."""
        walls = self._walls.get((problem_kind(problem), ask, estimator))
        return float(np.mean(walls)) if walls else 0.0

    def of_jobs(self, jobs: Iterable[RecordJob]) -> float:
        """Expected time of jobs, s."""
        return sum(self.of_trial(job.problem, ask, estimator) for job in jobs for ask, estimator in job.requests)

    def cost(self, jobs: Sequence[RecordJob], workers: int) -> Cost:
        """Expected cost of jobs, of which so many run at a time."""
        seconds = self.of_jobs(jobs)
        return Cost(sum(len(job.requests) for job in jobs), seconds, seconds / workers)


def pilot_jobs(jobs: Iterable[RecordJob]) -> tuple[tuple[RecordJob, ...], tuple[RecordJob, ...]]:
    """Divide jobs into the first of each kind of problem, from which the cost is learnt, and the others."""
    first: dict[str, RecordJob] = {}
    others = [job for job in jobs if first.setdefault(problem_kind(job.problem), job) is not job]
    return tuple(first.values()), tuple(others)


def problem_kind(problem: str) -> str:
    """A problem's name without the number of its waveform."""
    return WAVEFORM.sub("", problem)


def time_text(seconds: float) -> str:
    """A time with its unit."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


class RunProgress:
    """Counts trials as they are finished, and writes them to the journals.

    An estimator of which `HANGS` trials in a row, over all workers, reached the time limit is asked no more: its
    remaining trials count as hung, with a reason that says so. They stand in its journal, so that a run that resumes
    does not ask them either; hangs at the end of a journal count.

    Args:
        names: Of the estimators.
        wanted: Trials of each estimator.
        journals: Of each.
        report: Called with the progress.
        notify: Called with a line where an estimator is given up.
    """

    def __init__(
        self,
        names: Sequence[str],
        wanted: Sequence[Sequence[Trial]],
        journals: Sequence[TrialJournal],
        report: Report,
        notify: Callable[[str], None],
    ) -> None:
        self._names, self._wanted, self._journals = names, wanted, journals
        self._report, self._notify = report, notify
        self._total = sum(map(len, wanted))
        pairs = zip(wanted, journals, strict=True)
        self._done = sum(trial.key in journal.done for trials, journal in pairs for trial in trials)
        self._given_up: set[int] = set()
        self._costs: CostModel | None = None
        self._workers, self._begun, self._spent, self._work = 1, 0.0, 0.0, 0.0
        self._update()

    def start(self, costs: CostModel, jobs: Iterable[RecordJob], workers: int) -> None:
        """Begin to predict the remaining time."""
        self._costs, self._workers, self._begun = costs, workers, monotonic()
        self._work = costs.of_jobs(jobs)

    def batches(self, jobs: Iterable[RecordJob], size: int) -> Iterator[tuple[RecordJob, ...]]:
        """Jobs in batches, without estimators that have been given up when a batch is taken."""
        batch: list[RecordJob] = []
        for job in jobs:
            requests = tuple(one for one in job.requests if one[1] not in self._given_up)
            if requests:
                batch.append(replace(job, requests=requests))
            if len(batch) == size:
                yield tuple(batch)
                batch = []
        if batch:
            yield tuple(batch)

    def add(self, result: TrialResult) -> None:
        """Count a trial; one whose worker died may come twice."""
        number, journal = result.estimator, self._journals[result.estimator]
        if not self._add(number, result.measurement):
            return
        if journal.hangs >= HANGS:
            self._given_up.add(number)
            left = [trial for trial in self._wanted[number] if trial.key not in journal.done]
            if left:
                why = f"{GIVEN_UP} after {HANGS} hangs in a row: not asked any more"
                self._notify(f"{self._names[number]}: {why}; its other {len(left)} trials count as hangs")
            for trial in left:
                self._add(number, Measurement(trial, HANG, why))
        self._update()

    def _add(self, number: int, measurement: Measurement) -> bool:
        """Whether it was new."""
        journal, trial = self._journals[number], measurement.trial
        if trial.key in journal.done:
            return False
        journal.add(measurement)
        self._done += 1
        if self._costs is not None:
            self._spent += self._costs.of_trial(trial.problem, trial.ask, number)
        return True

    def _update(self) -> None:
        left = None
        if self._costs is not None:
            rest = max(0.0, self._work - self._spent)
            sure = self._spent > SURE * self._work
            left = rest * (monotonic() - self._begun) / self._spent if sure else rest / self._workers
        self._report(self._done, self._total, left)
