"""The metadata of a data set: README, licence, citation, catalogue."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from scenarios.datasets.citation import citation_cff, datacite
from scenarios.datasets.croissant import croissant
from scenarios.datasets.data_package import data_package, experiments_schema, table_schema
from scenarios.datasets.datasheet import datasheet
from scenarios.datasets.experiment_table import experiment_csv, experiment_rows
from scenarios.datasets.layout import LOCK, MANIFEST, SUMS
from scenarios.datasets.plan import Plan
from scenarios.datasets.spec import DataSetSpec
from scenarios.files.hashes import bytes_hash, file_hash

SPDX = "CC-BY-4.0"
"""Its identifier."""

NAME = "Creative Commons Attribution 4.0 International"
"""Its name."""

URL = "https://creativecommons.org/licenses/by/4.0/"
"""Where its summary stands; the full text is at `legalcode` below it."""


def license_text(label: str, creators: tuple[str, ...]) -> str:
    """The notice for a data set and the full text of the licence; Creative Commons gave that text to the public domain.

    Args:
        label: Name of the data set with its version.
        creators: Who is to be named.
    """
    notice = (
        f"The data set {label}, by {'; '.join(creators)}, is licensed under\n"
        f"{NAME} (SPDX: {SPDX}).\n"
        f"Summary: {URL}\nFull text, also below: {URL}legalcode\n"
    )
    text = files("scenarios").joinpath("data", "licenses", "CC-BY-4.0.txt").read_text(encoding="utf-8")
    return f"{notice}\n{'=' * 71}\n\n{text.strip()}\n"


MOST_LISTED = 1000
"""Files that a catalogue lists one by one; of more it names the folders, and SHA256SUMS has every file."""

NETCDF = "application/x-netcdf"
"""Media type of the records."""

MEDIA = {
    ".nc": NETCDF,
    ".csv": "text/csv",
    ".json": "application/json",
    ".toml": "application/toml",
    ".md": "text/markdown",
    ".cff": "application/yaml",
    ".parquet": "application/vnd.apache.parquet",
}
"""Media types by ending; other files are plain text."""


@dataclass(frozen=True)
class Listed:
    """A file.

    Attributes:
        path: Its place in the folder.
        size: In bytes.
        sha256: Its hash.
    """

    path: str
    size: int
    sha256: str

    @property
    def suffix(self) -> str:
        """Ending of its name."""
        return Path(self.path).suffix

    @property
    def media(self) -> str:
        """Its media type."""
        return MEDIA.get(self.suffix, "text/plain")


def file_paths(folder: Path, *, without: Sequence[str] = ()) -> list[str]:
    """Places of the files of a data set in order, but for its checksums, the notes of the build and those given.

    Args:
        folder: That of the data set.
        without: Places to leave out.
    """
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(p for p in found if p not in (SUMS, MANIFEST, LOCK, *without) and not p.endswith(".partial"))


def listed(folder: Path, path: str) -> Listed:
    """A file on the disk."""
    return Listed(path, (folder / path).stat().st_size, file_hash(folder / path))


def listed_text(path: str, text: str) -> Listed:
    """A file that is yet to be written."""
    content = text.encode()
    return Listed(path, len(content), bytes_hash(content))


TABLE = "experiments.csv"
"""The experiments as a table."""

PAPERS = (TABLE, "README.md", "LICENSE", "CITATION.cff", "datacite.json", "datapackage.json", "croissant.json")
"""Their names, in the order in which they are written."""


FEW = 20
"""Files of one kind in one folder that are listed one by one in any data set."""


def papers(folder: Path, spec: DataSetSpec, index: Mapping[str, Any]) -> dict[str, bytes]:
    """The papers of a data set whose records, truth and baselines are in its folder.

    Args:
        folder: That of the data set; papers that are there already count for nothing.
        spec: Its spec.
        index: Its index of experiments.

    Returns:
        Content by place in the folder. The same folder gives the same bytes.
    """
    plan = Plan(spec)
    whole = index["hash"]
    rows = experiment_rows(folder, plan, index["experiments"])
    paths = file_paths(folder, without=PAPERS)
    texts = {
        TABLE: experiment_csv(rows),
        "README.md": datasheet(folder, plan, whole, rows, more=paths),
        "LICENSE": license_text(spec.label, spec.creators),
        "CITATION.cff": citation_cff(spec, whole),
    }
    there = [row for row in rows if row["status"] == "ok"]
    # The manifest and the checksums stand beside what is listed.
    count = len(paths) + len(PAPERS) + 2
    sizes = (f"{len(there)} records", f"{sum(row['bytes'] for row in there)} bytes of records", f"{count} files")
    texts["datacite.json"] = _json(datacite(spec, whole, sizes, (NETCDF, "text/csv", "application/json")))
    sets = _sets(paths)
    shown = [listed(folder, path) for path in paths if _pattern(path) not in sets.values()]
    shown += [listed_text(place, text) for place, text in texts.items() if place != TABLE]
    table = listed_text(TABLE, texts[TABLE])
    schemas = {p: table_schema((folder / p).read_text(encoding="utf-8")) for p in paths if p.endswith(".csv")}
    schemas[TABLE] = experiments_schema()
    texts["datapackage.json"] = _json(data_package(spec, whole, [table, *shown], schemas))
    texts["croissant.json"] = _json(croissant(spec, whole, table, shown, sets))
    return {place: text.encode() for place, text in texts.items()}


def _sets(paths: list[str]) -> Mapping[str, str]:
    """Patterns of the files that are too many to list, by the name of the set: those of one kind in one folder."""
    if len(paths) <= MOST_LISTED:
        return {}
    kinds = Counter(map(_pattern, paths))
    return {one.replace("/*.", "-").replace("/", "-"): one for one, count in kinds.items() if count > FEW}


def _pattern(path: str) -> str:
    folder, _, name = path.rpartition("/")
    return f"{folder}/*{Path(name).suffix}" if folder else name


def _json(record: Mapping[str, Any]) -> str:
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
