"""Pieces of a run done by processes of this machine."""

import os
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import monotonic

from scenarios.bench.executor import Crew
from scenarios.bench.work import Bench, Done, Piece
from scenarios.bench.worker import FINISHED, work
from scenarios.files.errors import ScenarioError

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables by which numerical libraries are told how many threads to use: one, where there are as many processes."""

DEATHS = 2
"""A piece whose process has died so often ends the run."""

FAREWELL = 10.0
"""How long processes may take to close what they have opened, s."""


@dataclass(frozen=True)
class Local:
    """Does pieces in processes of its own.

    Attributes:
        workers: Number of processes; all processors that this one may use by default.
    """

    workers: int = field(default_factory=lambda: len(os.sched_getaffinity(0)))

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ScenarioError(f"workers must be 1 or more, given {self.workers}")

    @property
    def here(self) -> bool:
        """They are."""
        return True

    @contextmanager
    def crew(self, bench: Bench) -> Iterator[Crew]:
        """Start processes when there are pieces, and end them on leaving; see `Executor`.

        Yields:
            What does pieces; it raises `ScenarioError` where processes that do a piece die, one after the other.
        """
        with _Crew(bench, self.workers) as crew:
            yield crew.do


class _Crew:
    """Processes, with the piece that each of them does."""

    def __init__(self, bench: Bench, most: int) -> None:
        self._bench, self._most = bench, most
        self._people: dict[Connection, BaseProcess] = {}
        self._busy: dict[Connection, Piece] = {}
        self._deaths: dict[Piece, int] = {}
        self._again: deque[Piece] = deque()

    def __enter__(self) -> "_Crew":
        return self

    def __exit__(self, *_: object) -> None:
        self._dismiss()

    def do(self, pieces: Iterable[Piece]) -> Iterator[Done]:
        """Hand out pieces and hand on what comes back, until nothing is left."""
        left = iter(pieces)
        while True:
            while len(self._busy) < self._most and (piece := self._next(left)) is not None:
                pipe = next((one for one in self._people if one not in self._busy), None) or self._hire()
                self._busy[pipe] = piece
                with suppress(BrokenPipeError, ConnectionResetError):  # its death is read below
                    pipe.send(piece)
            if not self._busy:
                return
            ready = connection.wait(list(self._busy))
            for pipe in [one for one in self._busy if one in ready]:
                yield from self._heard(pipe)

    def _next(self, left: Iterator[Piece]) -> Piece | None:
        return self._again.popleft() if self._again else next(left, None)

    def _hire(self) -> Connection:
        ours, theirs = get_context("spawn").Pipe()
        process = get_context("spawn").Process(target=work, args=(theirs, self._bench), daemon=True)
        with _one_thread():
            process.start()
        theirs.close()
        self._people[ours] = process
        return ours

    def _heard(self, pipe: Connection) -> Iterator[Done]:
        try:
            told = pipe.recv()
        except (EOFError, ConnectionResetError):
            self._bury(pipe)
            return
        if isinstance(told, Exception):
            raise told
        if told is FINISHED:
            del self._busy[pipe]
            return
        yield told

    def _bury(self, pipe: Connection) -> None:
        """A process that died: its piece is done by another one, which leaves out nothing."""
        process, piece = self._people.pop(pipe), self._busy.pop(pipe)
        pipe.close()
        process.join()
        self._deaths[piece] = self._deaths.get(piece, 0) + 1
        if self._deaths[piece] >= DEATHS:
            raise ScenarioError(
                f"{piece.problem}, record {piece.draw}: {DEATHS} processes that worked on it died, the last with exit "
                f"code {process.exitcode}; the memory of this machine may be too small for {len(self._people) + 1} "
                "workers. What is done is kept: the same command goes on from there, with fewer --workers"
            )
        self._again.append(piece)

    def _dismiss(self) -> None:
        for pipe in self._people:
            if pipe in self._busy:
                self._people[pipe].terminate()
            else:
                with suppress(BrokenPipeError, ConnectionResetError):
                    pipe.send(None)
        end = monotonic() + FAREWELL
        for pipe, process in self._people.items():
            process.join(max(0.0, end - monotonic()))
            if process.is_alive():
                process.kill()
                process.join()
            pipe.close()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that are started meanwhile do linear algebra on one thread each."""
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
