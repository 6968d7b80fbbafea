"""Build a data set into a folder of its own; interrupted builds resume from the journal."""

import json
import os
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from time import monotonic
from typing import Any

from hmtb_twin.hydraulics.orifice import require_compiler
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.simulation import MOST_THREADS
from scenarios.datasets.chunk import MOST_ROWS, BuiltExperiment, chunks, run_chunk, run_chunk_elsewhere
from scenarios.datasets.finish import EXPERIMENT, experiment_entries, experiment_key, finish
from scenarios.datasets.index import summary
from scenarios.datasets.plan import BUILD, JOURNAL, SPEC, UNFINISHED, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.atomic_write import make_folder, remove_partial, write_files
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import bytes_hash, file_hash
from scenarios.files.provenance import fingerprint, versions
from scenarios.jobs.executor import Executor
from scenarios.jobs.journal import Journal
from scenarios.jobs.progress import Progress, Report
from scenarios.jobs.steady_memory import steady_memory

BATCH = 16
"""Experiments that are written together: their folders are flushed to the disk once."""

LATEST = 2.0
"""Longest time that experiments wait for others to be written with, s."""

SHOWN = 3
"""Files that an error names."""


@dataclass(frozen=True)
class BuiltDataSet:
    """A data set on disk.

    Attributes:
        path: Its folder.
        experiments: Number of experiments that have a record.
        failed: Why others have none, and what else could not be made, by name.
        hash: Hash of all arrays.
    """

    path: Path
    experiments: int
    failed: Mapping[str, str]
    hash: str


def build(
    spec: DataSetSpec,
    out: Path,
    *,
    workers: int | None = None,
    rows: int = MOST_ROWS,
    executor: Executor[Any] | None = None,
    progress: Report | None = None,
) -> BuiltDataSet:
    """Build a data set; an interrupted build resumes.

    Args:
        spec: The spec.
        out: Folder in which that of the data set is made.
        workers: Threads for the physics; all processors by default. The bits do not depend on it.
        rows: Experiments that run side by side at most: less memory and less to lose, or more speed. The bits do not
            depend on it.
        executor: Runs the experiments instead of this process.
        progress: Called with the progress.

    Raises:
        ScenarioError: The data set is already there; another build is at work on it; it was begun with another spec or
            by other software; no experiment has a record; or a file cannot be written: then the next build resumes.
        TwinError: What the spec needs is not installed.
    """
    if rows < 1:
        raise ScenarioError(f"rows = {rows} given, expected 1 experiment side by side or more")
    if workers is not None and not 1 <= workers <= MOST_THREADS:
        raise ScenarioError(f"workers = {workers} given, expected 1 to {MOST_THREADS} threads")
    if spec.withheld:
        raise ScenarioError(f"{spec.label} is a public spec: its seed is withheld, so it cannot be built")
    steady_memory()
    final, folder = out / spec.label, out / (spec.label + UNFINISHED)
    plan, report = DataSetPlan(spec), progress or (lambda _: None)
    if any("orifice" in block.actuators for block in spec.records):
        require_compiler()  # without it every such experiment would fail
    try:
        if final.exists() or final.is_symlink():
            if not (final / JOURNAL).is_file():
                raise ScenarioError(
                    f"{final} is already there: a version is never overwritten; give the spec another version, or "
                    "build in another folder"
                )
            # The build was killed between its last two steps, renaming the folder and removing the journal.
            (final / JOURNAL).unlink()
        else:
            make_folder(folder)
            _check_folder(folder)
            with Journal(folder / JOURNAL, _fingerprint(spec)) as journal:
                remove_partial(folder)
                record = {"data_set": spec.label, "source": fingerprint(), "versions": versions()}
                build_text = json.dumps(record, indent=1, sort_keys=True) + "\n"
                write_files(folder, {SPEC: spec.to_toml().encode(), BUILD: build_text.encode()})
                _check_entries(folder, plan, journal, report)
                _run(plan, folder, journal, executor, workers, rows, report)
                _check_records(plan, journal, folder)
                finish(plan, folder, journal, report)
            folder.rename(final)
            (final / JOURNAL).unlink()
            report(Progress("finish", 1, 1))
    except OSError as error:
        raise ScenarioError(_system_error(error, folder)) from error
    index = summary(final)
    return BuiltDataSet(final, index.experiments, index.failed, index.hash)


def _fingerprint(spec: DataSetSpec) -> dict[str, str]:
    """Everything that the bits of a data set depend on, by name."""
    table = tomllib.loads(spec.to_toml())
    return {
        **{key: json.dumps(value, sort_keys=True) for key, value in table.items()},
        **versions(),
        "source": fingerprint(),
    }


def _check_folder(folder: Path) -> None:
    """Refuse a folder that holds something else than a build."""
    foreign = sorted(path.name for path in folder.iterdir())
    if foreign and not {JOURNAL, SPEC} & set(foreign):
        raise ScenarioError(
            f"{folder} holds no build but {', '.join(foreign[:SHOWN])}: expected an empty folder or none"
        )


def _check_entries(folder: Path, plan: DataSetPlan, journal: Journal, report: Report) -> None:
    """Remove entries of the journal whose files are missing or damaged: they are made again."""
    total, done, failed = len(journal), count(1), 0
    for key, entry in list(journal.items()):
        report(Progress("check", next(done), total))
        failed += "failed" in entry and "number" in entry
        if not all((folder / path).is_file() and file_hash(folder / path) == h for path, h in entry["files"].items()):
            journal.remove(key)
    if failed == len(plan):
        # Whatever kept all of them from running may be gone.
        for key, _ in list(journal.items()):
            journal.remove(key)


def _check_records(plan: DataSetPlan, journal: Journal, folder: Path) -> None:
    """Refuse to publish a data set without any record."""
    reasons: Counter[str] = Counter()
    for entry in experiment_entries(journal):
        if "failed" not in entry:
            return
        reasons[entry["failed"].removeprefix(f"{entry['about']['name']}: ")] += 1
    (why, times), more = reasons.most_common(1)[0], len(reasons) - 1
    raise ScenarioError(
        f"none of {len(plan)} experiments has a record, and nothing is published; {times} of them: {why}"
        f"{f'; {more} other reasons' if more else ''}. The same command tries them again in {folder}"
    )


def _run(
    plan: DataSetPlan,
    folder: Path,
    journal: Journal,
    executor: Executor[Any] | None,
    workers: int | None,
    rows: int,
    report: Report,
) -> None:
    """Simulate the rest of the experiments; those that are done when something fails are kept."""
    keys = journal.keys(EXPERIMENT)
    left = [number for number in range(len(plan)) if experiment_key(number) not in keys]
    done, total, whole = len(plan) - len(left), len(plan), plan.seconds
    simulated = max(whole - sum(map(plan.duration, left)), 0.0)
    shown = 0.0
    waiting: list[BuiltExperiment] = []
    written = monotonic()

    def show(ticks: int = 0) -> None:
        nonlocal shown
        # When the first experiment of a chunk arrives, the ticks of the others have been shown already.
        shown = min(max(shown, simulated + ticks / SAMPLE_RATE), whole)
        report(Progress("records", done, total, "experiments", shown, whole))

    def write() -> None:
        nonlocal done, written
        if not waiting:
            return
        write_files(folder, {path: content for one in waiting for path, content in one.files.items()})
        journal.add_all({experiment_key(one.number): _entry(one) for one in waiting})
        done += len(waiting)
        waiting.clear()
        written = monotonic()
        show()

    def batches() -> Iterator[tuple[int, ...]]:
        for chunk in chunks(plan, left, rows=rows):
            write()  # before the next long piece of work begins
            yield chunk

    def results() -> Iterator[BuiltExperiment]:
        if executor is None:
            for chunk in batches():
                yield from run_chunk(plan, chunk, threads=workers, progress=lambda ticks, _: show(ticks))
            return
        with executor:
            text = plan.spec.to_toml()
            names = lambda number: plan[number].name  # noqa: E731
            yield from executor.run(run_chunk_elsewhere, text, batches(), name=names, items="experiments")

    show()
    try:
        for experiment in results():
            waiting.append(experiment)
            simulated += plan.duration(experiment.number)
            if len(waiting) >= BATCH or monotonic() - written > LATEST:
                write()
    except BaseException as error:
        if not isinstance(error, OSError):
            write()
        raise
    write()
    if done < total:
        raise ScenarioError(f"the executor returned {done} of {total} experiments; expected all")


def _entry(experiment: BuiltExperiment) -> dict[str, Any]:
    """Journal entry of an experiment."""
    return {
        "number": experiment.number,
        "about": dict(experiment.about),
        "files": {path: bytes_hash(content) for path, content in experiment.files.items()},
        "arrays": {path: dict(hashes) for path, hashes in experiment.arrays.items()},
        **({"failed": experiment.failed} if experiment.failed else {}),
        **({"missing": dict(experiment.missing)} if experiment.missing else {}),
    }


def _system_error(error: OSError, folder: Path) -> str:
    """One line about what the system refused, and whether the build can resume."""
    why = os.strerror(error.errno) if error.errno else str(error)
    if isinstance(error, FileExistsError | NotADirectoryError):
        why = "a file of that name is there, expected a folder or nothing"
    line = f"cannot write or read {error.filename or folder}: {why}"
    if not os.path.exists(folder / JOURNAL):
        return line
    return f"{line}; progress is saved in {folder}: run the command again to resume"
