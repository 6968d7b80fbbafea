"""How far a run of the test bench is, on stderr: a bar on a terminal, a line now and then elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.bench.progress import Report

FIRST, EVERY = 10.0, 30.0
"""When the first line is written and how often others are, s."""


@contextmanager
def verify_progress(label: str, *, clock: Callable[[], float] = monotonic) -> "Iterator[Report]":
    """Show how far a run is.

    Args:
        label: What runs.
        clock: Time, s.

    Yields:
        A function to call with the trials that are done, all trials, and the time that is left, s, or None.
    """
    if sys.stderr.isatty():
        with _bar(label) as told:
            yield told
    else:
        yield _Lines(label, clock)


class _Lines:
    """Writes lines, the first after some time: what is over soon says nothing."""

    def __init__(self, label: str, clock: Callable[[], float]) -> None:
        self._label, self._clock = label, clock
        self._next = clock() + FIRST

    def __call__(self, done: int, total: int, left: float | None) -> None:
        now = self._clock()
        if now < self._next:
            return
        self._next = now + EVERY
        sys.stderr.write(f"{self._label}: {_count(done, total, left)}\n")
        sys.stderr.flush()


@contextmanager
def _bar(label: str) -> "Iterator[Report]":
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn
    from rich.table import Column

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[count]}", table_column=Column(no_wrap=True)),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        job = bars.add_task(label, total=None, count="")

        def told(done: int, total: int, left: float | None) -> None:
            bars.update(job, completed=done, total=total, count=_count(done, total, left))

        yield told


def _count(done: int, total: int, left: float | None) -> str:
    from scenarios.bench.progress import time_text

    what = f"{done} of {total} requests"
    if done == total:
        return what
    # The first trials start processes: their pace says nothing of the others'.
    return f"{what}, the first of each kind" if left is None else f"{what}, about {time_text(left)} left"
