"""The end of a build: truth, scores and metadata, checksums, and the folder's own name."""

import os
from collections.abc import Collection, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

from hmtb_twin import TwinError
from scenarios.datasets.build_progress import Progress, Told
from scenarios.datasets.index import Summary, failures, read_index, summary, write_index
from scenarios.datasets.layout import BUILD, DATA, INDEX, LOCK, MANIFEST, SPEC, SUMS, TRUTH
from scenarios.datasets.lock import locked, unlock_file
from scenarios.datasets.manifest import Manifest
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.stage import Stage
from scenarios.datasets.stages import PAPERS, STAGES
from scenarios.files.atomic_write import replacing, sync_folder, write_files
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import bytes_hash, file_hash
from scenarios.files.netcdf import Contents
from sysid import SysidError

SHOWN = 3
"""Files that an error names."""


def refuse_strays(folder: Path, manifest: Manifest, written: Collection[str]) -> None:
    """Refuse a folder with files of nobody.

    Args:
        folder: That of the build.
        manifest: What it says was made is there.
        written: Places of files that the manifest does not name.

    Raises:
        ScenarioError: There are others.
    """
    # Of millions of files the names would fill the memory: they are compared only where their number is not right.
    if sum(1 for _ in _places(folder)) == sum(1 for _ in _noted(manifest)) + len(written):
        return
    known = {*_noted(manifest), *written}
    strays = sorted(place for place in _places(folder) if place not in known)
    if strays:
        more = f" and {len(strays) - SHOWN} more" if len(strays) > SHOWN else ""
        raise ScenarioError(
            f"{folder} holds {', '.join(map(ascii, strays[:SHOWN]))}{more}, which no part of the build made: take away "
            "what is not of the data set; the same command goes on from there"
        )


def _places(folder: Path) -> Iterator[str]:
    for parent, folders, names in os.walk(folder):
        links = [name for name in folders if Path(parent, name).is_symlink()]
        yield from (Path(parent, name).relative_to(folder).as_posix() for name in (*names, *links))


def _noted(manifest: Manifest) -> Iterator[str]:
    for line in chain(manifest.noted(), manifest.pieces()):
        yield from line["files"]


def write_sums(folder: Path, manifest: Manifest) -> None:
    """Write the checksums, as `sha256sum --check` reads them: files of experiments in the order of the plan first.

    Args:
        folder: That of the data set.
        manifest: What is noted in it was written, or looked at, with the hash that stands there.

    Raises:
        OSError: A file cannot be read or written.
    """
    with replacing(folder / SUMS, durable=True) as partial, partial.open("wb") as stream:
        for line in manifest.noted():
            for place, of_file in sorted(line["files"].items()):
                stream.write(f"{of_file}  {place}\n".encode())
        noted = {place: of_file for line in manifest.pieces() for place, of_file in line["files"].items()}
        for place in sorted({*noted, *_papers(folder)}):
            stream.write(f"{noted.get(place) or file_hash(folder / place)}  {place}\n".encode())


def _papers(folder: Path) -> Iterator[str]:
    """Files that no manifest names: all but those of data and truth."""
    for parent, folders, names in os.walk(folder):
        if Path(parent) == folder:
            folders[:] = [name for name in folders if name not in (DATA, TRUTH)]
            names = [name for name in names if name not in (LOCK, SUMS, f"{SUMS}.partial")]
        for name in names:
            yield Path(parent, name).relative_to(folder).as_posix()


def finish(plan: DataSetPlan, folder: Path, final: Path, manifest: Manifest, told: Told) -> Summary:
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


def _run_stage(stage: Stage, plan: DataSetPlan, folder: Path, manifest: Manifest, told: Told) -> dict[str, str]:
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


def _made(stage: Stage, plan: DataSetPlan, folder: Path, piece: str) -> dict[str, Any]:
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
