"""Long tables of the report as CSV files beside it: rendered by the templates, taken off the page, linked."""

import csv
import io
import re
from pathlib import Path

from markupsafe import Markup

from hmtb_twin.files.atomic_write import write_whole
from scenarios.files.errors import ScenarioError

GROUP = "## "
"""Mark at the start of a line that is a heading for the rows below it."""


class LongTables:
    """Tables that the page only links; `texts` has the contents of their files by name, without suffix."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}

    def take(self, markup: str, name: str) -> Markup:
        """Keep a table of the page as a file and return a link in its place.

        Args:
            markup: A line each for the caption, the names of the columns and the rows, cells apart by broken bars. A
                line that begins with `## ` heads the rows below it and becomes their first cell.
            name: Name of the file, without suffix.

        Raises:
            ScenarioError: The name is no file name, or taken.
        """
        if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) or name in self.texts:
            raise ScenarioError(f"table name {name!r}: expected words of a-z and 0-9 apart by hyphens, each name once")
        # Programs read ASCII minus signs.
        plain = Markup(markup).unescape().replace("−", "-")
        caption, head, *lines = (" ".join(line.split()) for line in plain.splitlines() if line.strip())
        column_names = _cells(head.rstrip("¦ "))
        rows = [["", *column_names]]
        group = ""
        for line in lines:
            if line.startswith(GROUP):
                group = line.removeprefix(GROUP)
                continue
            # Rows of the templates may end early or with a bar too many: each becomes as long as the first.
            cells = _cells(line) + [""] * len(column_names)
            rows.append([group, *cells[: len(column_names)]])
        # Without headings, the column of headings would be empty.
        if not group:
            rows = [row[1:] for row in rows]
        file = io.StringIO()
        # By default the module ends lines by CR and LF.
        csv.writer(file, lineterminator="\n").writerows(rows)
        self.texts[name] = file.getvalue()
        return Markup('<p class="file">Table <a href="{0}">{0}</a>, {1} rows: {2}</p>').format(
            f"tables/{name}.csv", len(rows) - 1, caption
        )

    def write(self, folder: Path) -> None:
        """Write every table as a CSV file into a folder, which is made where there is none."""
        folder.mkdir(exist_ok=True)
        for name, contents in self.texts.items():
            write_whole(folder / f"{name}.csv", contents)


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("¦")]
