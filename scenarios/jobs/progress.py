"""Progress of long work on stderr: a bar on a terminal, a line now and then elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic
from typing import Literal

How = Literal["auto", "bar", "lines", "none"]
"""Kind of display; auto: a bar on a terminal, else lines."""

FIRST, EVERY = 10.0, 30.0
"""Time until the first line, and between lines, s: short work writes none."""


@dataclass(frozen=True)
class Progress:
    """State of long work.

    Attributes:
        step: The current step, one word; a new one starts its rate and remaining time afresh.
        done: Items that are done.
        total: Items in all; None where that is not known.
        items: What items are called; empty: the step's name stands before the count.
        seconds: Simulated time that is done, s.
        seconds_total: Simulated time in all, s; above 0 it measures the work in place of the items.
        left: Remaining time, s, where the caller knows better than by the rate so far.
        note: Shown behind the count in place of rate and remaining time.
    """

    step: str
    done: int
    total: int | None
    items: str = ""
    seconds: float = 0.0
    seconds_total: float = 0.0
    left: float | None = None
    note: str = ""


Report = Callable[[Progress], None]
"""Called now and then with the state of the work."""


@contextmanager
def show_progress(label: str, how: How = "auto", *, clock: Callable[[], float] = monotonic) -> Iterator[Report]:
    """Show how far long work is.

    Args:
        label: What is done.
        how: Kind of display.
        clock: Time, s.

    Yields:
        A function to call with the state.
    """
    if how == "none":
        yield lambda _: None
    elif how == "bar" or (how == "auto" and sys.stderr.isatty()):
        with _bar(label, _Pace(clock)) as report:
            yield report
    else:
        yield _lines(label, _Pace(clock), clock)


class _Pace:
    """Describes the state in words, with rate and remaining time of the current step."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._step: str | None = None
        self._begun = self._at = 0.0

    def text(self, progress: Progress) -> str:
        now, (at, whole) = self._clock(), measure(progress)
        if progress.step != self._step:
            # What an earlier run has done is not the speed of this one.
            self._step, self._begun, self._at = progress.step, now, at
        total = "" if progress.total is None else f" of {progress.total}"
        count = (
            f"{progress.done}{total} {progress.items}" if progress.items else f"{progress.step} {progress.done}{total}"
        )
        if progress.note:
            return f"{count.strip()}, {progress.note}"
        rate = (at - self._at) / (now - self._begun) if now > self._begun else 0.0
        parts = [count.strip()]
        if rate > 0 and progress.left is None:
            parts.append(f"{rate:.3g} {'x real time' if progress.seconds_total else 'a second'}")
        left = progress.left if progress.left is not None else (whole - at) / rate if whole and rate > 0 else None
        return ", ".join(parts if left is None else [*parts, f"{duration_text(left)} left"])


def measure(progress: Progress) -> tuple[float, float | None]:
    """Work that is done and work in all: in simulated seconds where there are any, else in items."""
    if progress.seconds_total:
        return progress.seconds, progress.seconds_total
    return progress.done, progress.total


def duration_text(seconds: float) -> str:
    """A time for people, e.g. ``"5 min"``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _lines(label: str, pace: _Pace, clock: Callable[[], float]) -> Report:
    due = clock() + FIRST

    def report(progress: Progress) -> None:
        nonlocal due
        text = pace.text(progress)
        if clock() >= due:
            due = clock() + EVERY
            sys.stderr.write(f"{label}: {text}\n")
            sys.stderr.flush()

    return report


@contextmanager
def _bar(label: str, pace: _Pace) -> Iterator[Report]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bars
    from rich.table import Column

    text = TextColumn("{task.fields[text]}", table_column=Column(no_wrap=True), markup=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), text)
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        bar = bars.add_task(label, total=None, text="")

        def report(progress: Progress) -> None:
            done, total = measure(progress)
            bars.update(bar, completed=done, total=total, text=pace.text(progress))

        yield report
