"""Run batches of items on workers: the scheme that all executors share, and processes of this machine."""

import atexit
import os
import signal
import sys
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from multiprocessing import connection, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from threading import Lock, Thread
from time import sleep
from types import FrameType, ModuleType
from typing import Any, Generic, TypeVar

from scenarios.files.errors import LISTED, ScenarioError

MOST_WORKERS = 1024
"""Most processes of this machine: more would be a slip of the hand."""

RESUME = "progress is saved: run the command again to resume"
"""End of errors after which nothing is lost."""

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Numerical libraries read their number of threads here: one, where every processor has a worker of its own."""

Item = TypeVar("Item")
Result = TypeVar("Result")
Handle = TypeVar("Handle")


class LostError(Exception):
    """The results of a batch will not come, through no fault of its own: it is submitted again."""


class DeadWorkerError(Exception):
    """A worker died while it ran a batch."""


class Executor(AbstractContextManager["Executor[Handle]"], Generic[Handle]):
    """Runs batches of items on workers; a context manager that keeps workers from one `run` to the next.

    A batch whose worker dies is split into its items, so that the others are done. An item whose worker dies runs once
    more when everything else is done, alone; if it kills that worker too, an error names it.

    Attributes:
        workers: How many batches run at a time, as far as it is known.
        local: Whether workers share the files of this machine.
    """

    workers: int = 1
    local: bool = True

    def __init__(self, report: Callable[[str], None] = lambda _: None) -> None:
        self._report = report

    def __exit__(self, *_: object) -> None:
        self._close()

    def run(
        self,
        task: Callable[[Any, tuple[Item, ...]], Iterable[Result]],
        shared: Any,
        batches: Iterable[tuple[Item, ...]],
        *,
        name: Callable[[Item], str] = str,
        items: str = "items",
    ) -> Iterator[Result]:
        """Run all batches.

        Args:
            task: A function of a module, called by workers with `shared` and a batch; it returns the results.
            shared: What all batches need; it travels with each.
            batches: Taken one by one as workers become free.
            name: What to call an item in messages.
            items: What to call several.

        Yields:
            Results as they come, in any order.

        Raises:
            ScenarioError: Items killed their workers, or workers cannot be reached, or would give other bits.
        """
        fresh, again, suspects = iter(batches), deque[tuple[Item, ...]](), deque[tuple[Item, ...]]()
        running: dict[Handle, tuple[Item, ...]] = {}
        fatal: list[str] = []
        alone = False
        while True:
            room = self._room()
            while len(running) < room:
                # Those of dead workers first: their results are the oldest that are missing.
                batch = again.popleft() if again else next(fresh, ())
                if not batch:
                    break
                running[self._submit(task, shared, batch)] = batch
            if not running:
                if not suspects:
                    break
                # Alone with its worker: one that waited beside another item may have died of that.
                alone = True
                batch = suspects.popleft()
                running[self._submit(task, shared, batch)] = batch
            for handle in self._finished(running):
                batch = running.pop(handle)
                try:
                    results = self._results(handle)
                except LostError:
                    queue = suspects if alone else again
                    queue.append(batch)
                except DeadWorkerError:
                    if alone:
                        fatal.append(name(batch[0]))
                    elif len(batch) == 1:
                        suspects.append(batch)
                    else:
                        self._report(
                            f"{len(batch)} {items} from {name(batch[0])} on killed their workers; they run one by one"
                        )
                        again.extend((item,) for item in batch)
                else:
                    yield from results
        if fatal:
            unlisted = f" and {len(fatal) - LISTED} more" if len(fatal) > LISTED else ""
            raise ScenarioError(
                f"{', '.join(fatal[:LISTED])}{unlisted}: every worker that ran it died; its memory may be too small. "
                f"All other {items} are done and {RESUME}, with fewer or larger workers"
            )

    @abstractmethod
    def _room(self) -> int:
        """How many batches may be with the workers at a time; at least one."""

    @abstractmethod
    def _submit(self, task: Callable[..., Any], shared: Any, batch: tuple[Any, ...]) -> Handle:
        """Give a batch to a worker."""

    @abstractmethod
    def _finished(self, running: Collection[Handle]) -> Collection[Handle]:
        """Wait for a while, and return which batches are done."""

    @abstractmethod
    def _results(self, handle: Handle) -> Iterable[Any]:
        """Return the results of a batch that is done; raises `LostError` or `DeadWorkerError` where there are none."""

    @abstractmethod
    def _close(self) -> None:
        """End the workers."""


class LocalProcesses(Executor[Future[list[Any]]]):
    """Runs batches in processes of this machine.

    Args:
        workers: Number of processes; all processors that this one may use by default.

    Raises:
        ScenarioError: Less than one worker, or too many.
    """

    def __init__(self, workers: int | None = None, report: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(report)
        self.workers = len(os.sched_getaffinity(0)) if workers is None else workers
        if not 1 <= self.workers <= MOST_WORKERS:
            raise ScenarioError(f"workers must be 1 to {MOST_WORKERS}, given {workers}")
        # A pool of one process each: when a process dies, it is known which batch it ran.
        self._idle: list[ProcessPoolExecutor] = []
        self._busy: dict[Future[list[Any]], ProcessPoolExecutor] = {}

    def _room(self) -> int:
        return self.workers

    def _submit(self, task: Callable[..., Any], shared: Any, batch: tuple[Any, ...]) -> Future[list[Any]]:
        while True:
            pool = self._idle.pop() if self._idle else one_process()
            with suppress(BrokenProcessPool), _one_thread():  # of one that died since, nothing is lost
                future = pool.submit(_run_task, task, shared, batch)
                self._busy[future] = pool
                return future

    def _finished(self, running: Collection[Future[list[Any]]]) -> Collection[Future[list[Any]]]:
        return wait(running, return_when=FIRST_COMPLETED).done

    def _results(self, handle: Future[list[Any]]) -> list[Any]:
        pool = self._busy.pop(handle)
        if isinstance(handle.exception(), BrokenProcessPool):
            pool.shutdown()
            raise DeadWorkerError
        self._idle.append(pool)
        return handle.result()

    def _close(self) -> None:
        # Python 3.14 has terminate_workers() for this.
        busy: list[BaseProcess] = []
        for pool in self._busy.values():
            busy += (pool._processes or {}).values()
        for process in busy:
            process.terminate()
        for process in busy:
            process.join(10.0)  # s, for closing what it has opened
            if process.is_alive():
                process.kill()
        for pool in (*self._busy.values(), *self._idle):
            pool.shutdown()
        self._busy.clear()
        self._idle.clear()


def at_worker_exit(close: Callable[[], object]) -> None:
    """Call a function when this process ends, also by SIGTERM or with its parent: to close what batches share."""
    atexit.register(close)
    _CLOSERS.callback(close)


_CLOSERS = ExitStack()
"""Closed at SIGTERM, which skips Python's own functions at exit."""


def _run_task(task: Callable[..., Any], shared: Any, batch: tuple[Any, ...]) -> list[Any]:
    return list(task(shared, batch))


class WorkerProcess(SpawnProcess):
    """A spawned process that does not run the user's script again.

    Spawned processes import the script that runs, under another name. A script without ``if __name__ == "__main__":``
    would start the same work in each of them.
    """

    def start(self) -> None:
        """Start it."""
        with _STARTING:
            # While it starts, the process believes that an empty module is the script.
            script, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
            try:
                super().start()
            finally:
                sys.modules["__main__"] = script


class WorkerContext(SpawnContext):
    """Context of such processes."""

    Process = WorkerProcess


# Of two starts at once, the second would take the empty module of the first for the user's script.
_STARTING = Lock()


def one_process() -> ProcessPoolExecutor:
    """Pool of one process, which ends by SIGTERM or with its parent, not by Ctrl-C, and closes what batches share."""
    return ProcessPoolExecutor(1, mp_context=WorkerContext(), initializer=_prepare_worker)


def _prepare_worker() -> None:
    # Ctrl-C goes to all processes at a terminal: the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    Thread(target=_leave_with_parent, daemon=True).start()


def _leave(signal_number: int, frame: FrameType | None) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with suppress(Exception):
        _CLOSERS.close()
    os._exit(128 + signal_number)  # an exception would become the result of the batch


def _leave_with_parent() -> None:
    """End this process with its parent, however that ends: a pool's worker would wait for batches for ever."""
    parent = parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
    # A library that computes for long lets no signal through.
    sleep(4.0)
    os._exit(1)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Start processes whose linear algebra uses one thread.

    They inherit the environment; numerical libraries read it when they are loaded, so that setting it later is in vain.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
