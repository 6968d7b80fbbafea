"""Chunks of a plan run by the workers of a Dask scheduler, wherever they are."""

import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any

from scenarios.dataset_build.chunk import Made
from scenarios.dataset_build.cluster_link import Link, LostError, require_dask
from scenarios.dataset_build.cluster_task import MADE, STRANGE, task
from scenarios.dataset_build.kinship import kinship
from scenarios.datasets.plan import Plan
from scenarios.errors import ScenarioError

if TYPE_CHECKING:
    from distributed import Client, Future

ROWS = 32
"""Experiments of a chunk unless asked otherwise: many chunks keep many workers busy, and little is lost with one."""

AHEAD = 2
"""Chunks per worker that are on their way at a time: one that runs, one that waits beside it."""

LOOK = 2.0
"""How often it is looked whether workers and scheduler are still there, s."""

ADDRESS = re.compile(r"(?:tcp|tls)://(?:\[[0-9A-Fa-f:.%\w]+\]|[\w.-]+):([0-9]{1,5})", re.ASCII)
"""What the address of a scheduler looks like."""

MOST_PORTS = 2**16 - 1

SHOWN = 3
"""Experiments that an error names."""


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

    def __call__(self, plan: Plan, chunks: Iterator[Sequence[int]], ticked: Callable[[int], None], /) -> Iterator[Made]:
        """Run chunks; see `Executor`.

        Raises:
            ScenarioError: No scheduler there, or gone for too long; no workers for too long; workers whose bits would
                differ; an experiment that brings death to its workers. What came before is kept by the builder.
        """
        with Link(self.address, self.patience, self.said) as link:
            yield from Run(plan, chunks, link).made()


class Run:
    """A build's chunks on their way.

    Args:
        plan: The plan.
        chunks: Places in it, chunk by chunk.
        link: The way to the scheduler.
    """

    def __init__(self, plan: Plan, chunks: Iterator[Sequence[int]], link: Link) -> None:
        self._spec, self._label = plan.spec.to_toml(), plan.spec.label
        self._names = lambda number: plan[number].name
        self._chunks, self._link = chunks, link
        self._again: deque[tuple[int, ...]] = deque()
        self._running: dict[Future, tuple[int, ...]] = {}
        self._deadly: list[str] = []
        self._news = Event()

    def made(self) -> Iterator[Made]:
        """What came of each experiment, as it comes; see `Cluster`."""
        client = self._link.connect()
        looked = -LOOK
        workers = 0
        while True:
            if monotonic() - looked >= LOOK:
                client, workers = self._link.workers(client)
                looked = monotonic()
            while len(self._running) < AHEAD * workers and (chunk := self._next()) is not None:
                self._send(client, chunk)
            if not self._running and not self._again:
                break
            self._news.wait(LOOK)
            self._news.clear()
            for future in [one for one in self._running if one.status != "pending"]:
                yield from self._received(future)
        if self._deadly:
            more = f" and {len(self._deadly) - SHOWN} more" if len(self._deadly) > SHOWN else ""
            raise ScenarioError(
                f"{', '.join(self._deadly[:SHOWN])}{more}: every worker that ran it died, whether alone or in a chunk; "
                "its memory may have been too small. All other experiments are kept: the same command, without "
                "--cluster or with larger workers, goes on from there"
            )

    def _next(self) -> tuple[int, ...] | None:
        if self._again:
            return self._again.popleft()
        chunk = next(self._chunks, None)
        return None if chunk is None else tuple(chunk)

    def _send(self, client: "Client", chunk: tuple[int, ...]) -> None:
        future = client.submit(task, self._spec, list(chunk), dict(kinship()), pure=False)
        self._running[future] = chunk
        future.add_done_callback(lambda _: self._news.set())

    def _received(self, future: "Future") -> Iterator[Made]:
        """What has come of a chunk, or nothing where it has to be sent anew."""
        chunk = self._running.pop(future)
        try:
            answer = self._link.answer(future)
        except LostError:
            self._again.append(chunk)
            return
        finally:
            future.release()
        if answer is None:
            self._part(chunk)
            return
        if STRANGE in answer:
            raise ScenarioError(self._link.strange(answer["worker"], answer[STRANGE]))
        made: deque[dict[str, Any]] = deque(answer.pop(MADE))
        while made:
            yield Made(**made.popleft())

    def _part(self, chunk: tuple[int, ...]) -> None:
        """A chunk whose workers died: its experiments one by one."""
        if len(chunk) == 1:
            self._deadly.append(self._names(chunk[0]))
            return
        self._link.said(
            f"{len(chunk)} experiments from {self._names(chunk[0])} on: every worker that ran them died; they are run "
            "one by one"
        )
        self._again.extend((number,) for number in chunk)
