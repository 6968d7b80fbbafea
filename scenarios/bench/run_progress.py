"""Progress of a test-bench run: journals of finished trials, cost of the rest, estimators that are no longer asked."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.bench.estimator_files import source_hash
from scenarios.bench.job_runner import RecordJob, TrialResult
from scenarios.bench.measurement import Measurement
from scenarios.estimators.estimator import Estimator, Limits
from scenarios.estimators.task import PROTOCOL
from scenarios.jobs.bitwise_compatibility import bit_fingerprint
from scenarios.jobs.journal import Journal, read_fingerprint
from scenarios.jobs.progress import Progress, Report, duration_text
from scenarios.problems.trial import Trial

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
        run: Mark of the run that began it.
        source: Hash of the estimator's files, as in the fingerprint.
        done: Keys of its trials.
        hangs: Number of trials that hung at its end, one after the other, without those that were not asked.

    Raises:
        ScenarioError: Another run has it open.
    """

    def __init__(
        self, folder: Path, name: str, fingerprint: Mapping[str, Any], *, run: str, notify: Callable[[str], None]
    ) -> None:
        values = {key: json.dumps(value, sort_keys=True) for key, value in fingerprint.items()}
        # The name of the file tells the fingerprint, so that runs with other options keep their journals.
        mark = sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:12]
        stem = file_name(name)
        self.name, self.path, self.source = name, folder / f"{stem}-{mark}.sqlite", fingerprint["source"]
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

    def close(self) -> None:
        """Release the lock of the journal, and delete a journal without trials."""
        self._journal.close()
        if not self.done:
            self.path.unlink(missing_ok=True)

    def add(self, measurement: Measurement) -> None:
        """Add a trial."""
        self._journal.add(measurement.trial.key, measurement.to_table())
        self._count(measurement.trial.key, measurement.kind, measurement.why)

    def measurements(self) -> dict[Trial, Measurement]:
        """All trials."""
        # The mark of the run is an entry too.
        read = (Measurement.from_table(payload) for key, payload in self._journal.items() if key != RUN)
        return {measurement.trial: measurement for measurement in read}

    def _count(self, key: str, kind: str, why: str) -> None:
        self.done.add(key)
        # A run that resumes must not take trials that were never asked for hangs in a row.
        self.hangs = self.hangs + 1 if kind == HANG and not why.startswith(GIVEN_UP) else 0


def _remove_outdated(folder: Path, stem: str, path: Path, values: Mapping[str, str]) -> Iterator[str]:
    """Remove journals of the same estimator that no options can bring back, and say why."""
    estimator = json.loads(values["estimator"])
    for journal in sorted(folder.glob(f"{stem}-{'[0-9a-f]' * 12}.sqlite")):
        before = read_fingerprint(journal)  # None while another run has it open
        if journal == path or not before:
            continue
        estimator_before = json.loads(before["estimator"])
        if any(estimator_before[field] != estimator[field] for field in IDENTITY):
            continue
        changed = [words for key, words in OUTDATING.items() if before.get(key) != values[key]]
        if changed:
            journal.unlink(missing_ok=True)
            yield f"{' and '.join(changed)} changed since the last run: its trials start again"


def remaining_cost(finished: Iterable[TrialResult], jobs: Iterable[RecordJob], workers: int) -> str:
    """Number and expected time of the requests that are left, in words.

    Args:
        finished: Trials from whose mean time, by kind of problem, request and estimator, that of others is expected.
        jobs: Jobs that are left; kinds of which no trial is finished count as 0.
        workers: How many run at a time.
    """
    walls: dict[tuple[str, str, int], list[float]] = defaultdict(list)
    for result in finished:
        trial = result.measurement.trial
        walls[problem_kind(trial.problem), trial.ask, result.estimator].append(result.wall)
    seconds, count = 0.0, 0
    for job in jobs:
        for ask, estimator in job.requests:
            count += 1
            finished_walls = walls.get((problem_kind(job.problem), ask, estimator))
            if finished_walls:
                seconds += float(np.mean(finished_walls))
    core, wall = duration_text(seconds), duration_text(seconds / workers)
    return f"{count} requests, {core} of one core, about {wall} with all workers"


def pilot_jobs(jobs: Iterable[RecordJob]) -> tuple[tuple[RecordJob, ...], tuple[RecordJob, ...]]:
    """Divide jobs into the first of each kind of problem, from which the cost is learnt, and the others."""
    first: dict[str, RecordJob] = {}
    later = [job for job in jobs if first.setdefault(problem_kind(job.problem), job) is not job]
    return tuple(first.values()), tuple(later)


def problem_kind(problem: str) -> str:
    """A problem's name without the number of its waveform, which makes no difference to its cost."""
    return re.sub(r"-w\d+", "", problem)


class RunProgress:
    """Counts trials as they are finished, and writes them to the journals.

    An estimator of which `HANGS` trials in a row, over all workers, reached the time limit is asked no more: its
    remaining trials count as hung, with a reason that says so. They stand in its journal, so that a run that resumes
    does not ask them either; hangs at the end of a journal count.

    Args:
        wanted: Trials of each estimator.
        journals: Of each.
        report: Called with the progress.
        notify: Called with a line where an estimator is given up.

    Attributes:
        note: Shown in place of the pace.
    """

    def __init__(
        self,
        wanted: Sequence[Sequence[Trial]],
        journals: Sequence[TrialJournal],
        report: Report,
        notify: Callable[[str], None],
    ) -> None:
        self._journals, self._report, self._notify = journals, report, notify
        self._given_up: set[int] = set()
        self._left: list[dict[str, Trial]] = []
        for trials, journal in zip(wanted, journals, strict=True):
            self._left.append({trial.key: trial for trial in trials if trial.key not in journal.done})
        self._total = sum(map(len, wanted))
        # The first trials start processes: their pace says nothing of that of the others.
        self.note = "the first of each kind"
        self._update()

    def batches(self, jobs: Iterable[RecordJob], size: int) -> Iterator[tuple[RecordJob, ...]]:
        """Jobs in batches, without estimators that have been given up when a batch is taken."""
        rest = iter(jobs)
        while batch := tuple(islice(rest, size)):
            remaining = []
            for job in batch:
                requests = tuple(request for request in job.requests if request[1] not in self._given_up)
                if requests:
                    remaining.append(replace(job, requests=requests))
            if remaining:
                yield tuple(remaining)

    def add(self, result: TrialResult) -> None:
        """Count a trial; one whose worker died may come twice."""
        journal, left = self._journals[result.estimator], self._left[result.estimator]
        # A worker may die behind the result that it has sent.
        if left.pop(result.measurement.trial.key, None) is None:
            return
        journal.add(result.measurement)
        # Each hang costs the whole time limit: hours for an estimator that hangs always.
        if journal.hangs >= HANGS:
            self._given_up.add(result.estimator)
            why = f"{GIVEN_UP} after {HANGS} hangs in a row: not asked any more"
            if left:
                self._notify(f"{journal.name}: {why}; its other {len(left)} trials count as hangs")
            for trial in left.values():
                journal.add(Measurement(trial, HANG, why))
            left.clear()
        self._update()

    def _update(self) -> None:
        left = sum(map(len, self._left))
        note = self.note if left else ""
        self._report(Progress(self.note, self._total - left, self._total, items="requests", note=note))
