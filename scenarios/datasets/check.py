"""Check a data set: its files, hashes and metadata, and some of its experiments by simulating them again."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.checked_index import Index, checked_index
from scenarios.datasets.checked_record import record_problems
from scenarios.datasets.folder_files import Files, folder_files
from scenarios.datasets.layout import DATA, SUMS, TRUTH, UNFINISHED
from scenarios.datasets.netcdf_inspector import Inspector
from scenarios.datasets.regeneration import regeneration
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash

REGENERATED = 3
"""Experiments that are simulated again."""

MOST_READERS = 8
"""Processes that read files side by side."""

FILES_OF_A_READER = 50
"""With fewer files for each, another process would cost more than it saves."""

LONGEST = 600
"""Characters of a problem."""

Progress = Callable[[int, int], None]
"""Called with the files done and those there are."""


@dataclass(frozen=True)
class Checked:
    """What a check found.

    Attributes:
        problems: What differs; empty: nothing does.
        notes: What was found to agree by simulation, and what could not be checked.
    """

    problems: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing differs."""
        return not self.problems


def check(folder: Path, *, regenerate: int = REGENERATED, seed: int = 0, workers: int | None = None) -> tuple[str, ...]:
    """Problems of a data set; see `examine`."""
    return examine(folder, regenerate=regenerate, seed=seed, workers=workers).problems


def examine(
    folder: Path,
    *,
    regenerate: int = REGENERATED,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Checked:
    """Check a data set, wherever it comes from; nothing outside its folder is read.

    Args:
        folder: Its folder.
        regenerate: How many experiments to simulate again.
        seed: Draws them.
        workers: Threads for the physics, and processes that read files; all processors by default.
        progress: Told how many files are done.

    Raises:
        ScenarioError: There is no such folder, or the data set is not built to its end.
    """
    if not folder.is_dir():
        raise ScenarioError(f"no folder {folder}: expected that of a data set")
    if folder.name.endswith(UNFINISHED):
        raise ScenarioError(f"{folder} is not built to its end; go on with: hmtb dataset build")
    if regenerate < 0:
        raise ScenarioError(f"regenerate = {regenerate} given, expected 0 experiments or more")
    try:
        files = folder_files(folder)
        index = checked_index(folder, files)
        problems, sound = _file_problems(folder, files, index, progress or (lambda done, total: None), workers)
    except OSError as error:
        raise ScenarioError(f"cannot read {error.filename or folder}: {error.strerror or error}") from error
    again, notes = regeneration(folder, index, regenerate, seed, sound, workers=workers)
    apart = [p for p in index.arrays if p.startswith(f"{TRUTH}/") and p not in files.sums and p not in files.sizes]
    if apart:
        index.notes.append(f"the truth in {len(apart)} files is kept apart and was not checked")
    kept = sum(entry["failed"] is None for entry in index.entries)
    if index.entries:
        index.notes.append(f"{kept} of {len(index.entries)} experiments have a record")
    if not kept and not index.problems:
        index.problems.append("no experiment has a record")
    absent = [p for p in index.arrays if p not in files.sums and p not in apart]
    strange = [p for p in files.sums if p.startswith(f"{DATA}/") and p not in index.arrays] if index.entries else []
    found = (
        *files.problems,
        *index.problems,
        *(f"{place} has array hashes, but no checksum" for place in absent),
        *(f"{place} is of no experiment" for place in strange),
        *problems,
        *again,
    )
    return Checked(tuple(map(_plain, found)), tuple(map(_plain, (*index.notes, *notes))))


def _plain(text: str) -> str:
    """A line that does a terminal no harm, whatever a file has put into it."""
    line = text if text.isprintable() else text.encode("unicode_escape").decode()
    return line if len(line) <= LONGEST else f"{line[:LONGEST]} ..."


def _file_problems(
    folder: Path, files: Files, index: Index, progress: Progress, workers: int | None
) -> tuple[list[str], list[str]]:
    """Problems of the files that are there, and the files without any."""
    problems: list[str] = []
    sound: list[str] = []
    entries = {entry["file"]: (number, entry) for number, entry in enumerate(index.entries)}
    places = list(files.sound)
    several = max(1, min(workers or os.cpu_count() or 1, MOST_READERS, len(places) // FILES_OF_A_READER))
    idle: SimpleQueue[Inspector] = SimpleQueue()

    def wrong(place: str) -> list[str]:
        found = file_hash(folder / place)
        said = [] if found == files.sums[place] else [_mismatch(found, index.files.get(place))]
        if place in index.arrays:
            inspector = idle.get()
            try:
                said += _array_problems(folder, place, index, entries.get(place), inspector, changed=bool(said))
            finally:
                idle.put(inspector)
        return said

    with ExitStack() as stack:
        for _ in range(several):
            idle.put(stack.enter_context(Inspector()))
        threads = stack.enter_context(ThreadPoolExecutor(several))
        # Whoever interrupts does not wait for the files that are left.
        stack.callback(threads.shutdown, cancel_futures=True)
        for done, (place, said) in enumerate(zip(places, threads.map(wrong, places), strict=True), start=1):
            problems += [f"{place}: {problem}" for problem in said]
            if not said:
                sound.append(place)
            progress(done, len(places))
    return problems, sound


def _mismatch(found: str, noted: str | None) -> str:
    if found == noted:
        return f"its hash is not that of {SUMS} but that of the manifest: {SUMS} is damaged"
    return f"its hash is not that of {SUMS}"


def _array_problems(
    folder: Path,
    place: str,
    index: Index,
    entry: tuple[int, Mapping[str, object]] | None,
    inspector: Inspector,
    *,
    changed: bool,
) -> list[str]:
    try:
        found = inspector.look(folder / place)
    except ScenarioError as error:
        return [f"cannot be read: {str(error).removeprefix(str(folder / place)).lstrip(': ')}"]
    expected = index.arrays[place]
    names = sorted({*expected, *found["arrays"]})
    differ = [name for name in names if expected.get(name) != found["arrays"].get(name)]
    several = len(differ) > 1
    said = f"array{'s' if several else ''} {', '.join(differ)} differ{'' if several else 's'} from the index"
    problems = [said] if differ else []
    if changed and not differ:
        problems.append("its arrays are those of the index: the file was written anew, or only its description changed")
    if entry is not None:
        number, told = entry
        samples = None if index.plan is None else round(SAMPLE_RATE * index.plan.duration(number))
        problems += record_problems(found, told, index.spec, samples)
    return problems
