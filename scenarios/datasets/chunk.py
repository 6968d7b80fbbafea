"""Chunks of a plan: experiments that are simulated side by side, and their files."""

import ctypes
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from threading import Lock
from typing import Any

from hmtb_twin import TwinError, simulate
from hmtb_twin.files.hashes import bytes_hash
from hmtb_twin.files.netcdf import Contents
from hmtb_twin.parameters.values import SAMPLE_RATE
from hmtb_twin.run.simulation import Progress
from scenarios.datasets.arm_truth import arm_files
from scenarios.datasets.experiment_file import data_contents, signal_contents
from scenarios.datasets.plan import DataSetPlan, arm_file
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.errors import ScenarioError
from scenarios.jobs.cluster import worker_threads

MOST_SAMPLES = 400_000
"""Samples of a chunk's records together: what is in memory at a time."""

MOST_ROWS = 256
"""Experiments of a chunk in this process."""

CLUSTER_ROWS = 32
"""Experiments of a chunk for the workers of a cluster: many chunks keep many workers busy, and little is lost."""


@dataclass(frozen=True)
class BuiltExperiment:
    """Files of an experiment.

    Attributes:
        number: Index of the experiment in the plan.
        about: Facts for the index: name, part, block, arm, twin, joints, file, seed, conditions.
        files: Contents of its files, by path in the folder of the data set.
        arrays: Hash of each array, by file.
        failed: Why there is no record; empty where there is one.
        missing: Why a file of the truth could not be made, by its path.
    """

    number: int
    about: Mapping[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)
    arrays: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    failed: str = ""
    missing: Mapping[str, str] = field(default_factory=dict)

    def journal_entry(self) -> dict[str, Any]:
        """All of it, with hashes in place of the files; without reasons where there are none."""
        hashes = {path: bytes_hash(content) for path, content in self.files.items()}
        attributes = {**vars(self), "files": hashes}
        return {name: value for name, value in attributes.items() if value or name not in ("failed", "missing")}


def chunks(plan: DataSetPlan, left: Iterable[int], *, rows: int = MOST_ROWS) -> Iterator[tuple[int, ...]]:
    """Split the rest of a plan into chunks, in order.

    Args:
        plan: The plan.
        left: Indices of the experiments that are still to do.
        rows: Experiments of a chunk at most.
    """
    chunk: list[int] = []
    chunk_samples = 0
    for index in left:
        samples = round(SAMPLE_RATE * plan.duration(index))
        # A record that is longer than a chunk may be is a chunk of its own.
        if chunk and (len(chunk) >= rows or chunk_samples + samples > MOST_SAMPLES):
            yield tuple(chunk)
            chunk, chunk_samples = [], 0
        chunk.append(index)
        chunk_samples += samples
    if chunk:
        yield tuple(chunk)


def run_chunk(
    plan: DataSetPlan, numbers: Sequence[int], *, threads: int | None = None, progress: Progress | None = None
) -> Iterator[BuiltExperiment]:
    """Simulate experiments of a plan side by side.

    Args:
        plan: The plan.
        numbers: Their indices in it.
        threads: Threads for the physics; the bits do not depend on it, nor on what else is in the chunk.
        progress: Called with the ticks done and those in all.

    Yields:
        The files of each, in the order of the numbers; of one that cannot be simulated, the reason.
    """
    planned_experiments = {index: plan[index] for index in numbers}
    experiments = [planned.experiment for planned in planned_experiments.values()]
    # One that fails does not end those beside it.
    result = simulate(experiments, threads=threads, progress=progress, keep_going=True)
    failed, logs = result.failed, {log.name: log for log in result.logs}
    del result, experiments  # logs are dropped one by one, when their files are made
    for index, planned in planned_experiments.items():
        contents: dict[str, Contents] = {}
        missing: dict[str, str] = {}
        if log := logs.pop(planned.name, None):
            contents[planned.data] = data_contents(plan.spec, planned, log)
            contents[planned.signals] = signal_contents(plan.spec, planned, log)
        if plan.brings_arm(index):
            # Made here, while the arm is still loaded.
            try:
                contents |= arm_files(plan, planned)
            except (TwinError, ScenarioError) as error:
                missing[arm_file(planned.arm)] = str(error)
        yield BuiltExperiment(
            index,
            planned.facts,
            files={path: content.to_bytes() for path, content in contents.items()},
            arrays={path: content.array_hashes() for path, content in contents.items()},
            failed=failed.get(planned.name, ""),
            missing=missing,
        )


_ONE_CHUNK_AT_A_TIME = Lock()
_plan = lru_cache(maxsize=1)(lambda spec: DataSetPlan(DataSetSpec.from_toml(spec)))


def run_chunk_elsewhere(spec: str, numbers: tuple[int, ...]) -> list[BuiltExperiment]:
    """Simulate a chunk on a worker; a task of `scenarios.jobs.executor`.

    Args:
        spec: The spec as TOML.
        numbers: Indices of the experiments in its plan.
    """
    steady_memory()
    # The threads of a worker share the arms that are loaded.
    with _ONE_CHUNK_AT_A_TIME:
        return list(run_chunk(_plan(spec), numbers, threads=worker_threads()))


@cache
def steady_memory() -> bool:
    """Ask the C library for blocks of memory that go back to the system, for the rest of the process.

    glibc raises its threshold as larger blocks come free, and puts what is smaller on a heap in which the models of one
    chunk leave holes that those of the next do not fill: a fleet of 1,000 arms took half as much memory again as one of
    100. Other C libraries are left as they are.

    Returns:
        Whether it was done.
    """
    try:
        # M_MMAP_THRESHOLD, -3: blocks of 128 KiB and more, where glibc begins too, go back when they are free.
        return bool(ctypes.CDLL(None).mallopt(-3, 128 * 1024))
    except (OSError, AttributeError, TypeError):
        return False
