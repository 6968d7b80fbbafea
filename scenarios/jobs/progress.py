"""Progress of long work on stderr: a bar on a terminal, a line now and then elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.live import Live

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
        note: Shown behind the count in place of rate and remaining time.
        weighted: Whether the items are units of cost: shown in percent of all steps, which share one rate.
    """

    step: str
    done: int
    total: int | None
    items: str = ""
    seconds: float = 0.0
    seconds_total: float = 0.0
    note: str = ""
    weighted: bool = False


Report = Callable[[Progress], None]
"""Called now and then with the state of the work."""

_activity: "Live | None" = None


@contextmanager
def show_activity(label: str) -> Iterator[None]:
    """Show on a terminal what runs while there is no bar of `show_progress`, until `end_activity` or the end."""
    global _activity
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.live import Live
    from rich.spinner import Spinner

    spinner, console = Spinner("dots", label), Console(stderr=True)
    # Streams that rich redirects say that they are no terminal.
    _activity = Live(spinner, console=console, transient=True, redirect_stdout=False, redirect_stderr=False)
    _activity.start(refresh=True)
    try:
        yield
    finally:
        end_activity()


@contextmanager
def pause_activity() -> Iterator[None]:
    """Hide the line of `show_activity`: a terminal has room for one line that moves."""
    if _activity is not None:
        _activity.stop()
    yield
    if _activity is not None:
        _activity.start(refresh=True)


def end_activity() -> None:
    """Remove the line of `show_activity`: what follows is written in its place."""
    global _activity
    if _activity is not None:
        _activity.stop()
        _activity = None


class Description:
    """Words for the state of long work, with rate and remaining time of its current step.

    Args:
        clock: Time, s.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._step: str | None = None
        self._begin = 0.0
        self._done_before = 0.0

    def __call__(self, progress: Progress) -> str:
        """Describe a state."""
        now = self._clock()
        done, total = _work(progress)
        step = "" if progress.weighted else progress.step
        if step != self._step:
            # What an earlier run has done is not the speed of this one.
            self._step, self._begin, self._done_before = step, now, done
        elapsed, done_since = now - self._begin, done - self._done_before
        if progress.weighted and total:
            return _in_percent(progress.step, done, total, done_since, elapsed)
        count = _count(progress)
        if progress.note:
            return f"{count}, {progress.note}"
        rate = done_since / elapsed if elapsed > 0.0 else 0.0
        if rate <= 0 or not progress.done:  # settling of the first item says nothing of the rest
            return count
        unit = "x real time" if progress.seconds_total else "a second"
        pace = f"{count}, {rate:.3g} {unit}"
        if not total:
            return pace
        return f"{pace}, {duration_text((total - done) / rate)} left"


def _in_percent(step: str, done: float, total: float, done_since: float, elapsed: float) -> str:
    shown = f"{int(100 * done / total)} %, {step}"
    if done_since <= 0.0:
        return shown
    return f"{shown}, {duration_text((total - done) * elapsed / done_since)} left"


def _count(progress: Progress) -> str:
    """How many items are done: ``"3 of 12 records"``, or ``"identify 3 of 12"`` where items have no name."""
    count = str(progress.done) if progress.total is None else f"{progress.done} of {progress.total}"
    return f"{count} {progress.items}" if progress.items else f"{progress.step} {count}".strip()


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
    describe = Description(clock)
    if how == "bar" or (how == "auto" and sys.stderr.isatty()):
        with _bar(label, describe) as move_bar:
            yield move_bar
    elif how == "none":
        yield lambda _: None
    else:
        yield _line_writer(label, describe, clock)


@contextmanager
def _bar(label: str, describe: Description) -> Iterator[Report]:
    """A bar on a terminal, which is removed at the end."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bars
    from rich.table import Column

    # Without markup: rich would take square brackets in names for its own.
    state = TextColumn("{task.fields[state]}", table_column=Column(no_wrap=True), markup=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(bar_width=20), state)
    with pause_activity(), Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        bar = bars.add_task(label, total=None, state="starting")

        def move_bar(progress: Progress) -> None:
            done, total = _work(progress)
            bars.update(bar, completed=done, total=total, state=describe(progress))

        yield move_bar


def _line_writer(label: str, describe: Description, clock: Callable[[], float]) -> Report:
    """Write a line when the first or the next one is due."""
    due = clock() + FIRST

    def write_line(progress: Progress) -> None:
        nonlocal due
        # Described also where nothing is written: the rate counts from the first state of a step on.
        state = describe(progress)
        if clock() >= due:
            due = clock() + EVERY
            sys.stderr.write(f"{label}: {state}\n")
            sys.stderr.flush()

    return write_line


def duration_text(seconds: float) -> str:
    """A time for people, e.g. ``"5 min"``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


def _work(progress: Progress) -> tuple[float, float | None]:
    """Work that is done and work in all: in simulated seconds where there are any, else in items."""
    if progress.seconds_total:
        return progress.seconds, progress.seconds_total
    return progress.done, progress.total
