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

STATE_MATRICES = ("A", "B", "C", "K")
"""Matrices of the truth in coordinates of the state, whose responses are compared instead."""

RESPONSE_STEPS = 100
"""Samples of each response that is compared."""


class DataSetCheck(NamedTuple):
    """Result of checking a data set.

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
        _compare_index_and_checksums(checked)
        problems_of_file = _file_problems(folder, checked, progress or (lambda _: None), workers)
    except OSError as error:
        raise ScenarioError(f"cannot read {error.filename or folder}: {error.strerror or error}") from error
    for path, file_problem_lines in problems_of_file.items():
        checked.problems += [f"{path}: {problem}" for problem in file_problem_lines]
    sound_files = {path for path, file_problem_lines in problems_of_file.items() if not file_problem_lines}
    _regenerate(folder, checked, regenerate, seed, sound_files, workers)
    return DataSetCheck(tuple(map(_printable_line, checked.problems)), tuple(map(_printable_line, checked.notes)))


def _compare_index_and_checksums(checked: CheckedFolder) -> None:
    """Note how many experiments have a record and which truth is missing; report files that index or checksums lack."""
    problems, notes, arrays, sums = checked.problems, checked.notes, checked.arrays, checked.sums
    listed_or_there = {*sums, *checked.sizes}
    # Classes and small downloads have copies without the truth.
    absent_truth = [path for path in arrays if path.startswith(f"{TRUTH}/") and path not in listed_or_there]
    if absent_truth:
        notes.append(f"the truth in {len(absent_truth)} files is not in this copy and was not checked")
    records = sum(experiment["failed"] is None for experiment in checked.entries)
    if not records and not problems:
        problems.append("no experiment has a record")
    if checked.entries:
        notes.append(f"{records} of {len(checked.entries)} experiments have a record")
        without_checksum = [path for path in arrays if path not in sums and path not in absent_truth]
        problems += [f"{path} has array hashes, but no checksum" for path in without_checksum]
        without_experiment = [path for path in sums if path.startswith(f"{DATA}/") and path not in arrays]
        problems += [f"{path} belongs to no experiment" for path in without_experiment]


def _printable_line(message: str) -> str:
    """Message as one printable line of at most 600 characters: names in a file must not control the terminal."""
    line = message if message.isprintable() else message.encode("unicode_escape").decode()
    return line if len(line) <= 600 else f"{line[:600]} ..."


def _file_problems(folder: Path, checked: CheckedFolder, report: Report, workers: int | None) -> dict[str, list[str]]:
    """Problems of each file that is there, by its path."""
    paths = [path for path in checked.sums if path in checked.sizes]
    # Each thread reads in a process of its own, which pays from about fifty files on, and up to eight.
    readers = max(1, min(workers or os.cpu_count() or 1, 8, len(paths) // 50))
    indices = {experiment["file"]: index for index, experiment in enumerate(checked.entries)}

    def check_file(path: str) -> list[str]:
        expected_record = _expected_record(checked, indices[path]) if path in indices else None
        return _problems_of_file(folder, path, checked, expected_record)

    problems: dict[str, list[str]] = {}
    with ExitStack() as stack:
        threads = stack.enter_context(ThreadPoolExecutor(readers))
        # An interrupted check does not wait for the files that are left.
        stack.callback(threads.shutdown, cancel_futures=True)
        for path, found_problems in zip(paths, threads.map(check_file, paths), strict=True):
            problems[path] = found_problems
            report(Progress("check", len(problems), len(paths), "files"))
    return problems


def _problems_of_file(
    folder: Path, path: str, checked: CheckedFolder, expected_record: tuple[Any, ...] | None
) -> list[str]:
    """Compare a file with its checksum and, if it has arrays, with their hashes and the metadata of its record."""
    changed = file_hash(folder / path) != checked.sums[path]
    problems = [f"its hash is not that of {SUMS}"] if changed else []
    if path not in checked.arrays:
        return problems
    try:
        problems += file_problems(folder / path, checked.arrays[path], changed, expected_record)
    except DAMAGE as error:
        reason = str(error) if isinstance(error, TwinError) else repr(error)[:200]
        # The path stands before the line already.
        problems.append(f"cannot be read: {reason.removeprefix(str(folder / path)).lstrip(': ')}")
    return problems


def _expected_record(checked: CheckedFolder, index: int) -> tuple[Any, ...]:
    """What index and spec say of the record of an experiment, as `record_problems` takes it."""
    listed, plan = checked.entries[index], checked.plan
    if plan is None:
        return record_attributes(None, listed), listed.get("joints"), None, None
    samples = round(SAMPLE_RATE * plan.duration(index))
    withheld_behind = plan.spec.window if plan.spec.withheld and listed["part"] == "test" else None
    return record_attributes(plan.spec, listed), listed.get("joints"), samples, withheld_behind


def same_software(folder: Path) -> bool:
    """Whether a data set was built with the software that runs here."""
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        built_with, running = record["versions"], versions()
        relevant = ("hmtb-twin", "machine", "mujoco", "numpy", "pin", "scipy")  # what the numbers depend on
        return record["source"] == fingerprint() and all(built_with.get(name) == running[name] for name in relevant)
    except DAMAGE:
        return False


def _regenerate(
    folder: Path, checked: CheckedFolder, count: int, seed: int, sound: Collection[str], workers: int | None
) -> None:
    """Simulate some experiments again; note the problems, or the agreement, or why nothing was simulated."""
    recorded = [index for index, experiment in enumerate(checked.entries) if experiment["failed"] is None]
    drawn = sorted(random.Random(seed).sample(recorded, min(count, len(recorded))))
    # Drawn from all and then reduced, so that a damaged file does not change what else is drawn.
    drawn = [index for index in drawn if checked.entries[index]["file"] in sound]
    plan = checked.plan
    reason = _why_not_simulated(count, checked, drawn)
    if reason or plan is None:
        checked.notes.append(f"no experiment was simulated again: {reason}")
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
    # An array that differs within the tolerance is an empty difference.
    if beyond_tolerance := [difference for difference in differences if difference]:
        checked.problems += beyond_tolerance
        return
    software = "the same software" if same else "other software than the data set was built with"
    agreement = "the same bits"
    if differences:
        agreement = f"within {RELATIVE:g} of the largest magnitude, measured angles within one count"
    plural = "s" * (len(drawn) > 1)
    checked.notes.append(f"{len(drawn)} experiment{plural} simulated again with {software}: {agreement}")


def _why_not_simulated(count: int, checked: CheckedFolder, drawn: Collection[int]) -> str:
    """Why no experiment can be simulated again; empty where there is no reason."""
    plan = checked.plan
    if count < 1:
        return "none was asked for"
    if plan is not None and plan.spec.withheld:
        return "seed, truth and scored outputs behind the window are withheld; the complete data set can be checked"
    if plan is None or len(plan) != len(checked.entries):
        return "there is no spec to do it from"
    if not drawn:
        return "none of those drawn has its file"
    return ""


def _differences(
    folder: Path, experiment: BuiltExperiment, checked: CheckedFolder, sound: Collection[str], *, same: bool
) -> Iterator[str]:
    """Yield the problem of each array that differs; an empty text if it is within the tolerance."""
    for file, content in experiment.files.items():
        # The truth about an arm is computed, not simulated: with other versions its digits may differ.
        is_simulated = file.endswith(f"/{experiment.about['name']}.nc")
        if file not in checked.arrays or file not in sound or not (same or is_simulated):
            continue
        hashes_before, hashes_after = checked.arrays[file], experiment.arrays[file]
        if sorted(hashes_before) != sorted(hashes_after):
            yield f"{file}: arrays {sorted(hashes_before)}, simulated again {sorted(hashes_after)}"
            continue
        if hashes_before == hashes_after:
            continue
        stored, again = _arrays(read_netcdf(folder / file)), _arrays(contents_of(content))
        differing = [name for name in hashes_after if hashes_before[name] != hashes_after[name]]
        if not is_simulated:
            # The kernels of the linear algebra choose the coordinates of the state, and last digits of the rest.
            differing = [name for name in differing if not _depends_on_coordinates(name)]
            stored, again = _with_responses(stored), _with_responses(again)
            differing += [name for name in again if "response" in name]
        for name in differing:
            yield _compare(f"{file}: {name}", name, stored[name], again[name], same=same and is_simulated)


def _arrays(contents: Contents) -> dict[str, np.ndarray]:
    return {name: variable.values for name, variable in contents.variables.items()}


def _depends_on_coordinates(name: str) -> bool:
    """Whether an array of the truth about an arm is in coordinates of the state."""
    return name.rpartition("_")[2] in STATE_MATRICES or name.endswith("drive_noise")


def _with_responses(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Add the responses C A^k M, which no choice of state coordinates changes, to the matrices of an arm's truth.

    k = 0 ... `RESPONSE_STEPS` - 1, and M is B, K or the matrix by which the noise of the drives enters.
    """
    with_responses = dict(arrays)
    for prefix in [name[:-1] for name in arrays if name == "A" or name.endswith("_A")]:
        A, C = arrays[f"{prefix}A"], arrays[f"{prefix}C"]
        for name in (f"{prefix}B", f"{prefix}K", f"{prefix}drive_noise"):
            if name not in arrays:
                continue
            columns, response = arrays[name], []
            for _ in range(RESPONSE_STEPS):
                response.append(C @ columns)
                columns = A @ columns
            with_responses[f"response to {name}"] = np.array(response)
    return with_responses


def _compare(label: str, name: str, before: np.ndarray, after: np.ndarray, *, same: bool) -> str:
    """The problem of an array that differs; empty if other software built it and it is within the tolerance."""
    if before.shape != after.shape:
        return f"{label} has shape {before.shape}, simulated again {after.shape}"
    difference = float(np.max(np.abs(before.astype(float) - after.astype(float)), initial=0.0))
    if same:
        return f"{label} differs by up to {difference:.3g} from what the same software simulates"
    limit = RELATIVE * float(np.max(np.abs(after), initial=0.0))
    if name in ("y", "joint_measured"):
        # Rounding turns any difference of measured angles into a count of the resolver; a thousandth of one is for the
        # rounding of the numbers themselves.
        limit += 1.001 * RECORDER.resolver_step
    # NaN is not within the limit.
    if difference <= limit:
        return ""
    return f"{label} differs by up to {difference:.3g} from what is simulated now, expected at most {limit:.3g}"
