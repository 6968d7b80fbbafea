"""What the parser says, made readable: help in lines, complaints in one."""

import contextlib
import io
import os
import re
import shutil
import textwrap
from collections.abc import Callable, Iterator

KNOWN = r"Missing (from|value)|Error parsing|Unrecognized options?:|[Ii]nvalid choice '"
"""Beginnings of what the parser says."""

KINDS = {"INT": "a whole number", "FLOAT": "a number", "[INT [INT ...]]": "whole numbers", "PATH": "a path"}
"""What the parser's words for kinds of values mean."""

STRAY = {
    "hmtb waveform": "--path",
    "hmtb identify": "--validate",
    "hmtb video": "--out",
    "hmtb thesis": "--out",
}
"""Option that a word too many was probably meant for, by command."""

WIDE = "100000"
"""Columns that no message fills, so that the parser wraps nothing."""


def one_line(parse: Callable[[], object], command: str) -> str:
    """What the parser objects to, in one line: what was given, what was expected.

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
    """Wrap the paragraphs of a help text, which the parser leaves in one line each; its boxes and examples stay.

    Args:
        text: What the parser prints on --help.
    """
    columns = shutil.get_terminal_size().columns
    lines: list[str] = []
    for line in text.splitlines():
        prose = len(line) > columns and line[0].isalnum() and not line.startswith("usage:")
        lines += textwrap.wrap(line, columns, break_on_hyphens=False) if prose else [line]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)) + "\n"


def _sentence(sections: list[list[str]], command: str) -> str:
    rows = [row for section in sections for row in section]
    said = next((row for row in rows if re.match(KNOWN, row)), "")
    if said.startswith("Missing from"):
        # Each option stands above its help text, which ends in "(required)".
        needed = [rows[number - 1] for number, row in enumerate(rows) if number and row.endswith("(required)")]
        return f"missing {', '.join(map(_option, needed))}" if needed else "an option is missing"
    if match := re.match(r"Missing value for argument '([^']+)'", said):
        return f"{match[1]} needs a value"
    if match := re.match(r"Error parsing ([^:]+): (.*)", said):
        given = " ".join(re.findall(r"'([^']*)'", match[2])) or "something else"
        usage = next((row for row in rows if row.startswith(match[1].split("/")[-1] + " ")), "")
        kind = usage.partition(" ")[2].replace("{None}|", "")
        return f"{match[1]}: expected {KINDS.get(kind, kind) or 'another value'}, given {given}"
    if match := re.match(r"Unrecognized options?: (.*)", said):
        words = match[1].replace(", ", " ")
        if not words.startswith("-"):
            meant = f"; did you mean {STRAY[command]} {words}?" if command in STRAY and " " not in words else ""
            return f"unexpected argument{'s' if ' ' in words else ''} {words!r}{meant}"
        close = [row.split()[0] for row in rows if row.startswith("--") and row != said]
        return f"cannot read {words!r}" + (f": did you mean {close[0]}?" if close else "")
    if match := re.match(r"[Ii]nvalid choice '([^']*)' for argument '([^']*)'. Expected one of \((.*)\)", said):
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
