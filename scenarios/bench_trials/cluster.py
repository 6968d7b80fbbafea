"""Pieces of a run done by the workers of a Dask scheduler, wherever they are."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from itertools import islice
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any

from scenarios.bench_trials.cluster_task import DONE, STRANGE, Parcel, task
from scenarios.bench_trials.executor import Crew
from scenarios.bench_trials.measured import Measured
from scenarios.bench_trials.work import Bench, Done, Piece
from scenarios.dataset_build.cluster import check_cluster
from scenarios.dataset_build.cluster_link import Link, LostError
from scenarios.dataset_build.kinship import kinship
from scenarios.errors import ScenarioError

if TYPE_CHECKING:
    from distributed import Client, Future

TOGETHER = 8
"""Pieces that travel together: the processes of estimators are started once for all of them."""

AHEAD = 2
"""Tasks per worker that are on their way at a time: one that runs, one that waits beside it."""

LOOK = 2.0
"""How often it is looked whether workers and scheduler are still there, s."""

SHOWN = 3
"""Records that an error names."""

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
            yield lambda pieces: Run(bench, pieces, link, self._counted).done()

    def _counted(self, workers: int) -> None:
        self.workers = workers


class Run:
    """Tasks on their way.

    Args:
        bench: What the pieces share.
        pieces: The pieces.
        link: The way to the scheduler.
        counted: Told how many workers there are.
    """

    def __init__(self, bench: Bench, pieces: Iterable[Piece], link: Link, counted: Callable[[int], None]) -> None:
        self._parcels = [asdict(Parcel.of(contestant)) for contestant in bench.contestants]
        self._limits, self._seed = asdict(bench.limits), bench.seed
        self._pieces, self._link, self._counted = iter(pieces), link, counted
        self._again: deque[tuple[Piece, ...]] = deque()
        self._running: dict[Future, tuple[Piece, ...]] = {}
        self._deadly: list[str] = []
        self._news = Event()

    def done(self) -> Iterator[Done]:
        """What was measured, as it comes."""
        client = self._link.connect()
        looked, workers = -LOOK, 0
        while True:
            if monotonic() - looked >= LOOK:
                client, workers = self._link.workers(client)
                self._counted(workers)
                looked = monotonic()
            while len(self._running) < AHEAD * workers and (some := self._next()):
                self._send(client, some)
            if not self._running and not self._again:
                break
            self._news.wait(LOOK)
            self._news.clear()
            for future in [one for one in self._running if one.status != "pending"]:
                yield from self._received(future)
        if self._deadly:
            more = f" and {len(self._deadly) - SHOWN} more" if len(self._deadly) > SHOWN else ""
            raise ScenarioError(
                f"{'; '.join(self._deadly[:SHOWN])}{more}: every worker that did it died; its memory may have been too "
                "small. All else is kept: the same command, without --cluster or with larger workers, goes on from "
                "there"
            )

    def _next(self) -> tuple[Piece, ...]:
        return self._again.popleft() if self._again else tuple(islice(self._pieces, TOGETHER))

    def _send(self, client: "Client", some: tuple[Piece, ...]) -> None:
        plain = [(piece.problem, piece.draw, [list(one) for one in piece.asked]) for piece in some]
        future = client.submit(task, self._parcels, self._limits, self._seed, plain, dict(kinship()), pure=False)
        self._running[future] = some
        future.add_done_callback(lambda _: self._news.set())

    def _received(self, future: "Future") -> Iterator[Done]:
        """What has come of a task, or nothing where it has to be sent anew."""
        some = self._running.pop(future)
        try:
            answer: dict[str, Any] | None = self._link.answer(future)
        except LostError:
            self._again.append(some)
            return
        finally:
            future.release()
        if answer is None:
            self._part(some)
            return
        if STRANGE in answer:
            raise ScenarioError(self._link.strange(answer["worker"], answer[STRANGE]))
        for contestant, line, wall in answer[DONE]:
            yield Done(contestant, Measured.from_json(line), wall)

    def _part(self, some: tuple[Piece, ...]) -> None:
        """A task whose workers died: its pieces one by one."""
        first = f"{some[0].problem}, record {some[0].draw}"
        if len(some) == 1:
            self._deadly.append(first)
            return
        self._link.said(f"{len(some)} records from {first} on: every worker died; they are done one by one")
        self._again.extend((piece,) for piece in some)
