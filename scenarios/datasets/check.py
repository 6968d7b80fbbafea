"""Check a data set: its files, hashes and metadata, and some of its experiments by simulating them again."""

import json
import os
import random
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hmtb_twin.files.errors import TwinError
from hmtb_twin.files.hashes import file_hash
from hmtb_twin.files.netcdf import Contents, contents_of, read_netcdf
from hmtb_twin.parameters.values import RECORDER, SAMPLE_RATE
from scenarios.datasets.chunk import BuiltExperiment, chunks, run_chunk
from scenarios.datasets.experiment_file import record_attributes
from scenarios.datasets.folder_check import CheckedFolder, check_folder
from scenarios.datasets.plan import BUILD, DATA, SUMS, TRUTH, UNFINISHED
from scenarios.datasets.record_check import file_problems
from scenarios.files.errors import DAMAGE, ScenarioError
from scenarios.files.provenance import fingerprint, versions
from scenarios.jobs.progress import Progress, Report

RELATIVE = 1e-9
"""With other versions, arrays may differ by this part of their largest magnitude."""


STATE_MATRICES, RESPONSE_STEPS = ("A", "B", "C", "K"), 100
"""Arrays of the truth in coordinates of the state, and samples of the responses that are compared instead."""


class DataSetCheck(NamedTuple):
    """Result of a check.

    Attributes:
        problems: One line for each thing that differs from what it should be.
        notes: Agreement of simulations, and what could not be checked.
    """

    problems: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing differs."""
        return not self.problems


def examine(
    folder: Path,
    *,
    regenerate: int = 3,
    seed: int = 0,
    workers: int | None = None,
    progress: Report | None = None,
) -> DataSetCheck:
    """Check a data set, wherever it comes from; nothing outside its folder is read.

    Args:
        folder: Its folder.
        regenerate: Number of experiments to simulate again.
        seed: Draws them.
        workers: Threads for the physics, and processes that read files; all processors by default.
        progress: Called with the progress.

    Raises:
        ScenarioError: There is no such folder, or the data set is not finished.
    """
    if not folder.is_dir():
        raise ScenarioError(f"no folder {folder}: expected that of a data set")
    if folder.name.endswith(UNFINISHED):
        raise ScenarioError(f"{folder} is an unfinished build; finish it with hmtb dataset build")
    if regenerate < 0:
        raise ScenarioError(f"regenerate = {regenerate} given, expected 0 experiments or more")
    try:
        checked = check_folder(folder)
        problems, notes, arrays, sums = checked.problems, checked.notes, checked.arrays, checked.sums
        there = {*sums, *checked.sizes}
        truth = [path for path in arrays if path.startswith(f"{TRUTH}/") and path not in there]
        if truth:
            notes.append(f"the truth in {len(truth)} files is not in this copy and was not checked")
        records = sum(entry["failed"] is None for entry in checked.entries)
        if not records and not problems:
            problems.append("no experiment has a record")
        if checked.entries:
            notes.append(f"{records} of {len(checked.entries)} experiments have a record")
            absent = [path for path in arrays if path not in sums and path not in truth]
            problems += [f"{path} has array hashes, but no checksum" for path in absent]
            unknown = [path for path in sums if path.startswith(f"{DATA}/") and path not in arrays]
            problems += [f"{path} belongs to no experiment" for path in unknown]
        wrong = _file_problems(folder, checked, progress or (lambda _: None), workers)
    except OSError as error:
        raise ScenarioError(f"cannot read {error.filename or folder}: {error.strerror or error}") from error
    problems += [f"{path}: {problem}" for path, texts in wrong.items() for problem in texts]
    sound = {path for path, texts in wrong.items() if not texts}
    _regenerate(folder, checked, regenerate, seed, sound, workers)
    return DataSetCheck(tuple(map(_plain, problems)), tuple(map(_plain, notes)))


def _plain(text: str) -> str:
    """A line of at most 600 characters, none of which steers a terminal, whatever a file contains."""
    line = text if text.isprintable() else text.encode("unicode_escape").decode()
    return line if len(line) <= 600 else f"{line[:600]} ..."


def _file_problems(folder: Path, checked: CheckedFolder, report: Report, workers: int | None) -> dict[str, list[str]]:
    """Problems of each file that is there."""
    numbers = {entry["file"]: number for number, entry in enumerate(checked.entries)}
    paths = [path for path in checked.sums if path in checked.sizes]
    # Each thread reads in a process of its own, which pays from about fifty files on, and up to eight.
    readers = max(1, min(workers or os.cpu_count() or 1, 8, len(paths) // 50))

    def check_file(path: str) -> list[str]:
        changed = file_hash(folder / path) != checked.sums[path]
        wrong = [f"its hash is not that of {SUMS}"] if changed else []
        if path in checked.arrays:
            try:
                wrong += file_problems(folder / path, checked.arrays[path], changed, expected(path))
            except DAMAGE as error:
                reason = str(error) if isinstance(error, TwinError) else repr(error)[:200]
                wrong.append(f"cannot be read: {reason.removeprefix(str(folder / path)).lstrip(': ')}")
        return wrong

    def expected(path: str) -> tuple[Any, ...] | None:
        """What index and spec say of a record; None for other files."""
        if path not in numbers:
            return None
        entry, plan = checked.entries[numbers[path]], checked.plan
        if plan is None:
            return record_attributes(None, entry), entry.get("joints"), None, None
        samples = round(SAMPLE_RATE * plan.duration(numbers[path]))
        withheld = plan.spec.window if plan.spec.withheld and entry["part"] == "test" else None
        return record_attributes(plan.spec, entry), entry.get("joints"), samples, withheld

    problems: dict[str, list[str]] = {}
    with ExitStack() as stack:
        threads = stack.enter_context(ThreadPoolExecutor(readers))
        # An interrupted check does not wait for the files that are left.
        stack.callback(threads.shutdown, cancel_futures=True)
        for path, wrong in zip(paths, threads.map(check_file, paths), strict=True):
            problems[path] = wrong
            report(Progress("check", len(problems), len(paths), "files"))
    return problems


def same_software(folder: Path) -> bool:
    """Whether a data set was built with the software that runs here."""
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        built, now = record["versions"], versions()
        matter = ("hmtb-twin", "machine", "mujoco", "numpy", "pin", "scipy")  # what the numbers depend on
        return record["source"] == fingerprint() and all(built.get(name) == now[name] for name in matter)
    except DAMAGE:
        return False


def _regenerate(
    folder: Path, checked: CheckedFolder, count: int, seed: int, sound: Collection[str], workers: int | None
) -> None:
    """Simulate some experiments again; note the problems, or the agreement, or why nothing was simulated."""
    known = [number for number, entry in enumerate(checked.entries) if entry["failed"] is None]
    drawn = sorted(random.Random(seed).sample(known, min(count, len(known))))
    drawn = [number for number in drawn if checked.entries[number]["file"] in sound]
    plan, why = checked.plan, ""
    if count < 1:
        why = "none was asked for"
    elif plan is not None and plan.spec.withheld:
        why = "seed, truth and scored outputs behind the window are withheld; the complete data set can be checked"
    elif plan is None or len(plan) != len(checked.entries):
        why = "there is no spec to do it from"
    elif not drawn:
        why = "none of those drawn has its file"
    if why or plan is None:
        checked.notes.append(f"no experiment was simulated again: {why}")
        return
    same = same_software(folder)
    differences: list[str] = []
    try:
        for chunk in chunks(plan, drawn):
            for experiment in run_chunk(plan, chunk, threads=workers):
                if experiment.failed:
                    differences.append(f"{experiment.about['name']} cannot be simulated again: {experiment.failed}")
                differences += _differences(folder, experiment, checked, sound, same=same)
    except (ScenarioError, ValueError, OverflowError, MemoryError) as error:
        checked.problems.append(f"experiments cannot be simulated again: {error}")
        return
    if wrong := [text for text in differences if text]:
        checked.problems += wrong
        return
    software = "the same software" if same else "other software than the data set was built with"
    agreement = f"within {RELATIVE:g} of the largest magnitude, measured angles within one count"
    note = f"{len(drawn)} experiment{'s' * (len(drawn) > 1)} simulated again with {software}: "
    checked.notes.append(note + (agreement if differences else "the same bits"))


def _differences(
    folder: Path, experiment: BuiltExperiment, checked: CheckedFolder, sound: Collection[str], *, same: bool
) -> Iterator[str]:
    """Yield for each array that differs the problem; an empty one if it is within the tolerance."""
    for file, content in experiment.files.items():
        # The truth about an arm is computed, not simulated: with other versions its digits may differ.
        simulated = file.endswith(f"/{experiment.about['name']}.nc")
        if file not in checked.arrays or file not in sound or not (same or simulated):
            continue
        before, after = checked.arrays[file], experiment.arrays[file]
        if sorted(before) != sorted(after):
            yield f"{file}: arrays {sorted(before)}, simulated again {sorted(after)}"
        elif before != after:
            stored, again = _arrays(read_netcdf(folder / file)), _arrays(contents_of(content))
            differing = [name for name in after if before[name] != after[name]]
            if not simulated:
                # The kernels of the linear algebra choose the coordinates of the state, and last digits of the rest.
                differing = [name for name in differing if name.rpartition("_")[2] not in STATE_MATRICES]
                differing = [name for name in differing if not name.endswith("drive_noise")]
                stored, again = _without_coordinates(stored), _without_coordinates(again)
                differing += [name for name in again if "response" in name]
            for name in differing:
                yield _compare(f"{file}: {name}", name, stored[name], again[name], same=same and simulated)


def _arrays(contents: Contents) -> dict[str, np.ndarray]:
    return {name: variable.values for name, variable in contents.variables.items()}


def _without_coordinates(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The truth about an arm, with responses to inputs, noise and drives in the place of its state matrices."""
    known = dict(arrays)
    for prefix in [name[:-1] for name in arrays if name == "A" or name.endswith("_A")]:
        A, C = known[f"{prefix}A"], known[f"{prefix}C"]
        for name in (f"{prefix}B", f"{prefix}K", f"{prefix}drive_noise"):
            if name in known:
                columns, steps = known[name], []
                for _ in range(RESPONSE_STEPS):
                    steps.append(C @ columns)
                    columns = A @ columns
                known[f"response to {name}"] = np.array(steps)
    return known


def _compare(what: str, name: str, before: np.ndarray, after: np.ndarray, *, same: bool) -> str:
    """The problem of an array that differs; empty if it is within the tolerance."""
    if before.shape != after.shape:
        return f"{what} has shape {before.shape}, simulated again {after.shape}"
    difference = float(np.max(np.abs(before.astype(float) - after.astype(float)), initial=0.0))
    if same:
        return f"{what} differs by up to {difference:.3g} from what the same software simulates"
    limit = RELATIVE * float(np.max(np.abs(after), initial=0.0))
    # Rounding turns any difference of measured angles into a count of the resolver; a thousandth of one is for the
    # rounding of the numbers themselves.
    limit += 1.001 * RECORDER.resolver_step if name in ("y", "joint_measured") else 0.0
    # NaN is not within the limit.
    if difference <= limit:
        return ""
    return f"{what} differs by up to {difference:.3g} from what is simulated now, expected at most {limit:.3g}"
