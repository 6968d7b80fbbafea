"""Simulate experiments of a data set again and compare them with its files."""

import io
import json
import random
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hmtb_twin.parameters.values import RECORDER
from scenarios.datasets.chunk import BuiltExperiment, chunks, run_chunk
from scenarios.datasets.index_check import CheckedIndex
from scenarios.datasets.plan import BUILD, DataSetPlan
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf
from scenarios.files.provenance import fingerprint, versions

RELATIVE = 1e-9
"""With other versions, arrays may differ by this part of their largest magnitude."""

STEPPED = ("y", "joint_measured")
"""Measured angles may differ by one count of the resolver too: rounding turns any difference into a count."""

MATTER = ("hmtb-twin", "machine", "mujoco", "numpy", "pin", "scipy")
"""Software that the numbers depend on."""


def same_software(folder: Path) -> bool:
    """Whether a data set was built with the software that runs here."""
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        built, now = record["versions"], versions()
        return record["source"] == fingerprint() and all(built.get(name) == now[name] for name in MATTER)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return False


def regenerate_some(
    folder: Path, index: CheckedIndex, count: int, seed: int, sound: Sequence[str], *, workers: int | None = None
) -> tuple[list[str], list[str]]:
    """Simulate some experiments again and compare; a note says where that is not possible.

    Args:
        folder: Folder of the data set.
        index: Its index.
        count: Number of experiments; all if there are fewer.
        seed: Draws them.
        sound: Files of the data set whose hashes are right.
        workers: Threads for the physics.

    Returns:
        Problems and notes.
    """
    why = ""
    drawn: list[int] = []
    if count < 1:
        why = "none was asked for"
    elif index.spec is not None and index.spec.withheld:
        why = "seed, truth and scored outputs behind the window are withheld; the complete data set can be checked"
    elif index.plan is None or len(index.plan) != len(index.entries):
        why = "there is no spec to do it from"
    else:
        known = [number for number, entry in enumerate(index.entries) if entry["failed"] is None]
        drawn = sorted(random.Random(seed).sample(known, min(count, len(known))))
        drawn = [number for number in drawn if index.entries[number]["file"] in sound]
        why = "" if drawn else "none of those drawn has its file"
    if why or index.plan is None:
        return [], [f"no experiment was simulated again: {why}"]
    try:
        return _regenerate(folder, index.plan, index, drawn, sound, workers)
    except (ScenarioError, ValueError, OverflowError, MemoryError) as error:
        return [f"experiments cannot be simulated again: {error}"], []


def _regenerate(
    folder: Path,
    plan: DataSetPlan,
    index: CheckedIndex,
    numbers: Sequence[int],
    sound: Sequence[str],
    workers: int | None,
) -> tuple[list[str], list[str]]:
    same = same_software(folder)
    problems: list[str] = []
    largest = 0.0
    for chunk in chunks(plan, numbers):
        for experiment in run_chunk(plan, chunk, threads=workers):
            if experiment.failed:
                problems.append(f"{experiment.about['name']} cannot be simulated again: {experiment.failed}")
                continue
            for problem, difference in _differences(folder, experiment, index.arrays, sound, same=same):
                largest = max(largest, difference)
                if problem:
                    problems.append(problem)
    if problems:
        return problems, []
    note = f"{len(numbers)} experiment{'s' if len(numbers) > 1 else ''} simulated again"
    if same:
        return [], [f"{note} with the same software: the same bits"]
    note = f"{note} with other software than the data set was built with"
    if largest == 0.0:
        return [], [f"{note}: the same bits"]
    return [], [f"{note}: within {RELATIVE:g} of the largest magnitude, measured angles within one count"]


def _differences(
    folder: Path,
    experiment: BuiltExperiment,
    expected: Mapping[str, Mapping[str, str]],
    sound: Sequence[str],
    *,
    same: bool,
) -> Iterator[tuple[str, float]]:
    """For each array that differs the problem, empty if it is within the tolerance, and the largest difference."""
    for file, content in experiment.files.items():
        # The truth about an arm is computed, not simulated: with other versions its digits may differ.
        if file not in expected or file not in sound or not (same or file.endswith(_of_experiment(experiment))):
            continue
        wrong = [name for name, value in experiment.arrays[file].items() if expected[file].get(name) != value]
        if sorted(expected[file]) != sorted(experiment.arrays[file]):
            yield f"{file}: arrays {sorted(expected[file])}, simulated again {sorted(experiment.arrays[file])}", 0.0
        elif wrong:
            before, after = read_netcdf(folder / file).variables, read_netcdf(io.BytesIO(content)).variables
            for name in wrong:
                yield _compared(f"{file}: {name}", before[name].values, after[name].values, name, same=same)


def _of_experiment(experiment: BuiltExperiment) -> str:
    return f"/{experiment.about['name']}.nc"


def _compared(what: str, before: np.ndarray, after: np.ndarray, name: str, *, same: bool) -> tuple[str, float]:
    if before.shape != after.shape:
        return f"{what} has shape {before.shape}, simulated again {after.shape}", 0.0
    difference = float(np.max(np.abs(before.astype(float) - after.astype(float)), initial=0.0))
    if same:
        return f"{what} differs by up to {difference:.3g} from what the same software simulates", difference
    limit = RELATIVE * float(np.max(np.abs(after), initial=0.0))
    # One count, and a thousandth of one for the rounding of the numbers themselves.
    limit += 1.001 * RECORDER.resolver_step if name in STEPPED else 0.0
    # NaN is not within the limit.
    if difference <= limit:
        return "", difference
    return (
        f"{what} differs by up to {difference:.3g} from what is simulated now, expected at most {limit:.3g}",
        difference,
    )
