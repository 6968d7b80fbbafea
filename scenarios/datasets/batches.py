"""Batches of work on their way to the workers of a Dask scheduler, and what comes of them."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from scenarios.datasets.cluster_link import Link, LostError
from scenarios.datasets.cluster_task import STRANGE
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from distributed import Client, Future

AHEAD = 2
"""Batches per worker that are on their way at a time: one that is done, one that waits beside it."""

LOOK = 2.0
"""How often it is looked whether workers and scheduler are still there, s."""

SHOWN = 3
"""Items that an error names."""

Item = TypeVar("Item")
Result = TypeVar("Result")


class Batches(ABC, Generic[Item, Result]):
    """Work that goes batch by batch to whoever is there.

    A batch whose worker dies goes to another one. One that brings death to worker after worker is parted into its
    items, so that the others are done; an item that does so alone is named when all else is done.

    Args:
        batches: Items that travel together.
        link: The way to the scheduler.
        counted: Told how many workers there are.
    """

    items: ClassVar[str]
    """What the items are called."""

    def __init__(
        self, batches: Iterator[tuple[Item, ...]], link: Link, counted: Callable[[int], None] = lambda _: None
    ) -> None:
        self._batches, self._link, self._counted = batches, link, counted
        self._again: deque[tuple[Item, ...]] = deque()
        self._running: dict[Future, tuple[Item, ...]] = {}
        self._deadly: list[str] = []
        self._news = Event()

    @abstractmethod
    def _submitted(self, client: "Client", batch: tuple[Item, ...]) -> "Future":
        """A task that does the items."""

    @abstractmethod
    def _read(self, answer: dict[str, Any]) -> Iterator[Result]:
        """What is in the answer of a task."""

    @abstractmethod
    def _name(self, item: Item) -> str:
        """What people are told of an item."""

    def done(self) -> Iterator[Result]:
        """What came of the items, as it comes.

        Yields:
            What `_read` finds in the answers.

        Raises:
            ScenarioError: No scheduler there, or gone for too long; no workers for too long; a worker whose bits would
                differ; an item that brings death to its workers.
        """
        client = self._link.connect()
        looked, workers = -LOOK, 0
        while True:
            if monotonic() - looked >= LOOK:
                client, workers = self._link.workers(client)
                self._counted(workers)
                looked = monotonic()
            while len(self._running) < AHEAD * workers and (batch := self._next()):
                future = self._submitted(client, batch)
                self._running[future] = batch
                future.add_done_callback(lambda _: self._news.set())
            if not self._running and not self._again:
                break
            self._news.wait(LOOK)
            self._news.clear()
            for future in [one for one in self._running if one.status != "pending"]:
                yield from self._received(future)
        if self._deadly:
            more = f" and {len(self._deadly) - SHOWN} more" if len(self._deadly) > SHOWN else ""
            raise ScenarioError(
                f"{'; '.join(self._deadly[:SHOWN])}{more}: every worker that did it died, alone or with others; "
                f"its memory may have been too small. All other {self.items} are kept: the same command, without "
                "--cluster or with larger workers, goes on from there"
            )

    def _next(self) -> tuple[Item, ...]:
        return self._again.popleft() if self._again else next(self._batches, ())

    def _received(self, future: "Future") -> Iterator[Result]:
        """What has come of a batch, or nothing where it has to be sent anew."""
        batch = self._running.pop(future)
        try:
            answer: dict[str, Any] | None = self._link.answer(future)
        except LostError:
            self._again.append(batch)
            return
        finally:
            future.release()
        if answer is None:
            self._part(batch)
        elif STRANGE in answer:
            raise ScenarioError(self._link.strange(answer["worker"], answer[STRANGE]))
        else:
            yield from self._read(answer)

    def _part(self, batch: tuple[Item, ...]) -> None:
        """A batch whose workers died: its items one by one."""
        first = self._name(batch[0])
        if len(batch) == 1:
            self._deadly.append(first)
            return
        self._link.said(
            f"{len(batch)} {self.items} from {first} on: every worker that did them died; they are done one by one"
        )
        self._again.extend((item,) for item in batch)
