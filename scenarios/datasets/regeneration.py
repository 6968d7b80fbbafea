"""Simulate experiments of a data set again and compare them with its files."""

import io
import json
import random
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from hmtb_twin.parameters.values import RECORDER
from scenarios.datasets.chunk import BuiltExperiment, chunks, run_chunk
from scenarios.datasets.folder_check import CheckedFolder
from scenarios.datasets.plan import BUILD
from scenarios.files.errors import ScenarioError
from scenarios.files.netcdf import read_netcdf
from scenarios.files.provenance import fingerprint, versions

RELATIVE = 1e-9
"""With other versions, arrays may differ by this part of their largest magnitude."""


def same_software(folder: Path) -> bool:
    """Whether a data set was built with the software that runs here."""
    try:
        record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
        built, now = record["versions"], versions()
        matter = ("hmtb-twin", "machine", "mujoco", "numpy", "pin", "scipy")  # what the numbers depend on
        return record["source"] == fingerprint() and all(built.get(name) == now[name] for name in matter)
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return False


def regenerate_some(
    folder: Path, checked: CheckedFolder, count: int, seed: int, sound: Collection[str], *, workers: int | None = None
) -> tuple[list[str], str]:
    """Simulate some experiments again and compare.

    Args:
        folder: Folder of the data set.
        checked: Its files, index and spec.
        count: Number of experiments; all if there are fewer.
        seed: Draws them.
        sound: Files of the data set whose hashes are right.
        workers: Threads for the physics.

    Returns:
        Problems; without any a note on the agreement, or why nothing was simulated again.
    """
    known = [number for number, entry in enumerate(checked.entries) if entry["failed"] is None]
    drawn = sorted(random.Random(seed).sample(known, min(count, len(known))))
    drawn = [number for number in drawn if checked.entries[number]["file"] in sound]
    why = ""
    if count < 1:
        why = "none was asked for"
    elif checked.plan is not None and checked.plan.spec.withheld:
        why = "seed, truth and scored outputs behind the window are withheld; the complete data set can be checked"
    elif checked.plan is None or len(checked.plan) != len(checked.entries):
        why = "there is no spec to do it from"
    elif not drawn:
        why = "none of those drawn has its file"
    if why or checked.plan is None:
        return [], f"no experiment was simulated again: {why}"
    same = same_software(folder)
    problems: list[str] = []
    bits = True
    try:
        for chunk in chunks(checked.plan, drawn):
            for experiment in run_chunk(checked.plan, chunk, threads=workers):
                if experiment.failed:
                    problems.append(f"{experiment.about['name']} cannot be simulated again: {experiment.failed}")
                for problem in _differences(folder, experiment, checked, sound, same=same):
                    bits = False
                    problems += [problem] if problem else []
    except (ScenarioError, ValueError, OverflowError, MemoryError) as error:
        return [f"experiments cannot be simulated again: {error}"], ""
    software = "the same software" if same else "other software than the data set was built with"
    agreement = (
        "the same bits" if bits else f"within {RELATIVE:g} of the largest magnitude, measured angles within one count"
    )
    note = f"{len(drawn)} experiment{'s' * (len(drawn) > 1)} simulated again with {software}: {agreement}"
    return problems, "" if problems else note


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
            stored, again = read_netcdf(folder / file).variables, read_netcdf(io.BytesIO(content)).variables
            for name in (name for name in after if before[name] != after[name]):
                yield _compare(f"{file}: {name}", name, stored[name].values, again[name].values, same=same)


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
