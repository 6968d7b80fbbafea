"""How far a build is, on stderr: a bar on a terminal, a line now and then elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.progress import Task
    from rich.text import Text

    from scenarios.datasets.build_progress import Progress, Told

How = Literal["auto", "bar", "lines", "none"]
"""Auto: a bar on a terminal, else lines."""

FIRST, EVERY = 10.0, 30.0
"""When the first line is written and how often others are, s."""


@contextmanager
def build_progress(label: str, how: How = "auto", *, clock: Callable[[], float] = monotonic) -> Iterator["Told"]:
    """Show how far a build is.

    Args:
        label: What is built.
        how: In which way.
        clock: Time, s.

    Yields:
        A function to call with every step of the progress.
    """
    if how == "none":
        yield lambda _: None
    elif how == "lines" or (how == "auto" and not sys.stderr.isatty()):
        yield _Lines(label, clock)
    else:
        with _bar(label) as told:
            yield told


class _Lines:
    """Writes lines, the first after some time: what is over soon says nothing."""

    def __init__(self, label: str, clock: Callable[[], float]) -> None:
        self._label, self._clock = label, clock
        self._step, self._begun, self._at = "", 0.0, 0.0
        self._next = clock() + FIRST

    def __call__(self, progress: "Progress") -> None:
        now, at = self._clock(), _measure(progress)[0]
        if progress.step != self._step:
            self._step, self._begun, self._at = progress.step, now, at
        if now < self._next:
            return
        self._next = now + EVERY
        rate = (at - self._at) / (now - self._begun) if now > self._begun else 0.0
        parts = [_count(progress)]
        if rate > 0:
            parts += [_rate(progress, rate), f"{_time((_measure(progress)[1] - at) / rate)} left"]
        sys.stderr.write(f"{self._label}: {', '.join(parts)}\n")
        sys.stderr.flush()


@contextmanager
def _bar(label: str) -> "Iterator[Told]":
    from rich.console import Console
    from rich.progress import BarColumn, ProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars
    from rich.table import Column
    from rich.text import Text

    latest: Progress | None = None

    class Rate(ProgressColumn):
        def render(self, task: "Task") -> "Text":
            speed = task.finished_speed or task.speed
            return Text(_rate(latest, speed) if latest and speed else "", style="progress.data.speed")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[count]}", table_column=Column(no_wrap=True)),
        Rate(table_column=Column(no_wrap=True)),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        job = None

        def told(progress: "Progress") -> None:
            nonlocal latest, job
            at, whole = _measure(progress)
            if latest is None or progress.step != latest.step or job is None:
                if job is not None:
                    bars.remove_task(job)
                # What an earlier run has done is no speed of this one.
                job = bars.add_task(label, total=whole, completed=at, count=_count(progress))  # type: ignore[arg-type]
            latest = progress
            bars.update(job, completed=at, total=whole, count=_count(progress))

        yield told


def _measure(progress: "Progress") -> tuple[float, float]:
    """How far it is and how far it goes: in seconds of records where there are any, else in pieces of work."""
    if progress.seconds_total:
        return progress.seconds, progress.seconds_total
    return progress.done, progress.total


def _count(progress: "Progress") -> str:
    if progress.seconds_total:
        return f"{progress.done} of {progress.total} experiments"
    return f"{progress.step} {progress.done} of {progress.total}"


def _rate(progress: "Progress", rate: float) -> str:
    return f"{rate:.3g} x real time" if progress.seconds_total else f"{rate:.3g} a second"


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
