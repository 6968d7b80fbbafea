"""Check a published data set with the key of its truth: nothing is left that cannot be checked."""

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenarios.datasets.challenge_key import Key, read_key, unpack
from scenarios.datasets.challenge_secret import public_spec
from scenarios.datasets.check import REGENERATED, Checked, Progress, examine
from scenarios.datasets.checked_index import Index, checked_index
from scenarios.datasets.data_record import published
from scenarios.datasets.folder_files import folder_files
from scenarios.datasets.index import read_index
from scenarios.datasets.layout import SPEC, SUMS
from scenarios.datasets.regeneration import regeneration
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf import read_netcdf

UNKNOWN = "no experiment was simulated again"
"""How the note begins that the key makes needless."""


def examine_with_key(
    folder: Path,
    key_path: Path,
    *,
    regenerate: int = REGENERATED,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Checked:
    """Check a published data set, what its key keeps apart, and that both belong together.

    Args:
        folder: The published folder.
        key_path: Its key.
        regenerate: How many experiments to simulate again.
        seed: Draws them.
        workers: Threads for the physics.
        progress: Told how many files are done.

    Raises:
        ScenarioError: No such folder, no key, or one of other data sets.
    """
    key = read_key(key_path)
    key.complete()
    found = examine(folder, regenerate=0, progress=progress)
    if found.problems:
        return replace(found, notes=(*found.notes, "the key was not held against a folder with problems"))
    label = str(read_index(folder)["data_set"])
    problems = list(_binding(key, label, folder))
    notes = [note for note in found.notes if not note.startswith(UNKNOWN)]
    if not problems:
        again, more = _whole(key, label, folder, regenerate, seed, workers)
        problems += again
        notes += [f"the key is the one that the folder was committed to: {key.sets[label].commitment[:12]}", *more]
    return Checked(tuple(problems), tuple(notes))


def _binding(key: Key, label: str, folder: Path) -> Iterator[str]:
    bound, spec = key.sets.get(label), key.spec_of(label)
    if bound is None or (folder / SPEC).read_text(encoding="utf-8") != public_spec(spec, bound.commitment).to_toml():
        yield f"{SPEC}: the commitment, or another line, is not that of {key.path}"
    elif file_hash(folder / SUMS) != bound.published:
        yield f"{SUMS} is not that of the folder which {key.path} was made with: something was exchanged"


def _whole(
    key: Key, label: str, folder: Path, count: int, seed: int, workers: int | None
) -> tuple[list[str], list[str]]:
    """Check what is kept apart, in a folder that only its owner can read and that goes afterwards."""
    with tempfile.TemporaryDirectory(prefix="hmtb-key-") as place:
        try:
            whole = unpack(key, label, Path(place))
        except ScenarioError as error:
            return [str(error)], []
        index = checked_index(whole, folder_files(whole))
        problems = [f"{key.path}: {problem}" for problem in index.problems]
        problems += _published_differences(whole, folder, index)
        if problems:
            return problems, []
        for entry in index.entries:
            path = whole / entry["file"]
            if not path.exists() and entry["failed"] is None:
                # The same arrays; of the attributes nothing is compared.
                path.parent.mkdir(parents=True, exist_ok=True)
                path.symlink_to((folder / entry["file"]).absolute())
        return regeneration(whole, index, count, seed, list(index.arrays), workers=workers)


def _published_differences(whole: Path, folder: Path, index: Index) -> Iterator[str]:
    """Where the published records are not what the whole ones say."""
    public = read_index(folder)["experiments"]
    assert index.plan is not None  # noqa: S101 - the key has its spec
    for entry, kept, shown in zip(index.plan, index.entries, public, strict=True):
        expected = kept["arrays"].get(entry.data, {})
        if entry.part == "test" and kept["failed"] is None:
            expected = published(read_netcdf(whole / entry.data), entry, index.plan.spec).array_hashes()
        if shown["arrays"].get(entry.data, {}) != expected:
            yield f"{entry.data}: its arrays are not those that the key tells"
