"""Pieces of the page as HTML: figures on a card, tables, lists."""

import re
import threading
from collections.abc import Collection, Iterable, Sequence
from html import escape
from itertools import count
from os import getpid

from matplotlib.figure import Figure

from scenarios.files.printable import one_line
from scenarios.report.figures import svg

_numbers = count()

_drawing = threading.Lock()
"""One figure at a time: settings of matplotlib belong to the whole process."""

NUMBER = re.compile(r"[-+−±]?[\d∞]|[–—]?$")
"""Beginning of a number in a table, or what stands in its place."""

SQUARE = "display:inline-block;width:0.8em;height:0.8em;border:1px solid #888"
"""Style of a square of a colour."""

LONGEST_WORD = 24
"""Characters of a word that a cell of a table does not break."""


def card(figure: Figure, description: str, size: tuple[float, float] | None = None) -> str:
    """A figure on a white card, readable on a dark page too.

    Args:
        figure: The figure.
        description: What it shows, for those who cannot see it.
        size: Width and height to lay it out anew, inches: at a width of 5.2 its 9-point letters are 11 pixels high.
    """
    if size is not None:
        figure.set_size_inches(size)
    with _drawing:  # figures of a child process stand on the same page
        picture = svg(figure, description, f"s{getpid()}-{next(_numbers)}")
    return f'<div style="background:#fff;border-radius:4px;margin:0.3em 0.6em;padding:0.2em">{picture}</div>'


def table(
    head: Sequence[str], rows: Iterable[Sequence[str]], red: Collection[int] = (), colours: Sequence[str] = ()
) -> str:
    """A table; columns of numbers stand right, the others left.

    Args:
        head: Headings; an empty head is left out.
        rows: Cells.
        red: Numbers of the rows that are red.
        colours: A colour for each row, shown as a square before its first cell.
    """
    rows = list(rows)
    # A column is of numbers if every cell begins as one, or is empty or a dash.
    right = [all(map(NUMBER.match, column)) for column in zip(*rows, strict=True)] or [False] * len(head)
    if colours:
        # The squares of colour stand in one line below each other.
        right[0] = False
    lines = [_row("th", head, right)] if head else []
    for index, row in enumerate(rows):
        mark = f'<span style="{SQUARE};background:{colours[index]}"></span> ' if colours else ""
        colour = ";color:#e03131" if index in red else ""
        lines.append(_row("td", row, right, colour, mark))
    style = "font-size:0.8em;border-collapse:collapse;margin:0.4em 0.75em;width:calc(100% - 1.5em)"
    return f'<table style="{style}">{"".join(lines)}</table>'


def _row(tag: str, cells: Sequence[str], right: Sequence[bool], colour: str = "", mark: str = "") -> str:
    """A row of a table; the mark stands before its first cell."""
    line = ""
    for cell, is_right in zip(cells, right, strict=True):
        # Only words that are wider than the page are broken.
        wrap = "anywhere" if max(map(len, cell.split()), default=0) > LONGEST_WORD else "normal"
        alignment = "right" if is_right else "left"
        style = f"text-align:{alignment};padding:0.15em 0.3em;border-bottom:1px solid #8884"
        line += f'<{tag} style="{style};overflow-wrap:{wrap}{colour}">{mark}{escape(one_line(cell))}</{tag}>'
        mark = ""
    return f"<tr>{line}</tr>"


def listing(lines: Iterable[str]) -> str:
    """Lines of text."""
    items = "".join(f"<div>{escape(one_line(line))}</div>" for line in lines)
    return f'<div style="font-size:0.8em;line-height:1.4;margin:0.3em 0.75em;overflow-wrap:anywhere">{items}</div>'
