"""Chunks of a plan run by the workers of a Dask scheduler, wherever they are."""

import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenarios.datasets.batches import Batches
from scenarios.datasets.chunk import Made
from scenarios.datasets.cluster_link import Link, require_dask
from scenarios.datasets.cluster_task import MADE, task
from scenarios.datasets.plan import DataSetPlan
from scenarios.files.errors import ScenarioError
from scenarios.jobs.bitwise_compatibility import kinship

if TYPE_CHECKING:
    from distributed import Client, Future

ROWS = 32
"""Experiments of a chunk unless asked otherwise: many chunks keep many workers busy, and little is lost with one."""

ADDRESS = re.compile(r"(?:tcp|tls)://(?:\[[0-9A-Fa-f:.%\w]+\]|[\w.-]+):([0-9]{1,5})", re.ASCII)
"""What the address of a scheduler looks like."""

MOST_PORTS = 2**16 - 1


def check_cluster(address: str, patience: float) -> None:
    """Refuse what cannot be the way to a scheduler.

    Args:
        address: Of the scheduler.
        patience: How long it is waited for, s.

    Raises:
        ScenarioError: No address, Dask is not installed, or no time.
    """
    match = ADDRESS.fullmatch(address)
    if match is None or not 1 <= int(match[1]) <= MOST_PORTS:
        raise ScenarioError(
            f"cluster {address[:100]!r} given, expected the address of a Dask scheduler as 'dask scheduler' says it, "
            "such as tcp://127.0.0.1:8786"
        )
    require_dask()
    if not patience >= 0.0:
        raise ScenarioError(f"patience = {patience} given, expected 0 s or more")


@dataclass(frozen=True)
class Cluster:
    """Runs chunks on the workers of a Dask scheduler.

    What travels is the spec as text and the numbers of a chunk; what comes back are finished files with their hashes.
    No folder is shared. A chunk whose worker dies is run by another one. A chunk that has brought death to worker after
    worker is parted into its experiments, so that the others are made; one that does so alone is not noted as failed,
    because a larger worker, or this process, may well run it: the build ends with an error that names it.

    A worker runs a chunk at a time, its physics on all the threads that the worker has.

    Attributes:
        address: Of the scheduler, ``"tcp://host:8786"``.
        patience: How long a scheduler that has gone, or workers that are not there, are waited for, s.
        said: Told in words what is waited for.
    """

    address: str
    patience: float = 300.0
    said: Callable[[str], None] = lambda _: None

    def __post_init__(self) -> None:
        check_cluster(self.address, self.patience)

    def __call__(
        self, plan: DataSetPlan, chunks: Iterator[Sequence[int]], ticked: Callable[[int], None], /
    ) -> Iterator[Made]:
        """Run chunks; see `Executor`.

        Raises:
            ScenarioError: No scheduler there, or gone for too long; no workers for too long; workers whose bits would
                differ; an experiment that brings death to its workers. What came before is kept by the builder.
        """
        with Link(self.address, self.patience, self.said) as link:
            yield from Chunks(plan, chunks, link).done()


class Chunks(Batches[int, Made]):
    """A build's chunks on their way.

    Args:
        plan: The plan.
        chunks: Places in it, chunk by chunk.
        link: The way to the scheduler.
    """

    items = "experiments"

    def __init__(self, plan: DataSetPlan, chunks: Iterator[Sequence[int]], link: Link) -> None:
        super().__init__(map(tuple, chunks), link)
        self._spec = plan.spec.to_toml()
        self._names = lambda number: plan[number].name

    def _submitted(self, client: "Client", batch: tuple[int, ...]) -> "Future":
        return client.submit(task, self._spec, list(batch), dict(kinship()), pure=False)

    def _read(self, answer: dict[str, Any]) -> Iterator[Made]:
        made: deque[dict[str, Any]] = deque(answer.pop(MADE))
        while made:
            yield Made(**made.popleft())

    def _name(self, item: int) -> str:
        return self._names(item)
