"""The end of a build: what is made of the records, what is said of them, checksums, and the folder's own name."""

from pathlib import Path
from typing import Any

from hmtb_twin import TwinError
from scenarios.dataset_build.index import Summary, failures, read_index, summary, write_index
from scenarios.dataset_build.lock import locked, unlock_file
from scenarios.dataset_build.manifest import Manifest
from scenarios.dataset_build.progress import Progress, Told
from scenarios.dataset_build.safe_write import sync_folder, write_files
from scenarios.dataset_build.stage import Stage
from scenarios.dataset_build.stages import PAPERS, STAGES
from scenarios.dataset_build.strays import refuse_strays
from scenarios.dataset_build.sums import write_sums
from scenarios.datasets.hashes import bytes_hash
from scenarios.datasets.layout import BUILD, INDEX, LOCK, MANIFEST, SPEC, SUMS
from scenarios.datasets.netcdf import Contents
from scenarios.datasets.plan import Plan
from scenarios.errors import ScenarioError
from sysid import SysidError


def finish(plan: Plan, folder: Path, final: Path, manifest: Manifest, told: Told) -> Summary:
    """Bring a build of which every experiment is noted to its end.

    Args:
        plan: The experiments.
        folder: The folder of the build, locked.
        final: Its name once it is done.
        manifest: The manifest of the build.
        told: Told how far it is.

    Raises:
        ScenarioError: Files are in the folder that no part of the build made.
        OSError: A file cannot be written; the next build goes on from there.
    """
    # What an earlier end left would be false while files still change.
    (folder / SUMS).unlink(missing_ok=True)
    found = write_index(folder, plan.spec.label, manifest)
    failed = dict(found.failed)
    for stage in STAGES:
        failed |= _run_stage(stage, plan, folder, manifest, told)
    told(Progress("finish", 0, 1))
    manifest.put_in_order([(stage.name, piece) for stage in STAGES for piece in stage.pieces(plan)])
    written = {SPEC, BUILD, MANIFEST, INDEX, LOCK}
    for papers in PAPERS:
        made = papers(folder, plan.spec, read_index(folder))
        write_files(folder, made)
        written |= made.keys()
    refuse_strays(folder, manifest, written)
    write_sums(folder, manifest)
    folder.rename(final)
    sync_folder(final.parent)
    unlock_file(final)
    told(Progress("finish", 1, 1))
    return Summary(found.experiments, failed, found.hash)


def finished(final: Path) -> Summary | None:
    """What came of a build that was killed when all was done but the last stroke: taking the lock's file away.

    Returns:
        The same as the build would have; None where a data set is there to which nothing is left to do.
    """
    if not (final / LOCK).is_file():
        return None
    with locked(final):
        unlock_file(final)
    return summary(final)


def _run_stage(stage: Stage, plan: Plan, folder: Path, manifest: Manifest, told: Told) -> dict[str, str]:
    """Run the pieces of a stage that are missing, and return what failed of all."""
    pieces = list(stage.pieces(plan))
    failed: dict[str, str] = {}
    for number, piece in enumerate(pieces):
        told(Progress(stage.name, number, len(pieces)))
        line = manifest.piece(stage.name, piece)
        if line is None:
            line = _made(stage, plan, folder, piece)
            manifest.append([line])
        failed |= failures(line)
    return failed


def _made(stage: Stage, plan: Plan, folder: Path, piece: str) -> dict[str, Any]:
    """Make and write the files of a piece, and return the entry of the manifest about it."""
    line: dict[str, Any] = {"stage": stage.name, "piece": piece, "files": {}, "arrays": {}}
    try:
        contents = stage.make(plan, folder, piece)
    except (ScenarioError, TwinError, SysidError) as error:
        return {**line, "failed": str(error)}
    files = {place: one.to_bytes() if isinstance(one, Contents) else one for place, one in contents.items()}
    write_files(folder, files)
    line["files"] = {place: bytes_hash(content) for place, content in files.items()}
    line["arrays"] = {place: one.array_hashes() for place, one in contents.items() if isinstance(one, Contents)}
    return line
