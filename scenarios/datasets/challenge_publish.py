"""Publish a data set without its truth: a folder of its own, made from the whole one, that tells no more."""

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.chunk import about
from scenarios.datasets.data_record import PRIVATE, published
from scenarios.datasets.finish import refuse_strays, write_sums
from scenarios.datasets.index import read_index, write_index
from scenarios.datasets.layout import BASELINES, BUILD, INDEX, LOCK, MANIFEST, SPEC, SUMS, UNFINISHED
from scenarios.datasets.lock import locked, unlock_file
from scenarios.datasets.manifest import Manifest
from scenarios.datasets.metadata import metadata_files
from scenarios.datasets.plan import DataSetPlan, PlannedExperiment
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.atomic_write import make_folder, remove_partial, sync_folder, write_files
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import bytes_hash
from scenarios.files.netcdf import read_netcdf

FAILED = "it could not be run; the reason is kept apart"
"""What is said of an experiment that failed: the reason may tell numbers that were drawn."""

UNTOLD = ("command", "failed")
"""Columns of the table of baselines that need what is kept apart, or may tell of it."""


def publish(full: Path, public: DataSetSpec, out: Path) -> Path:
    """Make the folder that is published; where it is there already and the same, nothing is done.

    Args:
        full: The whole data set, finished.
        public: Its spec with the commitment instead of the seed.
        out: Folder in which that of the data set is made.

    Returns:
        The folder.

    Raises:
        ScenarioError: Another data set of that name is there, another program is at work on it, or files are in its
            folder that are none of it.
        OSError: A file cannot be written; the next call begins anew.
    """
    final, folder = out / public.label, out / (public.label + UNFINISHED)
    if final.exists() or final.is_symlink():
        if not is_published(final, public):
            raise ScenarioError(f"{final} is already there: a version is never overwritten; build in another folder")
        (final / LOCK).unlink(missing_ok=True)
        return final
    make_folder(folder)
    with locked(folder):
        remove_partial(folder)
        _check_begun(folder, public)
        for place in (MANIFEST, SUMS):
            (folder / place).unlink(missing_ok=True)
        # What it was built with, whatever publishes it.
        write_files(folder, {SPEC: public.to_toml().encode(), BUILD: (full / BUILD).read_bytes()})
        plan = DataSetPlan(public)
        with Manifest(folder / MANIFEST, len(plan)) as manifest:
            for line, files in _records(full, plan):
                write_files(folder, files)
                manifest.append([line])
            if table := published_baselines(full):
                write_files(folder, {BASELINES: table})
                files_of = {BASELINES: bytes_hash(table)}
                manifest.append([{"stage": "baselines", "piece": "table", "files": files_of, "arrays": {}}])
            write_index(folder, public.label, manifest, commitment=public.commitment)
            made = metadata_files(folder, public, read_index(folder))
            write_files(folder, made)
            refuse_strays(folder, manifest, {SPEC, BUILD, MANIFEST, INDEX, LOCK, *made})
            write_sums(folder, manifest)
        folder.rename(final)
        sync_folder(out)
        unlock_file(final)
    return final


def _check_begun(folder: Path, public: DataSetSpec) -> None:
    """Refuse a folder in which something else was begun."""
    there = sorted(path.name for path in folder.iterdir() if path.name != LOCK)
    if there and not is_published(folder, public):
        raise ScenarioError(
            f"{folder} holds something else, {', '.join(there[:3])}: expected an empty folder or none; remove it, or "
            "build in another folder"
        )


def is_published(folder: Path, public: DataSetSpec) -> bool:
    """Whether a folder is that of a published spec."""
    path = folder / SPEC
    return path.is_file() and path.read_text(encoding="utf-8") == public.to_toml()


def published_about(entry: PlannedExperiment) -> dict[str, Any]:
    """What the index of a published data set says of an experiment, but for its hashes."""
    return {key: value for key, value in about(entry).items() if key not in PRIVATE}


def _records(full: Path, plan: DataSetPlan) -> Iterator[tuple[Mapping[str, Any], Mapping[str, bytes]]]:
    """By experiment the line of the manifest and the file."""
    for number, (entry, told) in enumerate(zip(plan, read_index(full)["experiments"], strict=True)):
        line: dict[str, Any] = {"number": number, "about": published_about(entry), "files": {}, "arrays": {}}
        if told["failed"]:
            yield {**line, "failed": FAILED}, {}
            continue
        shown = published(read_netcdf(full / entry.data), entry, plan.spec)
        content = shown.to_bytes()
        line |= {"files": {entry.data: bytes_hash(content)}, "arrays": {entry.data: shown.array_hashes()}}
        yield line, {entry.data: content}


def published_baselines(full: Path) -> bytes:
    """The table of baselines without the row of the truth and the columns that need what is kept apart."""
    path = full / BASELINES
    if not path.is_file() or not path.stat().st_size:
        return b""
    with path.open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        names = [name for name in reader.fieldnames or () if name not in UNTOLD]
        rows = [row for row in reader if row["method"] != "truth" and not row.get("failed")]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode() if rows else b""
