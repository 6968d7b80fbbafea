"""Build a data set into a folder of its own."""

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenarios.datasets import manifest
from scenarios.datasets.chunk import Made, chunks, run_chunk
from scenarios.datasets.hashes import bytes_hash, file_hash, whole_hash
from scenarios.datasets.layout import INDEX, MANIFEST, SPEC, SUMS, UNFINISHED
from scenarios.datasets.plan import Plan
from scenarios.datasets.spec import DataSetSpec
from scenarios.errors import ScenarioError
from scenarios.whole_file import write_whole

Progress = Callable[[int, int], None]
"""Called with the experiments done and those there are."""


@dataclass(frozen=True)
class Built:
    """A data set on disk.

    Attributes:
        path: Its folder.
        experiments: How many experiments have a record.
        failed: Why others have none, by name.
        hash: Of all arrays together.
    """

    path: Path
    experiments: int
    failed: Mapping[str, str]
    hash: str


def build(spec: DataSetSpec, out: Path, *, workers: int | None = None, progress: Progress | None = None) -> Built:
    """Build a data set, or go on with a build that was interrupted.

    Args:
        spec: The spec.
        out: The folder in which that of the data set is made.
        workers: Threads for the physics; all processors by default. The bits do not depend on it.
        progress: Told how many experiments are done.

    Raises:
        ScenarioError: The data set is already there, or another spec's build has been left unfinished.
        OSError: A file cannot be written; what is written stays, and the next build goes on from there.
    """
    final, folder = out / spec.label, out / (spec.label + UNFINISHED)
    if final.exists():
        raise ScenarioError(f"{final} is already there: a version is never overwritten; give the spec another version")
    plan = Plan(spec)
    folder.mkdir(parents=True, exist_ok=True)
    if (folder / SPEC).exists() and (folder / SPEC).read_text(encoding="utf-8") != spec.to_toml():
        raise ScenarioError(f"{folder} holds the unfinished build of another spec; remove it, or give that spec")
    write_whole(folder / SPEC, spec.to_toml())
    done = manifest.read(folder / MANIFEST)
    left = [number for number in range(len(plan)) if number not in done]
    for chunk in chunks(plan, left):
        lines = [_kept(folder, made) for made in run_chunk(plan, chunk, threads=workers)]
        manifest.append(folder / MANIFEST, lines)
        done |= {line["number"]: line for line in lines}
        if progress is not None:
            progress(len(done), len(plan))
    return _finished(plan, folder, final, done)


def _kept(folder: Path, made: Made) -> dict[str, Any]:
    """Write the files of an experiment and return its line of the manifest."""
    for place, content in made.files.items():
        path = folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".partial")
        with partial.open("wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    return manifest.line_of(made, {place: bytes_hash(content) for place, content in made.files.items()})


def _finished(plan: Plan, folder: Path, final: Path, done: Mapping[int, Mapping[str, Any]]) -> Built:
    """Write what is said of the whole, and give the folder its name."""
    lines = [done[number] for number in range(len(plan))]
    arrays = {file: hashes for line in lines for file, hashes in line.get("arrays", {}).items()}
    failed = {line["experiment"]: line["failed"] for line in lines if "failed" in line}
    whole = whole_hash(arrays)
    entries = [
        {
            "name": entry.name,
            "part": entry.part,
            "block": entry.block,
            "arm": entry.arm,
            "twin": entry.twin,
            "joints": list(entry.joints),
            "file": entry.data,
            "seed": entry.experiment.seed,
            "arrays": line.get("arrays", {}),
            "failed": line.get("failed"),
        }
        for entry, line in zip(plan, lines, strict=True)
    ]
    index = {"data_set": plan.spec.label, "hash": whole, "experiments": entries}
    write_whole(folder / INDEX, json.dumps(index, indent=1, allow_nan=False) + "\n")
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != SUMS)
    sums = "".join(f"{file_hash(path)}  {path.relative_to(folder).as_posix()}\n" for path in files)
    write_whole(folder / SUMS, sums)
    folder.rename(final)
    return Built(final, len(lines) - len(failed), failed, whole)
