"""A process that does pieces of a run, told of them through a pipe."""

import os
import signal
from contextlib import suppress
from multiprocessing import connection, parent_process
from multiprocessing.connection import Connection
from threading import Thread
from time import sleep
from types import FrameType
from typing import Any

from scenarios.bench.run_trials import Runner
from scenarios.bench.work import Bench, Done, Piece

FINISHED = None
"""Sent back behind the trials of a piece."""

ORPHANED = 4.0
"""How long it may take to close sandboxes when the process that started this one is gone, s."""


def work(pipe: Connection, bench: Bench) -> None:
    """Do pieces until there are no more, or nobody is there to tell.

    Args:
        pipe: Brings pieces; trials go back by it, as they are done, then `FINISHED` for each piece; an exception is
            sent back in place of them and ends the process.
        bench: What the pieces share.
    """
    # Ctrl-C goes to all processes at a terminal: the one that started this one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    Thread(target=_leave_with_parent, daemon=True).start()
    with suppress(EOFError, BrokenPipeError, ConnectionResetError), Runner(bench) as runner:
        while (piece := pipe.recv()) is not None:
            answer(pipe, runner, piece)


def answer(pipe: Connection, runner: Runner, piece: Piece) -> None:
    """Do a piece and send back what comes of it."""
    try:
        for done in runner.run(piece):
            pipe.send(done)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        raise
    except Exception as error:
        pipe.send(_portable(error))
        raise EOFError from error
    pipe.send(FINISHED)


Told = Done | Exception | None


def _leave(number: int, frame: FrameType | None) -> Any:
    """SIGTERM as an exception, so that sandboxes are closed on the way out."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise SystemExit(128 + number)


def _leave_with_parent() -> None:
    """Wait for the end of the process that started this one, however it comes, and leave too.

    Otherwise that would be noticed when the next trial is told: an estimator may hang until then.
    """
    parent = parent_process()
    if parent is None:
        return
    connection.wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
    # A library that computes for long lets no signal through; what runs in sandboxes ends with this process.
    sleep(ORPHANED)
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """The error as one that every process can read, with where it came from."""
    import traceback

    text = "".join(traceback.format_exception(error))
    error.add_note(f"in worker {os.getpid()}:\n{text}")
    return error
