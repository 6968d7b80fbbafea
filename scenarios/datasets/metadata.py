"""The papers of a data set: what a stranger needs to understand, cite, find and check it."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.citation import citation_cff, datacite
from scenarios.datasets.croissant import croissant
from scenarios.datasets.data_package import data_package, experiments_schema, table_schema
from scenarios.datasets.datasheet import datasheet
from scenarios.datasets.experiment_table import experiment_csv, experiment_rows
from scenarios.datasets.license import license_text
from scenarios.datasets.listing import MOST_LISTED, NETCDF, file_paths, listed, listed_text
from scenarios.datasets.plan import Plan
from scenarios.datasets.spec import DataSetSpec

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
