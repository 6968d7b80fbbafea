"""A chunk of a plan: experiments that run side by side, and the files that come of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from hmtb_twin import simulate
from hmtb_twin.parameters import SAMPLE_RATE
from hmtb_twin.simulation import Progress
from scenarios.datasets.experiment_file import data_contents, signal_contents
from scenarios.datasets.netcdf import Contents
from scenarios.datasets.plan import Plan

MOST_SAMPLES = 400_000
"""Samples of a chunk's records together: what is in memory at a time."""

MOST_ROWS = 256
"""Experiments of a chunk."""


@dataclass(frozen=True)
class Made:
    """What came of an experiment.

    Attributes:
        number: Its place in the plan.
        name: Its name.
        files: Content of its files, by their place in the folder.
        arrays: Hash of each array, by file.
        failed: Why there is no record; empty where there is one.
    """

    number: int
    name: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    arrays: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    failed: str = ""


def chunks(plan: Plan, left: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Part what is left of a plan into chunks, in order.

    Args:
        plan: The plan.
        left: Places in the plan that are still to do.
    """
    chunk: list[int] = []
    samples = 0
    for number in left:
        length = round(SAMPLE_RATE * plan.duration(number))
        if chunk and (len(chunk) >= MOST_ROWS or samples + length > MOST_SAMPLES):
            yield tuple(chunk)
            chunk, samples = [], 0
        chunk.append(number)
        samples += length
    if chunk:
        yield tuple(chunk)


def run_chunk(
    plan: Plan, numbers: Sequence[int], *, threads: int | None = None, progress: Progress | None = None
) -> Iterator[Made]:
    """Run experiments of a plan side by side.

    Args:
        plan: The plan.
        numbers: Their places in it.
        threads: Threads for the physics; the bits do not depend on it, nor on what else is in the chunk.
        progress: Told of the ticks done and of those there are.

    Yields:
        What came of each, in the order of the numbers.
    """
    entries = {number: plan[number] for number in numbers}
    result = simulate([entry.experiment for entry in entries.values()], threads=threads, progress=progress)
    logs = {log.name: log for log in result.logs}
    for number, entry in entries.items():
        if entry.name not in logs:
            yield Made(number, entry.name, failed=result.failed[entry.name])
            continue
        log = logs.pop(entry.name)
        contents: dict[str, Contents] = {
            entry.data: data_contents(plan.spec, entry, log),
            entry.signals: signal_contents(plan.spec, entry, log),
        }
        yield Made(
            number,
            entry.name,
            files={path: one.to_bytes() for path, one in contents.items()},
            arrays={path: one.array_hashes() for path, one in contents.items()},
        )
