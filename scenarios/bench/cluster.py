"""Pieces of a run done by the workers of a Dask scheduler, wherever they are."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from itertools import islice
from typing import TYPE_CHECKING, Any

from scenarios.bench.cluster_task import DONE, Parcel, task
from scenarios.bench.executor import Crew
from scenarios.bench.measurement import Measurement
from scenarios.bench.work import Bench, Done, Piece
from scenarios.datasets.batches import Batches
from scenarios.datasets.cluster import check_cluster
from scenarios.datasets.cluster_link import Link
from scenarios.jobs.bitwise_compatibility import kinship

if TYPE_CHECKING:
    from distributed import Client, Future

TOGETHER = 8
"""Pieces that travel together: the processes of estimators are started once for all of them."""

GUESS = 1
"""Workers of a cluster that has not been asked yet."""


class Cluster:
    """Does pieces on the workers of a Dask scheduler.

    What travels there are names and numbers, and the source text of an estimator's module with its hash; records are
    drawn, and the arm is simulated, by the worker. What comes back is what was measured. No folder is shared. A task
    whose worker dies is done by another one; one that brings death to worker after worker is parted into its pieces,
    and a piece that does so alone ends the run with an error that names it.

    Args:
        address: Of the scheduler, ``"tcp://host:8786"``.
        patience: How long a scheduler that has gone, or workers that are not there, are waited for, s.
        said: Told in words what is waited for.

    Attributes:
        workers: How many there were when they were last counted.

    Raises:
        ScenarioError: No address, or Dask is not installed.
    """

    def __init__(self, address: str, patience: float = 300.0, said: Callable[[str], None] = lambda _: None) -> None:
        check_cluster(address, patience)
        self._address, self._patience, self._said = address, patience, said
        self.workers = GUESS

    @property
    def here(self) -> bool:
        """They may be anywhere."""
        return False

    @contextmanager
    def crew(self, bench: Bench) -> Iterator[Crew]:
        """Hold the way to the scheduler; see `Executor`.

        Yields:
            What does pieces; it raises `ScenarioError` where no scheduler is there, or gone for too long, or no workers
            for too long; of workers on which software or an estimator is another; of a piece that brings them death.
        """
        with Link(self._address, self._patience, self._said) as link:
            yield lambda pieces: Pieces(bench, pieces, link, self._counted).done()

    def _counted(self, workers: int) -> None:
        self.workers = workers


class Pieces(Batches[Piece, Done]):
    """A run's pieces on their way.

    Args:
        bench: What the pieces share.
        pieces: The pieces.
        link: The way to the scheduler.
        counted: Told how many workers there are.
    """

    items = "records"

    def __init__(self, bench: Bench, pieces: Iterable[Piece], link: Link, counted: Callable[[int], None]) -> None:
        waiting = iter(pieces)
        super().__init__(iter(lambda: tuple(islice(waiting, TOGETHER)), ()), link, counted)
        self._parcels = [asdict(Parcel.of(contestant)) for contestant in bench.contestants]
        self._limits, self._seed = asdict(bench.limits), bench.seed

    def _submitted(self, client: "Client", batch: tuple[Piece, ...]) -> "Future":
        plain = [(piece.problem, piece.draw, [list(one) for one in piece.asked]) for piece in batch]
        return client.submit(task, self._parcels, self._limits, self._seed, plain, dict(kinship()), pure=False)

    def _read(self, answer: dict[str, Any]) -> Iterator[Done]:
        for contestant, line, wall in answer[DONE]:
            yield Done(contestant, Measurement.from_json(line), wall)

    def _name(self, item: Piece) -> str:
        return f"{item.problem}, record {item.draw}"
