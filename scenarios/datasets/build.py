"""Build a data set into a folder of its own; interrupted builds resume from the journal."""

import json
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

from hmtb_twin import TwinError
from hmtb_twin.files.atomic_write import make_folder, remove_partial, sync, write_files
from hmtb_twin.files.hashes import bytes_hash, file_hash
from hmtb_twin.files.netcdf import Contents
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.simulation import MOST_THREADS
from scenarios.datasets.attainable_scores import attainable_files, attainable_pieces
from scenarios.datasets.baselines import baseline_files, baseline_pieces
from scenarios.datasets.best_linear_truth import best_linear_files, best_linear_pieces
from scenarios.datasets.chunk import MOST_ROWS, BuiltExperiment, chunks, run_chunk, run_chunk_elsewhere, steady_memory
from scenarios.datasets.data_set import DataSet, open_data_set
from scenarios.datasets.folder_check import list_files
from scenarios.datasets.index import paths_of_files, read_index, write_checksums, write_index
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import BUILD, INDEX, JOURNAL, SPEC, SUMS, UNFINISHED, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.files.toml_file import read_toml
from scenarios.jobs.executor import Executor
from scenarios.jobs.journal import Journal
from scenarios.jobs.progress import Progress, Report
from sysid import SysidError

SHOWN = 3
"""Files that an error names."""

EXPERIMENT = "experiment {:09d}"
"""Key of an experiment in the journal; keys sort in the order of the plan."""


class Stage(NamedTuple):
    """Work on the records of a data set, in pieces of which each is done once and kept in the journal.

    Attributes:
        name: One word: ``"baselines"``.
        pieces: Returns the names of its pieces of work, the same and in the same order at every call.
        make: Makes the files of a piece from the plan, the folder of records and earlier pieces, and its name; by path
            in the folder. Where it raises `ScenarioError`, `TwinError` or `SysidError`, the reason stands in the index,
            and the build continues.
    """

    name: str
    pieces: Callable[[DataSetPlan], Iterable[str]]
    make: Callable[[DataSetPlan, Path, str], Mapping[str, Contents | bytes]]


STAGES = (
    Stage("best-linear", best_linear_pieces, best_linear_files),
    Stage("attainable", attainable_pieces, attainable_files),
    Stage("baselines", baseline_pieces, baseline_files),
)
"""Run one after the other when all experiments and the index are there."""


def build(
    spec: DataSetSpec,
    out: Path,
    *,
    workers: int | None = None,
    rows: int = MOST_ROWS,
    executor: Executor[Any] | None = None,
    progress: Report | None = None,
) -> DataSet:
    """Build a data set, or resume an interrupted build; a complete data set is only checked.

    Args:
        spec: The spec.
        out: Folder in which that of the data set is made.
        workers: Threads for the physics; all processors by default. The bits do not depend on it.
        rows: Experiments that run side by side at most: less memory and less to lose, or more speed. The bits do not
            depend on it.
        executor: Runs the experiments instead of this process.
        progress: Called with the progress.

    Raises:
        ScenarioError: Another data set is already there; another build is at work on it; it was begun with another spec
            or by other software; no experiment has a record; or a file cannot be written: then the next build resumes.
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
    try:
        if not final.exists() and not final.is_symlink():
            _build_folder(folder, plan, executor, workers, rows, report)
            # The name without the ending appears when everything is there.
            folder.rename(final)
        elif not (final / JOURNAL).is_file() and not _is_built(final, plan):
            raise ScenarioError(
                f"{final} is already there, and is not what this build would make: a version is never overwritten; "
                "give the spec another version, or build in another folder"
            )
        # If it is still there, the build was killed between renaming the folder and removing the journal.
        (final / JOURNAL).unlink(missing_ok=True)
        report(Progress("finish", 1, 1))
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        if isinstance(error, FileExistsError | NotADirectoryError):
            why = "a file of that name is there, expected a folder or nothing"
        if os.path.exists(folder / JOURNAL):
            why += f"; progress is saved in {folder}: run the command again to resume"
        raise ScenarioError(f"cannot write or read {error.filename or folder}: {why}") from error
    return open_data_set(final)


def _is_built(folder: Path, plan: DataSetPlan) -> bool:
    """Whether a folder is this data set of this software, byte for byte: a build may be killed after its last step."""
    for name, content in _first_files(plan).items():
        if not (folder / name).is_file() or (folder / name).read_bytes() != content:
            return False
    checked = list_files(folder)
    return not checked.problems and _have_hashes(folder, checked.sums)


def _have_hashes(folder: Path, hashes: Mapping[str, str]) -> bool:
    """Whether files are there and have these hashes, by path."""
    return all((folder / path).is_file() and file_hash(folder / path) == value for path, value in hashes.items())


def _first_files(plan: DataSetPlan) -> dict[str, bytes]:
    """Spec and software of a data set, the first files in its folder."""
    record = {"data_set": plan.spec.label, "source": fingerprint(), "versions": versions()}
    return {SPEC: plan.spec.to_toml().encode(), BUILD: f"{json.dumps(record, indent=1, sort_keys=True)}\n".encode()}


def _build_folder(
    folder: Path, plan: DataSetPlan, executor: Executor[Any] | None, workers: int | None, rows: int, report: Report
) -> None:
    """Simulate all experiments into a folder, run the stages, and write index, metadata and checksums."""
    make_folder(folder)
    foreign = sorted(path.name for path in folder.iterdir())
    # Every build begins with these two files.
    if foreign and not {JOURNAL, SPEC} & set(foreign):
        raise ScenarioError(
            f"{folder} holds no build but {', '.join(foreign[:SHOWN])}: expected an empty folder or none"
        )
    label = plan.spec.label
    spec_table = read_toml(plan.spec.to_toml(), label)
    # Everything that the bits of a data set depend on, by name.
    origin = {key: json.dumps(value, sort_keys=True) for key, value in spec_table.items()}
    origin |= {**versions(), "source": fingerprint()}
    with Journal(folder / JOURNAL, origin) as journal:
        remove_partial(folder)
        write_files(folder, _first_files(plan))
        _check_entries(folder, plan, journal, report)
        _simulate_rest(folder, plan, journal, executor, workers, rows, report)
        _check_records(folder, journal)
        # Checksums of an earlier end are wrong while files still change.
        (folder / SUMS).unlink(missing_ok=True)
        write_index(folder, label, _experiments(journal))
        # The stages open the data set by this index; their own entries follow below.
        keys: list[str] = []
        for stage in STAGES:
            keys += _run_stage(stage, plan, folder, journal, report)
        report(Progress("finish", 0, 1))
        # In the order of the plan, whatever order they were made in.
        write_index(folder, label, _experiments(journal), map(journal.get, keys))
        metadata = metadata_files(folder, plan.spec, read_index(folder))
        write_files(folder, metadata)
        _write_checksums(folder, journal, (SPEC, BUILD, INDEX, *metadata))
        sync(folder)


def _experiments(journal: Journal) -> Iterator[dict[str, Any]]:
    """Journal entries of the experiments, in the order of the plan."""
    return (finished for _, finished in journal.items("experiment "))


def _check_entries(folder: Path, plan: DataSetPlan, journal: Journal, report: Report) -> None:
    """Remove entries of the journal whose files are missing or damaged: they are made again."""
    failed = 0
    finished_work = list(journal.items())
    for done, (key, finished) in enumerate(finished_work, start=1):
        report(Progress("check", done, len(finished_work)))
        # Pieces of stages have no number.
        failed += "failed" in finished and "number" in finished
        if not _have_hashes(folder, finished["files"]):
            journal.remove(key)
    # If all have failed, whatever kept them from running may be gone.
    if failed == len(plan):
        for key, _ in finished_work:
            journal.remove(key)


def _check_records(folder: Path, journal: Journal) -> None:
    """Refuse to publish a data set without any record."""
    reasons: Counter[str] = Counter()
    for finished in _experiments(journal):
        if "failed" not in finished:
            return
        # Without the name, equal reasons are counted together.
        reasons[finished["failed"].removeprefix(f"{finished['about']['name']}: ")] += 1
    (commonest, times), other_reasons = reasons.most_common(1)[0], len(reasons) - 1
    and_others = f"; {other_reasons} other reasons" if other_reasons else ""
    raise ScenarioError(
        f"none of {reasons.total()} experiments has a record, and nothing is published; {times} of them: {commonest}"
        f"{and_others}. The same command tries them again in {folder}"
    )


def _simulate_rest(
    folder: Path,
    plan: DataSetPlan,
    journal: Journal,
    executor: Executor[Any] | None,
    workers: int | None,
    rows: int,
    report: Report,
) -> None:
    """Simulate the rest of the experiments; those that are done when something fails are kept."""
    keys = journal.keys("experiment ")
    to_do = [index for index in range(len(plan)) if EXPERIMENT.format(index) not in keys]
    writer = _Writer(folder, plan, journal, report, to_do)

    def batches() -> Iterator[tuple[int, ...]]:
        for chunk in chunks(plan, to_do, rows=rows):
            writer.write()  # before the next long piece of work begins
            yield chunk

    def results() -> Iterator[BuiltExperiment]:
        if executor is None:
            for chunk in batches():
                yield from run_chunk(plan, chunk, threads=workers, progress=lambda ticks, _: writer.show(ticks))
            return
        spec = plan.spec.to_toml()
        with executor:
            yield from executor.run(
                run_chunk_elsewhere, spec, batches(), name=lambda index: plan[index].name, items="experiments"
            )

    writer.show()
    try:
        for experiment in results():
            writer.add(experiment)
    except OSError:
        # The disk may be full: another attempt to write would fail too, and hide the reason.
        raise
    except BaseException:
        writer.write()
        raise
    writer.write()
    if writer.done < len(plan):
        raise ScenarioError(f"the executor returned {writer.done} of {len(plan)} experiments; expected all")


MOST_WAITING, LONGEST_WAIT = 16, 2.0
"""Experiments that wait to be written together, and how long the first of them may wait, s."""


class _Writer:
    """Writes simulated experiments into folder and journal, several together, and shows the progress.

    Their folders are flushed to the disk once for all of them, which takes longer than writing small files.
    """

    def __init__(
        self, folder: Path, plan: DataSetPlan, journal: Journal, report: Report, to_do: Collection[int]
    ) -> None:
        self._folder, self._plan, self._journal, self._report = folder, plan, journal, report
        self.done = len(plan) - len(to_do)
        self._seconds = plan.seconds
        # At least 0: the sums are of many lengths, in different orders.
        self._simulated_seconds = max(self._seconds - sum(map(plan.duration, to_do)), 0.0)
        self._shown_seconds = 0.0
        self._waiting: list[BuiltExperiment] = []
        self._written_at = monotonic()

    def show(self, ticks: int = 0) -> None:
        """Show the progress, with the ticks that a chunk has run."""
        seconds = self._simulated_seconds + ticks / SAMPLE_RATE
        # When the first experiment of a chunk arrives, the ticks of the others have been shown already.
        self._shown_seconds = min(max(self._shown_seconds, seconds), self._seconds)
        total = len(self._plan)
        self._report(Progress("records", self.done, total, "experiments", self._shown_seconds, self._seconds))

    def add(self, experiment: BuiltExperiment) -> None:
        """Take an experiment, and write all that wait when they are many, or have waited long."""
        self._waiting.append(experiment)
        self._simulated_seconds += self._plan.duration(experiment.number)
        if len(self._waiting) >= MOST_WAITING or monotonic() - self._written_at > LONGEST_WAIT:
            self.write()

    def write(self) -> None:
        """Write the experiments that wait: first their files, then that they are done."""
        if not self._waiting:
            return
        files: dict[str, bytes] = {}
        for experiment in self._waiting:
            files |= experiment.files
        write_files(self._folder, files)
        finished = {EXPERIMENT.format(experiment.number): experiment.journal_entry() for experiment in self._waiting}
        self._journal.add_all(finished)
        self.done += len(self._waiting)
        self._waiting.clear()
        self._written_at = monotonic()
        self.show()


def _run_stage(stage: Stage, plan: DataSetPlan, folder: Path, journal: Journal, report: Report) -> Iterator[str]:
    """Make the pieces of a stage that are not in the journal, and yield the keys of all."""
    pieces = list(stage.pieces(plan))
    for done, piece in enumerate(pieces):
        key = f"stage {stage.name}: {piece}"
        report(Progress(stage.name, done, len(pieces)))
        if key not in journal:
            journal.add(key, _make_piece(stage, piece, plan, folder))
        yield key


def _make_piece(stage: Stage, piece: str, plan: DataSetPlan, folder: Path) -> dict[str, Any]:
    """Make and write the files of a piece of a stage, and return its entry in the journal."""
    finished: dict[str, Any] = {"stage": stage.name, "piece": piece, "files": {}, "arrays": {}}
    try:
        contents = stage.make(plan, folder, piece)
    except (ScenarioError, TwinError, SysidError) as error:
        return {**finished, "failed": str(error)}
    files: dict[str, bytes] = {}
    for path, content in contents.items():
        if isinstance(content, Contents):
            finished["arrays"][path] = content.array_hashes()
            files[path] = content.to_bytes()
        else:
            files[path] = content
    write_files(folder, files)
    finished["files"] = {path: bytes_hash(content) for path, content in files.items()}
    return finished


def _write_checksums(folder: Path, journal: Journal, metadata: Iterable[str]) -> None:
    """Write the checksums of all files; refuse files that the build did not make."""
    sums: dict[str, str] = {}
    for _, finished in journal.items():
        sums |= finished["files"]
    sums |= {path: file_hash(folder / path) for path in metadata}
    # SQLite keeps files of its own beside the journal.
    strays = [path for path in paths_of_files(folder) if path not in sums and not path.startswith(JOURNAL)]
    if strays:
        and_more = f" and {len(strays) - SHOWN} more" if len(strays) > SHOWN else ""
        raise ScenarioError(
            f"{folder} holds {', '.join(map(ascii, strays[:SHOWN]))}{and_more}, which no part of the build made: move "
            "away what does not belong to the data set, and run the command again to resume"
        )
    write_checksums(folder, sums)
