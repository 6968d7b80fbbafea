"""Long tables of the report as CSV files beside it: rendered by the templates, taken off the page, linked."""

import csv
import io
import re
from pathlib import Path
from xml.etree import ElementTree

from markupsafe import Markup, escape

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError


def _rows(markup: str) -> tuple[str, list[list[str]]]:
    """Caption and rows of the tables in a text; the heading of a group of rows becomes their first cell."""
    # Templates write well-formed tables but for the line break and the one entity that XML lacks.
    text = str(markup).replace("<br>", "<br/>").replace("&nbsp;", " ")
    root = ElementTree.fromstring(f"<div>{text}</div>")
    rows: list[list[str]] = []
    group = ""
    for part in root.iter():
        head = part.tag == "thead"
        for row in part.findall("tr"):
            if row.get("class") == "group":
                group = _text(row[0], head)
                continue
            rows.append(["" if head else group])
            for cell in row:
                rows[-1] += [_text(cell, head)] + [""] * (int(cell.get("colspan", 1)) - 1)
    return _text(next(root.iter("caption")), True), rows


def _text(cell: ElementTree.Element, head: bool) -> str:
    for line_break in cell.iter("br"):
        line_break.text = " " if head else " / "
    # Programs read ASCII minus signs.
    return " ".join("".join(cell.itertext()).split()).replace("−", "-")


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
        caption, rows = _rows(markup)
        rows = [row for k, row in enumerate(rows) if k == 0 or row != rows[0]]
        if not any(row[0] for row in rows):
            rows = [row[1:] for row in rows]
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(rows)
        self.texts[name] = text.getvalue()
        file = f"tables/{name}.csv"
        return Markup('<p class="file">Table <a href="{0}">{0}</a>, {1} rows: {2}</p>').format(
            file, len(rows) - 1, escape(caption)
        )

    def write(self, folder: Path) -> None:
        """Write every table as a CSV file into a folder, which is made where there is none."""
        folder.mkdir(exist_ok=True)
        for name, text in self.texts.items():
            write_whole(folder / f"{name}.csv", text)
