"""End of a build: stages, index, metadata and checksums."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hmtb_twin import TwinError
from scenarios.datasets.index import read_index, write_index
from scenarios.datasets.plan import BUILD, INDEX, JOURNAL, SPEC, SUMS, DataSetPlan
from scenarios.datasets.stages import METADATA, STAGES, Stage
from scenarios.files.atomic_write import sync_folder, write_files, write_whole
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import bytes_hash, file_hash
from scenarios.files.netcdf import Contents
from scenarios.jobs.journal import Journal
from scenarios.jobs.progress import Progress, Report
from sysid import SysidError

SHOWN = 3
"""Files that an error names."""

EXPERIMENT, PIECE = "experiment ", "stage "
"""Begin of the keys of experiments and of pieces of stages in the journal."""


def experiment_key(number: int) -> str:
    """Key of an experiment in the journal; keys sort in the order of the plan."""
    return f"{EXPERIMENT}{number:09d}"


def finish(plan: DataSetPlan, folder: Path, journal: Journal, report: Report) -> None:
    """Complete a build whose experiments are all in the journal.

    Args:
        plan: The experiments.
        folder: Folder of the build.
        journal: Journal of the build.
        report: Called with the progress.

    Raises:
        ScenarioError: The folder holds files that no part of the build made.
        OSError: A file cannot be written; the next build resumes.
    """
    # Checksums of an earlier end are wrong while files still change.
    (folder / SUMS).unlink(missing_ok=True)
    write_index(folder, plan.spec.label, experiment_entries(journal))
    for stage in STAGES:
        _run_stage(stage, plan, folder, journal, report)
    report(Progress("finish", 0, 1))
    # In the order of the plan, whatever order they were made in.
    keys = [_piece_key(stage, piece) for stage in STAGES for piece in stage.pieces(plan)]
    write_index(folder, plan.spec.label, experiment_entries(journal), (journal.get(key) for key in keys))
    metadata = {SPEC: b"", BUILD: b"", INDEX: b""}
    for write in METADATA:
        files = write(folder, plan.spec, read_index(folder))
        write_files(folder, files)
        metadata |= files
    _write_checksums(folder, journal, metadata)
    sync_folder(folder)


def experiment_entries(journal: Journal) -> Iterator[dict[str, Any]]:
    """Journal entries of the experiments, in the order of the plan."""
    return (entry for _, entry in journal.items(EXPERIMENT))


def _piece_key(stage: Stage, piece: str) -> str:
    return f"{PIECE}{stage.name}: {piece}"


def _run_stage(stage: Stage, plan: DataSetPlan, folder: Path, journal: Journal, report: Report) -> None:
    """Run the pieces of a stage that are not in the journal."""
    pieces = list(stage.pieces(plan))
    for number, piece in enumerate(pieces):
        report(Progress(stage.name, number, len(pieces)))
        if _piece_key(stage, piece) not in journal:
            journal.add(_piece_key(stage, piece), _made(stage, plan, folder, piece))


def _made(stage: Stage, plan: DataSetPlan, folder: Path, piece: str) -> dict[str, Any]:
    """Make and write the files of a piece, and return its journal entry."""
    entry: dict[str, Any] = {"stage": stage.name, "piece": piece, "files": {}, "arrays": {}}
    try:
        contents = stage.make(plan, folder, piece)
    except (ScenarioError, TwinError, SysidError) as error:
        return {**entry, "failed": str(error)}
    files = {path: one.to_bytes() if isinstance(one, Contents) else one for path, one in contents.items()}
    write_files(folder, files)
    entry["files"] = {path: bytes_hash(content) for path, content in files.items()}
    entry["arrays"] = {path: one.array_hashes() for path, one in contents.items() if isinstance(one, Contents)}
    return entry


def _write_checksums(folder: Path, journal: Journal, metadata: dict[str, bytes]) -> None:
    """Write the checksums of all files, as `sha256sum --check` reads them; refuse files that the build did not make."""
    sums = {path: value for _, entry in journal.items() for path, value in entry["files"].items()}
    sums |= {path: file_hash(folder / path) for path in metadata}
    ours = {*sums, *(path.relative_to(folder).as_posix() for path in folder.glob(f"{JOURNAL}*"))}
    files = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_symlink() or path.is_file())
    strays = sorted(path for path in files if path not in ours)
    if strays:
        more = f" and {len(strays) - SHOWN} more" if len(strays) > SHOWN else ""
        raise ScenarioError(
            f"{folder} holds {', '.join(map(ascii, strays[:SHOWN]))}{more}, which no part of the build made: move away "
            "what does not belong to the data set, and run the command again to resume"
        )
    write_whole(folder / SUMS, "".join(f"{sums[path]}  {path}\n" for path in sorted(sums)), durable=True)
