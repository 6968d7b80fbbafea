"""Long work beside the page: in a process of its own, so that the arm keeps moving and work can be stopped."""

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from os import _exit, getpid
from time import perf_counter
from typing import Any

import psutil

from scenarios.files.errors import ScenarioError


class Work:
    """One computation at a time in a child process, which stays for the next one.

    Attributes:
        label: What is computed now; empty when nothing is.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._started, self._closed = 0.0, False
        self.label = ""
        self._waiting: dict[str, Callable[[], None]] = {}
        self._open()

    def _open(self) -> None:
        # A child that is spawned shares no thread and no lock with the page.
        spawn = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(max_workers=1, mp_context=spawn, initializer=_end_with_the_page)
        # Ctrl-C in a terminal reaches the child too; it is for the page to end it.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            self._child: Future[int] = self._pool.submit(getpid)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    @property
    def elapsed(self) -> float:
        """Time since the computation began, s."""
        return perf_counter() - self._started if self.label else 0.0

    def start(
        self,
        label: str,
        function: Callable[..., Any],
        *arguments: Any,
        done: Callable[[Any], None],
        failed: Callable[[str], None],
    ) -> None:
        """Compute in the child; returns at once.

        Args:
            label: What is computed, for the page.
            function: Function of a module, not of a class or another function.
            arguments: Its arguments, which can be pickled.
            done: Called with the result.
            failed: Called with one line if it raises, is stopped, or its process dies.

        Raises:
            ScenarioError: Something is being computed.
        """
        with self._lock:
            if self.label:
                raise ScenarioError(f"{self.label} is being computed; wait for it, or stop it first")
            self.label, self._started = label, perf_counter()
            try:
                future = self._pool.submit(function, *arguments)
            except BrokenProcessPool:  # the child died between two computations
                self._open()
                future = self._pool.submit(function, *arguments)

        def finished(future: "Future[Any]") -> None:
            error = future.exception()
            # The page has gone: there is nobody to tell.
            if self._closed:
                return
            with self._lock:
                self.label = ""
            # A pool whose process has died takes no more work.
            if isinstance(error, BrokenProcessPool):
                self._open()
                failed(f"{label} was stopped")
            elif error is not None:
                failed(f"{label}: {' '.join(str(error).split()) or type(error).__name__}")
            else:
                done(future.result())
            # What was called may compute in its turn: then the others wait for that.
            while self._waiting and not self.label:
                self._waiting.pop(next(iter(self._waiting)))()

        future.add_done_callback(finished)

    def when_free(self, label: str, begin: Callable[[], None]) -> None:
        """Call a function once nothing is computed any more, at once if nothing is.

        Args:
            label: What it will start; of the same the last function alone is called.
            begin: The function.
        """
        with self._lock:
            if self.label:
                self._waiting[label] = begin
                return
        begin()

    def stop(self) -> None:
        """Stop the computation, if there is one."""
        if self.label:
            self._kill()

    def close(self) -> None:
        """Stop whatever is computed, and end the child."""
        self._closed = True
        self._kill()
        # Its process is dead, so that this takes no time. The thread of a pool that is left to itself closes a pipe
        # while Python, which ends, still writes into it.
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _kill(self) -> None:
        with contextlib.suppress(psutil.NoSuchProcess, BrokenProcessPool):
            # A pool cannot kill its process; the process told its number when it was opened.
            psutil.Process(self._child.result(timeout=30.0)).kill()


def _end_with_the_page() -> None:
    """Let the child end when the station does, however that ended."""

    def wait() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            parent.join()
        # An ordinary exit would end this thread alone.
        _exit(1)

    threading.Thread(target=wait, daemon=True).start()
