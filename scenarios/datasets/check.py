"""Check a data set: its files, hashes and metadata, and some of its experiments by simulating them again."""

import os
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.data_set import GIVEN, WINDOW
from scenarios.datasets.experiment_file import FORMAT
from scenarios.datasets.folder_check import FolderFiles, folder_files
from scenarios.datasets.index_check import CheckedIndex, check_index
from scenarios.datasets.plan import DATA, LICENSE, SUMS, TRUTH, UNFINISHED
from scenarios.datasets.regeneration import regenerate_some
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.files.hashes import file_hash
from scenarios.files.netcdf_reader import NetcdfReader
from scenarios.jobs.progress import Progress, Report

REGENERATED = 3
"""Experiments that are simulated again."""

MOST_READERS = 8
"""Processes that read files side by side."""

FILES_PER_READER = 50
"""With fewer files for each, another process would cost more than it saves."""

LONGEST = 600
"""Characters of a problem."""

SIGNALS = {"u": ("input", "sample", "input"), "y": ("output", "sample", "output")}
"""Role and dimensions of inputs and outputs."""


@dataclass(frozen=True)
class DataSetCheck:
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
    regenerate: int = REGENERATED,
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
        files = folder_files(folder)
        index = check_index(folder, files)
        problems, sound = _file_problems(folder, files, index, progress or (lambda _: None), workers)
    except OSError as error:
        raise ScenarioError(f"cannot read {error.filename or folder}: {error.strerror or error}") from error
    differences, notes = regenerate_some(folder, index, regenerate, seed, sound, workers=workers)
    truth = [p for p in index.arrays if p.startswith(f"{TRUTH}/") and p not in files.sums and p not in files.sizes]
    if truth:
        index.notes.append(f"the truth in {len(truth)} files is not in this copy and was not checked")
    records = sum(entry["failed"] is None for entry in index.entries)
    if index.entries:
        index.notes.append(f"{records} of {len(index.entries)} experiments have a record")
    if not records and not index.problems:
        index.problems.append("no experiment has a record")
    absent = [p for p in index.arrays if p not in files.sums and p not in truth]
    unknown = [p for p in files.sums if p.startswith(f"{DATA}/") and p not in index.arrays] if index.entries else []
    lines = (
        *files.problems,
        *index.problems,
        *(f"{path} has array hashes, but no checksum" for path in absent),
        *(f"{path} belongs to no experiment" for path in unknown),
        *problems,
        *differences,
    )
    return DataSetCheck(tuple(map(_plain, lines)), tuple(map(_plain, (*index.notes, *notes))))


def _plain(text: str) -> str:
    """A line without characters that steer a terminal, whatever a file contains."""
    line = text if text.isprintable() else text.encode("unicode_escape").decode()
    return line if len(line) <= LONGEST else f"{line[:LONGEST]} ..."


def _file_problems(
    folder: Path, files: FolderFiles, index: CheckedIndex, report: Report, workers: int | None
) -> tuple[list[str], list[str]]:
    """Problems of the files that are there, and the files without any."""
    problems: list[str] = []
    sound: list[str] = []
    numbers = {entry["file"]: number for number, entry in enumerate(index.entries)}
    paths = [path for path in files.sums if path in files.sizes]
    readers = max(1, min(workers or os.cpu_count() or 1, MOST_READERS, len(paths) // FILES_PER_READER))
    idle: SimpleQueue[NetcdfReader] = SimpleQueue()

    def check_file(path: str) -> list[str]:
        changed = file_hash(folder / path) != files.sums[path]
        wrong = [f"its hash is not that of {SUMS}"] if changed else []
        if path in index.arrays:
            reader = idle.get()
            try:
                wrong += _array_problems(folder, path, index, numbers.get(path), reader, changed=changed)
            finally:
                idle.put(reader)
        return wrong

    with ExitStack() as stack:
        for _ in range(readers):
            idle.put(stack.enter_context(NetcdfReader()))
        threads = stack.enter_context(ThreadPoolExecutor(readers))
        # An interrupted check does not wait for the files that are left.
        stack.callback(threads.shutdown, cancel_futures=True)
        for done, (path, wrong) in enumerate(zip(paths, threads.map(check_file, paths), strict=True), start=1):
            problems += [f"{path}: {problem}" for problem in wrong]
            if not wrong:
                sound.append(path)
            report(Progress("check", done, len(paths), "files"))
    return problems, sound


def _array_problems(
    folder: Path, path: str, index: CheckedIndex, number: int | None, reader: NetcdfReader, *, changed: bool
) -> list[str]:
    try:
        content = reader.describe(folder / path)
    except ScenarioError as error:
        return [f"cannot be read: {str(error).removeprefix(str(folder / path)).lstrip(': ')}"]
    expected = index.arrays[path]
    names = sorted({*expected, *content["arrays"]})
    differ = [name for name in names if expected.get(name) != content["arrays"].get(name)]
    problems = []
    if differ:
        several = len(differ) > 1
        problems.append(f"array{'s' * several} {', '.join(differ)} differ{'' if several else 's'} from the index")
    elif changed:
        problems.append("its arrays are those of the index: the file was written anew, or only its description changed")
    if number is not None:
        samples = None if index.plan is None else round(SAMPLE_RATE * index.plan.duration(number))
        problems += record_problems(content, index.entries[number], index.spec, samples)
    return problems


def record_problems(
    content: Mapping[str, Any], entry: Mapping[str, Any], spec: DataSetSpec | None, samples: int | None
) -> Iterator[str]:
    """Check the metadata of a record against index and spec.

    Args:
        content: Description of its file; see `scenarios.files.netcdf_reader.describe`.
        entry: Its entry in the index.
        spec: The spec; None if it is not in this copy.
        samples: Its length by the spec; None likewise.

    Yields:
        One line for each problem.
    """
    attributes, variables = content["attributes"], content["variables"]
    expected = {
        "format": FORMAT,
        "experiment": entry["name"],
        "part": entry.get("part"),
        "arm": entry.get("arm"),
        "sampling_time_numerator": 1,
        "sampling_time_denominator": SAMPLE_RATE,
        "sampling_time_unit": "s",
        "intersample": "zoh",
        "license": LICENSE,
        **({} if entry.get("seed") is None else {"seed": entry["seed"]}),
        **({} if spec is None else {"data_set": spec.label, "initialisation_window": spec.window}),
    }
    for key, value in expected.items():
        if attributes.get(key) != value:
            yield f"attribute {key} is {attributes.get(key)!r}, expected {value!r}"
    sample = variables.get("sample", {"counts": False, "shape": [0], "dtype": "none"})
    if not sample["counts"] or sample["dtype"] != "int64":
        yield "sample does not count 0, 1, 2, ... in whole numbers"
    if samples is not None and sample["shape"] != [samples]:
        yield f"sample has shape {sample['shape']}, expected {samples} samples"
    withheld = spec is not None and spec.withheld and entry.get("part") == "test"
    if spec is not None and withheld:
        yield from _withholding_problems(variables, spec.window)
    for name, (role, *dims) in SIGNALS.items():
        along = [WINDOW, *dims[1:]] if withheld and name == "y" else dims
        yield from _signal_problems(name, role, along, variables)
        if role in variables and variables[role]["names"] != entry.get("joints"):
            yield f"{role} names {variables[role]['names']}, expected {entry.get('joints')}"
    for name, variable in variables.items():
        if variable["attributes"].get("role") == "truth":
            yield f"{name} is truth, which belongs into files of its own"
        if variable["dtype"] != "text" and not variable["attributes"].get("units"):
            yield f"{name} has no unit"


def _withholding_problems(variables: Mapping[str, Any], window: int) -> Iterator[str]:
    """Variables of a scored record that should be withheld."""
    for name, variable in variables.items():
        if "sample" in variable["dims"] and name not in GIVEN:
            yield f"{name} is given for all samples, and should be withheld behind the window"
        if WINDOW in variable["dims"] and variable["shape"][0] != window:
            yield f"{name} has {variable['shape'][0]} samples of the window, expected {window}"


def _signal_problems(name: str, role: str, dims: list[str], variables: Mapping[str, Any]) -> Iterator[str]:
    if name not in variables or role not in variables:
        yield f"{name} or the names of its channels, {role}, are missing"
        return
    variable = variables[name]
    if variable["dims"] != dims or variable["dtype"] != "float64":
        yield f"{name} is {variable['dtype']} along {variable['dims']}, expected float64 along {dims}"
    attributes = {key: variable["attributes"].get(key) for key in ("units", "role")}
    if attributes != {"units": "rad", "role": role}:
        yield f"{name} has units and role {attributes}, expected rad and {role}"
