"""Build a data set into a folder of its own; interrupted builds resume from the manifest."""

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

from hmtb_twin.hydraulics.orifice import require_compiler
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.simulation import MOST_THREADS
from scenarios.datasets import build_record
from scenarios.datasets.build_progress import RECORDS, Progress, Told
from scenarios.datasets.chunk import MOST_ROWS, Made, chunks
from scenarios.datasets.executor import Executor, Threads
from scenarios.datasets.finish import finish, finished
from scenarios.datasets.layout import MANIFEST, UNFINISHED
from scenarios.datasets.lock import locked
from scenarios.datasets.manifest import Manifest
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.atomic_write import make_folder, remove_partial, write_files
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import bytes_hash, file_hash
from scenarios.jobs.steady_memory import steady_memory

TOGETHER = 16
"""Experiments that are seen on the disk together: fewer waits for the disk."""

SOON = 2.0
"""After what time they are at the latest when another comes, s; and they are before the next chunk is begun."""


@dataclass(frozen=True)
class Built:
    """A data set on disk.

    Attributes:
        path: Its folder.
        experiments: How many experiments have a record.
        failed: Why others have none, and what else could not be made, by name.
        hash: Of all arrays together.
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
    executor: Executor | None = None,
    progress: Told | None = None,
) -> Built:
    """Build a data set, or go on with a build that was interrupted.

    Args:
        spec: The spec.
        out: The folder in which that of the data set is made.
        workers: Threads for the physics; all processors by default. The bits do not depend on it.
        rows: Experiments that run side by side at most: less memory and less to lose, or more speed. The bits do not
            depend on it.
        executor: Who runs the experiments instead of this process.
        progress: Told how far the build is.

    Raises:
        ScenarioError: The data set is already there; another build is at work on it; what is there was begun with
            another spec or by other software; no experiment has a record; or a file cannot be written: then what is
            written stays, and the next build goes on from there.
        TwinError: What the spec needs is not installed.
    """
    check_work(workers, rows)
    if spec.withheld:
        raise ScenarioError(f"{spec.label} is a public spec: its seed is withheld, so it cannot be built")
    steady_memory()
    final, folder = out / spec.label, out / (spec.label + UNFINISHED)
    plan = DataSetPlan(spec)
    check_installed(spec)
    told = progress or (lambda _: None)
    try:
        if final.exists() or final.is_symlink():
            if (summary := finished(final)) is None:
                raise ScenarioError(
                    f"{final} is already there: a version is never overwritten; give the spec another version, or "
                    "build in another folder"
                )
            return Built(final, summary.experiments, summary.failed, summary.hash)
        make_folder(folder)
        with locked(folder):
            remove_partial(folder)
            build_record.begin(folder, spec)
            with Manifest(folder / MANIFEST, len(plan)) as manifest:
                _check(folder, manifest, told)
                _try_again(manifest, len(plan))
                _run(plan, folder, manifest, executor or Threads(workers), rows, told)
                _check_records(manifest, folder)
                summary = finish(plan, folder, final, manifest, told)
    except OSError as error:
        raise ScenarioError(_said(error, folder)) from error
    return Built(final, summary.experiments, summary.failed, summary.hash)


def check_work(workers: int | None, rows: int) -> None:
    """Refuse what no build can be done with.

    Args:
        workers: Threads for the physics; None: all processors.
        rows: Experiments that run side by side at most.

    Raises:
        ScenarioError: One of them is out of range.
    """
    if rows < 1:
        raise ScenarioError(f"rows = {rows} given, expected 1 experiment side by side or more")
    if workers is not None and not 1 <= workers <= MOST_THREADS:
        raise ScenarioError(f"workers = {workers} given, expected 1 to {MOST_THREADS} threads")


def _check(folder: Path, manifest: Manifest, told: Told) -> None:
    """Look at every file that is noted; what is missing or damaged is made anew."""
    total = manifest.done
    for number, line in enumerate(manifest.noted(), start=1):
        if not _holds(folder, line):
            manifest.forget(line)
        told(Progress("check", number, total))
    for line in list(manifest.pieces()):
        if not _holds(folder, line):
            manifest.forget(line)


def _holds(folder: Path, line: Mapping[str, Any]) -> bool:
    return all(
        (folder / place).is_file() and file_hash(folder / place) == expected
        for place, expected in line["files"].items()
    )


def _try_again(manifest: Manifest, size: int) -> None:
    """Forget experiments that failed where all did: what kept them from running may be gone."""
    if manifest.done == size and all("failed" in line for line in manifest.noted()):
        for line in list(manifest.noted()):
            manifest.forget(line)


def _check_records(manifest: Manifest, folder: Path) -> None:
    """Refuse to publish a data set without any record."""
    reasons: Counter[str] = Counter()
    for line in manifest.noted():
        if "failed" not in line:
            return
        reasons[line["failed"].removeprefix(f"{line['about']['name']}: ")] += 1
    (why, count), more = reasons.most_common(1)[0], len(reasons) - 1
    raise ScenarioError(
        f"none of {manifest.done} experiments has a record, and nothing is published; {count} of them: {why}"
        f"{f'; {more} other reasons' if more else ''}. The same command tries them anew; what is there is in {folder}"
    )


def _run(plan: DataSetPlan, folder: Path, manifest: Manifest, executor: Executor, rows: int, told: Told) -> None:
    """Run what is left of the experiments; what is done when something fails is kept."""
    done, total, whole = manifest.done, len(plan), plan.seconds
    come = max(whole - sum(map(plan.duration, manifest.left)), 0.0)
    seconds = 0.0
    waiting: list[Made] = []
    kept = monotonic()

    def show(ticks: int = 0) -> None:
        nonlocal seconds
        # When the first of a chunk comes, the ticks of the others are not counted any more: they have been shown.
        seconds = min(max(seconds, come + ticks / SAMPLE_RATE), whole)
        told(Progress(RECORDS, done, total, seconds, whole))

    def keep() -> None:
        nonlocal done, kept
        if not waiting:
            return
        # Together: the names in a folder are seen on the disk once.
        write_files(folder, {place: content for made in waiting for place, content in made.files.items()})
        manifest.append([_line(made) for made in waiting])
        done += len(waiting)
        waiting.clear()
        kept = monotonic()
        show()

    def next_chunks() -> Iterator[Sequence[int]]:
        for chunk in chunks(plan, manifest.left, rows=rows):
            keep()
            yield chunk

    show()
    try:
        for made in executor(plan, next_chunks(), show):
            waiting.append(made)
            come += plan.duration(made.number)
            if len(waiting) >= TOGETHER or monotonic() - kept > SOON:
                keep()
    except BaseException as error:
        if not isinstance(error, OSError):
            keep()
        raise
    keep()
    if manifest.done < total:
        raise ScenarioError(f"{total - manifest.done} experiments were given to run, and nothing has come of them")


def _line(made: Made) -> dict[str, Any]:
    """The entry of the manifest about an experiment."""
    return {
        "number": made.number,
        "about": dict(made.about),
        "files": {place: bytes_hash(content) for place, content in made.files.items()},
        "arrays": {place: dict(hashes) for place, hashes in made.arrays.items()},
        **({"failed": made.failed} if made.failed else {}),
        **({"missing": dict(made.missing)} if made.missing else {}),
    }


def _said(error: OSError, folder: Path) -> str:
    """One line about what the system refused, and what becomes of what is there."""
    why = os.strerror(error.errno) if error.errno else str(error)
    if isinstance(error, FileExistsError):
        why = "a file of that name is there, expected a folder or nothing"
    if isinstance(error, IsADirectoryError):
        why = "a folder of that name is there, expected a file or nothing; remove it"
    line = f"cannot write or read {error.filename or folder}: {why}"
    if not os.path.exists(folder / MANIFEST):
        return line
    return f"{line}; what is done stays in {folder}: the same command goes on from there"


def check_installed(spec: DataSetSpec) -> None:
    """Refuse a spec for which an extra of this package is missing: without it every experiment would fail.

    Args:
        spec: The spec.

    Raises:
        TwinError: Servo valves are asked for, and what compiles their equations is not there.
    """
    if any("orifice" in block.actuators for block in spec.records):
        require_compiler()
