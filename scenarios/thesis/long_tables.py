"""Long tables of the report as CSV files beside it: rendered by the templates, taken off the page, linked."""

import csv
import io
import re
from html.parser import HTMLParser
from pathlib import Path

from markupsafe import Markup, escape

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError


class _Rows(HTMLParser):
    """Rows of the tables in a text; the heading of a group of rows becomes their first cell."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.caption = ""
        self._cell: list[str] | None = None
        self._span, self._group, self._grouped, self._head = 1, "", False, False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        if tag == "tr":
            self.rows.append([])
            self._grouped = attributes.get("class") == "group"
        elif tag in ("td", "th", "caption"):
            self._cell, self._span = [], int(attributes.get("colspan") or 1)
        elif tag == "thead":
            self._head = True
        elif tag == "br" and self._cell is not None:
            self._cell.append(" " if self._head else " / ")

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self._cell.append(data)

    def handle_endtag(self, tag: str) -> None:
        if tag == "thead":
            self._head = False
        elif tag == "tr":
            if self._grouped:
                self._group = self.rows.pop()[0]
            elif self.rows[-1]:
                self.rows[-1].insert(0, "" if self._head else self._group)
        elif tag in ("td", "th", "caption") and self._cell is not None:
            # Programs read ASCII minus signs.
            text = " ".join("".join(self._cell).split()).replace("−", "-")
            self._cell = None
            if tag == "caption":
                self.caption = self.caption or text
            else:
                self.rows[-1] += [text] + [""] * (self._span - 1)


class LongTables:
    """Tables that the page only links.

    Attributes:
        texts: Contents of the files by name, without suffix.
    """

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}

    def take(self, markup: str, name: str) -> Markup:
        """Keep the tables of a piece of the page, of the same columns, as one file and return a link in their place.

        Raises:
            ScenarioError: The name (without suffix) is no file name, or taken.
        """
        if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) or name in self.texts:
            raise ScenarioError(f"table name {name!r}: expected words of a-z and 0-9 apart by hyphens, each name once")
        table = _Rows(markup)
        rows = [row for k, row in enumerate(table.rows) if row and (k == 0 or row != table.rows[0])]
        if not any(row[0] for row in rows):
            rows = [row[1:] for row in rows]
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        self.texts[name] = text.getvalue()
        file = f"tables/{name}.csv"
        return Markup('<p class="file">Table <a href="{0}">{0}</a>, {1} rows: {2}</p>').format(
            file, len(rows) - 1, escape(table.caption)
        )

    def write(self, folder: Path) -> None:
        """Write every table as a CSV file into a folder, which is made where there is none."""
        folder.mkdir(exist_ok=True)
        for name, text in self.texts.items():
            write_whole(folder / f"{name}.csv", text)
