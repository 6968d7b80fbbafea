"""What a worker of a cluster does: run a chunk of a plan from the text of its spec, and give back finished bytes."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from threading import Lock
from typing import Any

from scenarios.datasets.chunk import run_chunk
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.jobs.bitwise_compatibility import kinship, strangeness
from scenarios.jobs.steady_memory import steady_memory

STRANGE = "strange"
"""Key of an answer that says why a worker did nothing; ``"worker"`` says which one."""

MADE = "made"
"""Key of an answer with what came of each experiment, the fields of `Made`."""

_ALONE = Lock()
"""Arms that are loaded are shared by the threads of a process; its chunks are run one after another."""


def task(spec: str, numbers: Sequence[int], expected: Mapping[str, str]) -> dict[str, Any]:
    """Run a chunk; called by a Dask worker.

    Args:
        spec: The spec as TOML.
        numbers: Places in its plan.
        expected: What makes the builder's bits; see `kinship`. A worker that joined late is looked at here, too.

    Returns:
        Plain types: what was made, or in what this worker differs from the builder.
    """
    from distributed import get_worker

    worker = get_worker()
    if differences := strangeness(expected, kinship()):
        return {STRANGE: differences, "worker": worker.address}
    steady_memory()
    with _ALONE:
        made = run_chunk(_plan(spec), numbers, threads=worker.state.nthreads)
        return {MADE: [dict(vars(one)) for one in made]}


@lru_cache(maxsize=1)
def _plan(spec: str) -> DataSetPlan:
    return DataSetPlan(DataSetSpec.from_toml(spec))
