"""The papers of a data set: what a stranger needs to understand, cite, find and check it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenarios.datasets.citation import citation_cff, datacite
from scenarios.datasets.croissant import croissant
from scenarios.datasets.data_package import data_package, experiments_schema, table_schema
from scenarios.datasets.datasheet import datasheet
from scenarios.datasets.experiment_table import experiment_csv, experiment_rows
from scenarios.datasets.layout import DATA, PARTS, TRUTH
from scenarios.datasets.license import license_text
from scenarios.datasets.listing import MOST_LISTED, NETCDF, file_paths, listed, listed_text
from scenarios.datasets.plan import Plan
from scenarios.datasets.spec import DataSetSpec

TABLE = "experiments.csv"
"""The experiments as a table."""

PAPERS = (TABLE, "README.md", "LICENSE", "CITATION.cff", "datacite.json", "datapackage.json", "croissant.json")
"""Their names, in the order in which they are written."""


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
    size = sum((folder / path).stat().st_size for path in paths)
    sizes = (f"{len(rows)} experiments", f"{len(paths)} files of data, truth and spec", f"{size} bytes")
    texts["datacite.json"] = _json(datacite(spec, whole, sizes, (NETCDF, "text/csv", "application/json")))
    folders = {} if len(paths) <= MOST_LISTED else _folders(paths)
    shown = [listed(folder, p) for p in paths if not (folders and p.endswith(".nc"))]
    shown += [listed_text(place, text) for place, text in texts.items() if place != TABLE]
    table = listed_text(TABLE, texts[TABLE])
    schemas = {p: table_schema((folder / p).read_text(encoding="utf-8")) for p in paths if p.endswith(".csv")}
    schemas[TABLE] = experiments_schema()
    texts["datapackage.json"] = _json(data_package(spec, whole, [table, *shown], schemas))
    texts["croissant.json"] = _json(croissant(spec, whole, table, shown, folders))
    return {place: text.encode() for place, text in texts.items()}


def _folders(paths: list[str]) -> Mapping[str, str]:
    """Patterns of the records, by the name of the set: a folder of each part, and of each kind of truth."""
    found = {path.rpartition("/")[0] for path in paths if path.endswith(".nc")}
    known = [f"{DATA}/{part}" for part in PARTS]
    ordered = [one for one in known if one in found] + sorted(one for one in found if one.startswith(f"{TRUTH}/"))
    return {one.replace("/", "-"): f"{one}/*.nc" for one in ordered}


def _json(record: Mapping[str, Any]) -> str:
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
