"""Help texts, and complaints about wrong options in one line, from what the parser writes."""

import contextlib
import inspect
import io
import os
import re
import shutil
import textwrap
from collections.abc import Callable, Iterator, Mapping

KNOWN = r"Missing (from|value)|Error parsing|Unrecognized options?:|[Ii]nvalid choice '"
"""Beginnings of the parser's messages."""

KINDS = {"INT": "a whole number", "FLOAT": "a number", "[INT [INT ...]]": "whole numbers", "PATH": "a path"}
"""Words for the parser's kinds of values."""

STRAY = {
    "hmtb waveform": "--path",
    "hmtb identify": "--validate",
    "hmtb video": "--out",
    "hmtb thesis": "--out",
}
"""The option that a surplus word was probably meant for, by command."""

WIDE = "100000"
"""Columns, so many that the parser wraps no message."""


def listing(program: str, description: str, commands: Mapping[str, Callable[..., int]]) -> str:
    """The help of a program that has commands: its description, and each command with the first line of its help.

    Args:
        program: Its name, e.g. ``"hmtb"``.
        description: Its text.
        commands: Functions by the names of the commands.
    """
    columns = shutil.get_terminal_size().columns
    width = max(map(len, commands)) + 4
    lines = [f"usage: {program} COMMAND [OPTIONS]", "", description.rstrip(), "", "Commands:", ""]
    for name, command in commands.items():
        summary = inspect.cleandoc(command.__doc__ or "").partition("\n")[0]
        indent = " " * width
        lines += textwrap.wrap(
            summary, max(columns, 2 * width), initial_indent=f"  {name}".ljust(width), subsequent_indent=indent
        )
    return "\n".join(lines) + "\n"


def complaint(parse: Callable[[], object], command: str) -> str:
    """The parser's objection in one line: what was given, what was expected.

    Args:
        parse: Parses the words; it has failed before and is without side effects.
        command: The command that the words belong to, e.g. ``"hmtb identify"``.
    """
    with _unwrapped() as box, contextlib.suppress(SystemExit):
        parse()
    plain = re.sub(r"\x1b\[[0-9;]*m", "", box.getvalue())
    sections: list[list[str]] = [[]]
    for line in plain.splitlines():
        row = line.strip("│|╭╮╰╯+ \t")
        if row and not row.strip("─- "):
            sections.append([])
        elif row:
            sections[-1].append(row)
    return f"{_sentence(sections, command)}; see {command} --help"


def wrapped(text: str) -> str:
    """Wrap the paragraphs of a command's help, one line each as the parser prints it; boxes and examples stay."""
    columns = shutil.get_terminal_size().columns
    lines: list[str] = []
    for line in text.splitlines():
        prose = len(line) > columns and line[0].isalnum() and not line.startswith("usage:")
        lines += textwrap.wrap(line, columns, break_on_hyphens=False) if prose else [line]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _sentence(sections: list[list[str]], command: str) -> str:
    rows = [row for section in sections for row in section]
    message = next((row for row in rows if re.match(KNOWN, row)), "")
    if message.startswith("Missing from"):
        # Each option stands above its help text, which ends in "(required)".
        needed = [rows[number - 1] for number, row in enumerate(rows) if number and row.endswith("(required)")]
        return f"missing {', '.join(map(_option, needed))}" if needed else "an option is missing"
    if match := re.match(r"Missing value for argument '([^']+)'", message):
        return f"{match[1]} needs a value"
    if match := re.match(r"Error parsing ([^:]+): (.*)", message):
        given = " ".join(re.findall(r"'([^']*)'", match[2])) or "something else"
        usage = next((row for row in rows if row.startswith(match[1].split("/")[-1] + " ")), "")
        kind = usage.partition(" ")[2].replace("{None}|", "")
        return f"{match[1]}: expected {KINDS.get(kind, kind) or 'another value'}, given {given}"
    if match := re.match(r"Unrecognized options?: (.*)", message):
        words = match[1].replace(", ", " ")
        if not words.startswith("-"):
            meant = f"; did you mean {STRAY[command]} {words}?" if command in STRAY and " " not in words else ""
            return f"unexpected argument{'s' if ' ' in words else ''} {words!r}{meant}"
        close = [row.split()[0] for row in rows if row.startswith("--") and row != message]
        return f"cannot read {words!r}" + (f": did you mean {close[0]}?" if close else "")
    if match := re.match(r"[Ii]nvalid choice '([^']*)' for argument '([^']*)'. Expected one of \((.*)\)", message):
        return f"unknown {match[2]} {match[1]!r}; there are: {match[3].replace(chr(39), '').rstrip(',')}"
    return "; ".join(sections[0] + sections[1] if len(sections) > 1 else rows) or "cannot read the command"


def _option(usage: str) -> str:
    name, _, kind = usage.partition(" ")
    return f"{name} ({KINDS.get(kind, kind)})" if kind else name


@contextlib.contextmanager
def _unwrapped() -> Iterator[io.StringIO]:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = WIDE
    try:
        with contextlib.redirect_stderr(io.StringIO()) as box, contextlib.redirect_stdout(io.StringIO()):
            yield box
    finally:
        if before is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = before
