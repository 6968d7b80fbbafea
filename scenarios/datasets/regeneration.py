"""Experiments of a data set, simulated again and compared with what is on disk."""

import io
import json
import random
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hmtb_twin.parameters.values import RECORDER
from scenarios.datasets.checked_index import Index
from scenarios.datasets.chunk import Made, chunks, run_chunk
from scenarios.datasets.layout import BUILD
from scenarios.datasets.plan import DataSetPlan
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf
from scenarios.files.provenance import fingerprint, versions

RELATIVE = 1e-9
"""With other versions, arrays may differ by this part of their largest magnitude."""

STEPPED = ("y", "joint_measured")
"""Measured angles may differ by one count of the resolver too: rounding turns any difference into a count."""

MATTER = ("hmtb-twin", "machine", "mujoco", "numpy", "pin", "scipy")
"""Software that the numbers depend on."""


def chosen(index: Index, count: int, seed: int) -> list[int]:
    """Places in the plan of experiments to simulate again, drawn by a seed.

    Args:
        index: The index; only experiments that have a record are drawn.
        count: How many; all where there are fewer.
        seed: Draws them.
    """
    known = [number for number, entry in enumerate(index.entries) if entry["failed"] is None]
    return sorted(random.Random(seed).sample(known, min(count, len(known))))


def same_software(folder: Path) -> bool:
    """Whether a data set was built with the software that runs now."""
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        built, now = record["versions"], versions()
        return record["source"] == fingerprint() and all(built.get(name) == now[name] for name in MATTER)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return False


def regenerated(
    folder: Path,
    plan: DataSetPlan,
    index: Index,
    numbers: Sequence[int],
    present: Sequence[str],
    *,
    workers: int | None = None,
) -> tuple[list[str], list[str]]:
    """Simulate experiments again.

    Args:
        folder: That of the data set.
        plan: Its plan.
        index: Its index.
        numbers: Places in the plan.
        present: Files of the data set whose hashes are right.
        workers: Threads for the physics.

    Returns:
        Problems, and a note of what agreed.
    """
    same = same_software(folder)
    problems: list[str] = []
    largest = 0.0
    for chunk in chunks(plan, list(numbers)):
        for made in run_chunk(plan, chunk, threads=workers):
            if made.failed:
                problems.append(f"{made.about['name']} cannot be simulated again: {made.failed}")
                continue
            for problem, difference in _differences(folder, made, index.arrays, present, same=same):
                largest = max(largest, difference)
                if problem:
                    problems.append(problem)
    if problems or not numbers:
        return problems, []
    which = f"{len(numbers)} experiment{'s' if len(numbers) > 1 else ''} simulated again"
    if same:
        return [], [f"{which} with the same software: the same bits"]
    if largest == 0.0:
        return [], [f"{which} with other software than the data set was built with: the same bits"]
    limit = f"{RELATIVE:g} of the largest magnitude, measured angles within one count of the resolver"
    return [], [f"{which} with other software than the data set was built with: within {limit}"]


def _differences(
    folder: Path, made: Made, expected: Mapping[str, Mapping[str, str]], present: Sequence[str], *, same: bool
) -> Iterator[tuple[str, float]]:
    """By array that differs: the problem, empty where it is within the tolerance, and the largest difference."""
    for file, content in made.files.items():
        # The truth about an arm is computed, not simulated: with other versions other digits are right too.
        if file not in expected or file not in present or not (same or file.endswith(_of_experiment(made))):
            continue
        wrong = [name for name, value in made.arrays[file].items() if expected[file].get(name) != value]
        if sorted(expected[file]) != sorted(made.arrays[file]):
            yield f"{file}: arrays {sorted(expected[file])}, simulated again {sorted(made.arrays[file])}", 0.0
        elif wrong:
            before, after = read_netcdf(folder / file).variables, read_netcdf(io.BytesIO(content)).variables
            for name in wrong:
                yield _compared(f"{file}: {name}", before[name].values, after[name].values, name, same=same)


def _of_experiment(made: Made) -> str:
    return f"/{made.about['name']}.nc"


def _compared(what: str, before: np.ndarray, after: np.ndarray, name: str, *, same: bool) -> tuple[str, float]:
    if before.shape != after.shape:
        return f"{what} has shape {before.shape}, simulated again {after.shape}", 0.0
    difference = float(np.max(np.abs(before.astype(float) - after.astype(float)), initial=0.0))
    if same:
        return f"{what} differs by up to {difference:.3g} from what the same software simulates", difference
    limit = RELATIVE * float(np.max(np.abs(after), initial=0.0))
    # Rounding to a count, and a thousandth of one for that of the numbers themselves.
    limit += 1.001 * RECORDER.resolver_step if name in STEPPED else 0.0
    # A difference that is no number is none within the limit.
    if difference <= limit:
        return "", difference
    return (
        f"{what} differs by up to {difference:.3g} from what is simulated now, expected at most {limit:.3g}",
        difference,
    )


def regeneration(
    folder: Path, index: Index, count: int, seed: int, present: Sequence[str], *, workers: int | None = None
) -> tuple[list[str], list[str]]:
    """Draw experiments, simulate them again and compare; say so where that cannot be done.

    Args:
        folder: That of the data set.
        index: Its index.
        count: How many experiments.
        seed: Draws them.
        present: Files of the data set whose hashes are right.
        workers: Threads for the physics.

    Returns:
        Problems and notes.
    """
    if count < 1:
        return [], ["no experiment was simulated again: none was asked for"]
    if index.spec is not None and index.spec.withheld:
        return [], [
            "no experiment was simulated again: seed, truth and scored outputs behind the window are withheld; the "
            "complete data set can be checked"
        ]
    if index.plan is None or len(index.plan) != len(index.entries):
        return [], ["no experiment was simulated again: there is no spec to do it from"]
    numbers = [n for n in chosen(index, count, seed) if index.entries[n]["file"] in present]
    if not numbers:
        return [], ["no experiment was simulated again: none of those drawn has its file"]
    try:
        return regenerated(folder, index.plan, index, numbers, present, workers=workers)
    except (ScenarioError, ValueError, OverflowError, MemoryError) as error:
        return [f"experiments cannot be simulated again: {error}"], []
