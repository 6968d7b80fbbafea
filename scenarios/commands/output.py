"""Output of commands: results on stdout as a table or as JSON, progress on stderr."""

import json
import math
import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Literal

from hmtb_twin.files.atomic_write import check_place, result_folder
from hmtb_twin.files.errors import system_reason
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import counted, one_line, visible
from scenarios.files.result_table import ResultTable
from scenarios.jobs.progress import end_activity, pause_activity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from scenarios.jobs.cluster import Cluster

NUMBER = re.compile(r"[-+−±]?[\d∞][^,]{0,30}$")
"""A number in a table, also with a unit, an interval or a remark in brackets; lists and sentences are text."""

FIGURES = (".svg", ".png", ".pdf")
"""Endings of figures."""


def plain(value: object) -> object:
    """Turn a value into what JSON holds; numbers that are not finite become null.

    Args:
        value: Mappings, sequences, arrays, numbers (complex as `[re, im]`), paths, texts.
    """
    # Arrays and NumPy's numbers, without loading NumPy here.
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, bool | int | str | None) else str(value)


def say(line: str) -> None:
    """Write a line on stdout."""
    end_activity()
    sys.stdout.write(visible(line) + "\n")


def say_each(label: str, items: Iterable[object]) -> None:
    """Write a line on stdout for each item, the label before it."""
    for item in items:
        say(one_line(f"{label}{item}"))


def say_next(*words: object) -> None:
    """Write the command that goes on from here, complete as it can be typed."""
    say(f"next: {shlex.join(['hmtb', *map(str, words)])}")


def say_next_identify(path: Path, name: str, joints: Sequence[str], *, arm: str = "nominal", tests: int = 1) -> None:
    """Write the command that identifies a model of the first excited joint from a file of one or several tests."""
    from hmtb_twin.arm_files.known_arms import arm_named
    from hmtb_twin.control.modes import TOOL_AXES

    test = ("--test", name) if tests > 1 else ()
    # Tests of Cartesian axes excite no single joint.
    excited = [joint for joint in joints if joint not in TOOL_AXES]
    joint = excited[0] if excited else arm_named(arm).compared[-1]
    say_next("identify", path, *test, "--joint", joint)


def say_beside_bar(line: str) -> None:
    """Write a line on stderr; a bar of progress stays below it."""
    with pause_activity():
        sys.stderr.write(f"{one_line(line)}\n")
        sys.stderr.flush()


def json_text(record: Mapping[str, object]) -> str:
    """One object as JSON."""
    return json.dumps(plain(record), indent=2, allow_nan=False)


def print_json(record: Mapping[str, object]) -> None:
    """Print one object on stdout, and nothing else."""
    say(json_text(record))


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on stdout, columns that are mostly numbers right-aligned; without any heading all stand left."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", title_style="bold", pad_edge=False)
    table.show_header = any(columns)
    for k, column in enumerate(columns):
        is_number = any(columns) and _is_mostly_numbers([row[k] for row in rows])
        side: Literal["right", "left"] = "right" if is_number else "left"
        table.add_column(column, justify=side, overflow="fold")
    for row in rows:
        table.add_row(*map(one_line, row))
    end_activity()
    # A pipe has no width of its own; eighty columns would break the rows that a script wants to read.
    width = None if sys.stdout.isatty() else 160
    console = Console(width=width, highlight=False, markup=False)
    try:
        # Captured, because by itself it would end the process where the reader of a pipe has left.
        with console.capture() as printed:
            console.print(table)
    except SystemExit:
        # It flushes what was printed before, and finds the reader gone.
        raise BrokenPipeError from None
    sys.stdout.write(printed.get())


def print_tables(tables: Iterable[ResultTable]) -> None:
    """Print the tables of a result on stdout."""
    for table in tables:
        print_table(*table)


def _is_mostly_numbers(cells: Sequence[str]) -> bool:
    """Whether more than half of the cells hold numbers; words such as "locked" may stand in place of some."""
    filled = [cell for cell in cells if cell.strip("-–—")]
    return 2 * sum(bool(NUMBER.match(cell)) for cell in filled) > len(filled)


def cluster_executor(address: str, patience: float, workers: int | None) -> "Cluster":
    """The workers of a Dask scheduler.

    Args:
        address: Of the scheduler.
        patience: How long to wait for a lost scheduler or for missing workers, s.
        workers: Value of --workers, which goes with this machine alone.

    Raises:
        ScenarioError: It is no address, Dask is missing, or workers are given.
    """
    from scenarios.jobs.cluster import Cluster

    if workers is not None:
        raise ScenarioError("--workers and --cluster given; expected one: the cluster has workers of its own")
    return Cluster(address, patience, say_beside_bar)


def check_files(*paths: Path, overwrite: bool) -> None:
    """Ask before files are replaced, unless `overwrite` allows it; without a terminal refuse.

    Raises:
        ScenarioError: One exists and is not to be replaced, or there is a folder of that name.
    """
    existing = [path for path in dict.fromkeys(paths) if os.path.lexists(path)]
    for path in existing:
        check_place(path)
    if overwrite or not existing:
        return
    first, others = existing[0], len(existing) - 1
    if others:
        subject, them = f"{first} and {counted(others, 'other file')} exist", "them"
    else:
        subject, them = f"{first} exists", "it"
    # Nobody can answer a question in a pipe.
    if not (sys.stdin and sys.stdin.isatty() and sys.stderr.isatty()):
        raise ScenarioError(f"{subject}: --overwrite replaces {them}; or name another place")
    with pause_activity():
        sys.stderr.write(f"{subject}: replace {them}? [y/N] ")
        sys.stderr.flush()
        answer = sys.stdin.readline()
    # The default is the answer that loses nothing.
    if answer.strip().lower() not in ("y", "yes"):
        raise ScenarioError(f"nothing was written; {first} is as before")


def check_figure(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that no figure can be written to, before the work for it begins.

    Raises:
        ScenarioError: Its ending is none of `FIGURES`, or see `check_files`.
    """
    if path.suffix not in FIGURES:
        raise ScenarioError(f"--out {path} given, expected a figure: {', '.join(FIGURES)}")
    check_files(path, overwrite=overwrite)


def draw(make: "Callable[[], Figure]", *paths: Path) -> list[Path]:
    """Draw a figure in the look of the report, and write it to files.

    Args:
        make: Draws it.
        paths: The files, in the formats that their names end in.
    """
    import matplotlib

    from scenarios.report.figures import SETTINGS, save_figure

    with matplotlib.rc_context(SETTINGS):
        figure = make()
        for path in paths:
            with output_folder(path.parent):
                save_figure(figure, path, dpi=150)
    return list(paths)


@contextmanager
def progress(label: str, *, lines: bool = False) -> Iterator[Callable[..., None]]:
    """Show the progress of long work on stderr.

    Args:
        label: What runs.
        lines: Whether to write a line now and then where stderr is no terminal; else nothing is written there.

    Yields:
        A function to call with items that are done, items in all (None where that is not known), and the name of the
        step where there are several.
    """
    from scenarios.jobs.progress import How, Progress, show_progress

    how: How = "auto" if lines or sys.stderr.isatty() else "none"
    with show_progress(label, how) as report:
        yield lambda done, total, step="": report(Progress(step, done, total))


@contextmanager
def output_folder(path: Path, *files: str, overwrite: bool = False) -> Iterator[Path]:
    """Create a folder for results and make sure that it can be written; remove it if the work fails.

    Args:
        path: The folder.
        files: Names of files that the work writes there.
        overwrite: Whether to replace those that exist without a question.

    Yields:
        The path. If the work inside fails or is interrupted, folders made for it that are still empty are removed.

    Raises:
        ScenarioError: It cannot be created or written, or see `check_files`.
    """
    with ExitStack() as made:
        try:
            made.enter_context(result_folder(path))
            TemporaryFile(dir=path).close()  # finds out before the work, not after
        except OSError as error:
            why = f"{system_reason(error)}; expected a folder that can be created and written"
            raise ScenarioError(f"cannot write to folder {str(path)!r}: {why}") from error
        check_files(*(path / name for name in files), overwrite=overwrite)
        yield path


def optional_folder(
    path: Path | None, *files: str, overwrite: bool = False
) -> AbstractContextManager[Path] | AbstractContextManager[None]:
    """The folder of --out as `output_folder` makes it; nothing where the option was not given."""
    if path is None:
        return nullcontext()
    return output_folder(path, *files, overwrite=overwrite)
