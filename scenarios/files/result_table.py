"""A table of a result, as commands print it and pages show it."""

from collections.abc import Sequence
from typing import NamedTuple


class ResultTable(NamedTuple):
    """A table of texts.

    Attributes:
        title: Its title.
        columns: Headings; empty where there are none.
        rows: Cells.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
