"""Metadata of a data set: table of experiments, datasheet [Gebru2021], licence, citation (CFF), Croissant."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from html import escape
from importlib.resources import files
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin import Status
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.files.hashes import bytes_hash, file_hash
from hmtb_twin.files.netcdf import read_netcdf
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import variant_named
from scenarios.datasets.index import hash_of_records, paths_of_files
from scenarios.datasets.plan import ATTAINABLE, BASELINES, BUILD, JOURNAL, LICENSE, SUMS, TRUTH, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.datasets.spec_tables import PARTS, PAYLOAD, UNITS
from scenarios.datasets.tables import read_table, table_text
from scenarios.experiments.scenario import Scenario
from scenarios.experiments.waveform import POINTS

METADATA = ("experiments.csv", "README.md", "LICENSE", "CITATION.cff", "croissant.json")
"""The files of metadata, in the order in which they are written."""

MOST_LISTED = 1000
"""Files that the catalogue entry lists one by one; in larger data sets those of one kind in one folder become a set."""

LICENSE_URL = "https://creativecommons.org/licenses/by/4.0/"

FEW = 20
"""Files of one kind in one folder that are listed one by one in any data set."""

ENVIRONMENT = Environment(
    loader=PackageLoader("scenarios"),
    autoescape=False,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
ENVIRONMENT.filters["cell"] = lambda value: " ".join(str(value).split()).replace("|", "\\|") or "-"
ENVIRONMENT.filters["digits"] = lambda text: f"{float(text):.4g}" if text else "-"
ENVIRONMENT.filters["short"] = lambda value: f"{value:.6g}"
ENVIRONMENT.filters["json"] = lambda value: json.dumps(value, ensure_ascii=False)
ENVIRONMENT.filters["fields"] = vars
ENVIRONMENT.filters["text"] = partial(escape, quote=False)  # pages of Markdown take HTML
ENVIRONMENT.globals |= {"pose": OPERATING_POSE, "payload": PAYLOAD, "points": POINTS, "changed": replace}
ENVIRONMENT.globals |= {"rate": SAMPLE_RATE, "recorder": RECORDER, "parts": PARTS, "units": UNITS, "status": Status}


def metadata_files(folder: Path, spec: DataSetSpec, index: Mapping[str, Any]) -> dict[str, bytes]:
    """Write the metadata of a data set whose records, truth and baselines are in its folder.

    Args:
        folder: Folder of the data set; metadata that is there already is ignored.
        spec: Its spec.
        index: Its index of experiments.

    Returns:
        Contents by path in the folder. They depend on what is in the folder alone, never on when they are written.
    """
    plan = DataSetPlan(spec)
    rows = _experiment_rows(folder, plan, index["experiments"])
    there = [path for path in paths_of_files(folder) if (folder / path).is_file() and not path.startswith(JOURNAL)]
    paths = [path for path in there if path not in {SUMS, *METADATA}]
    build = json.loads((folder / BUILD).read_text(encoding="utf-8"))
    # A person is written "Family, Given"; anything else is a group.
    names = [(name, *name.partition(", ")[::2]) for name in spec.creators]
    context: dict[str, Any] = {
        "spec": spec,
        "whole": hash_of_records(index["experiments"]),
        "recorded": [row for row in rows if row["status"] == "ok"],
        "failed": [row for row in rows if row["status"] != "ok"],
        "arms": list({entry["arm"]: entry for entry in index["experiments"]}.values()),
        "late": _late(spec),
        "channels": _channels(folder / next(entry["file"] for entry in index["experiments"] if not entry["failed"])),
        "truths": _truths(folder, paths),
        "versions": {**build["versions"], "source": build["source"]},
        "attainable": read_table(folder / ATTAINABLE),
        "baselines": read_table(folder / BASELINES),
        "license": LICENSE,
        "license_url": LICENSE_URL,
        "license_text": files("scenarios").joinpath("data", "licenses", "CC-BY-4.0.txt").read_text(encoding="utf-8"),
        "authors": [{"family-names": one, "given-names": own} if own else {"name": name} for name, one, own in names],
    }

    context["bibtex"] = bibtex(spec, context["whole"])

    def render(template: str) -> str:
        return ENVIRONMENT.get_template(template).render(context)

    texts = {
        "experiments.csv": table_text(rows[0], rows),
        "README.md": render("datasheet.md.j2"),
        "LICENSE": render("LICENSE.j2"),
        "CITATION.cff": render("CITATION.cff.j2"),
    }
    # Files of one kind in one folder become a set where all together are too many to list.
    counts = Counter(map(_pattern, paths if len(paths) > MOST_LISTED else ()))
    context["sets"] = [pattern for pattern, count in counts.items() if count > FEW]
    of_texts = [(path, len(text.encode()), bytes_hash(text.encode())) for path, text in texts.items()]
    listed = [path for path in paths if _pattern(path) not in context["sets"]]
    of_files = [(path, (folder / path).stat().st_size, file_hash(folder / path)) for path in listed]
    context["objects"] = [*of_texts[:1], *of_files, *of_texts[1:]]
    entry = json.loads(render("croissant.json.j2"))
    texts["croissant.json"] = json.dumps(entry, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return {path: text.encode() for path, text in texts.items()}


def bibtex(spec: DataSetSpec, whole: str) -> str:
    """Citation of a data set with that hash of all records."""
    return ENVIRONMENT.get_template("citation.bib.j2").render(spec=spec, whole=whole)


def _experiment_rows(folder: Path, plan: DataSetPlan, entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the table of experiments, in the order of the plan; no cell is empty."""
    rows = []
    for number, entry in enumerate(entries):
        path = folder / entry["file"]
        recorded, experiment, duration = not entry["failed"], plan[number].experiment, plan.duration(number)
        only = ("status",)
        status = read_netcdf(path, only=only).variables["status"].values if recorded else np.zeros(0, np.int64)
        clipped = (status & Status.CONVERTER_SATURATED) != 0
        # The excitation computer clips before the flags are set. Waveforms with withheld seeds cannot be recomputed.
        if isinstance(experiment, Scenario) and not plan.spec.withheld:
            for one in experiment.excitation:
                clipped = clipped | BOARD.exceeds_range(one.requested_volts(duration)[: len(clipped), 0])
        rows.append(
            {
                **{key: entry[key] for key in ("name", "part", "block", "arm")},
                "joints": " ".join(entry["joints"]),
                "samples": round(SAMPLE_RATE * duration) if recorded else 0,
                "duration": duration if recorded else 0.0,
                "file": entry["file"],
                "bytes": path.stat().st_size if recorded else 0,
                "sha256": file_hash(path) if recorded else "-",
                "velocity_limited": np.count_nonzero(status & Status.VELOCITY_LIMITED),
                "clipped": np.count_nonzero(clipped),
                "status": entry["failed"] or "ok",
            }
        )
    return rows


def _pattern(path: str) -> str:
    """Pattern of the files of one kind in one folder."""
    folder, _, name = path.rpartition("/")
    return f"{folder}/*{Path(name).suffix}" if folder else name


def _late(spec: DataSetSpec) -> list[tuple[str, int]]:
    """Joints whose angle reaches the record late on an arm of the data set, with the delay in samples."""
    buses = [variant_named(name).bus for name in {name for block in spec.records for name in block.variants}]
    delays = {joint: max(bus[joint].delay for bus in buses) for joint in JOINTS}
    return [(joint, delay) for joint, delay in delays.items() if delay]


def _channels(path: Path) -> list[dict[str, str]]:
    """The variables of a file; of those that every joint has, one line for all."""
    lines: dict[str, dict[str, str]] = {}
    for name, variable in read_netcdf(path).variables.items():
        line = {key: str(variable.attributes.get(key, "")) for key in ("units", "role", "long_name")}
        line |= {"name": _of_any_joint(name), "dims": ", ".join(map(_of_any_joint, variable.dims))}
        lines.setdefault(line["name"], line)
    return list(lines.values())


def _of_any_joint(name: str) -> str:
    return next((name.replace(joint, "JOINT", 1) for joint in JOINTS if name.startswith(f"{joint}_")), name)


def _truths(folder: Path, paths: Sequence[str]) -> list[tuple[str, int, list[dict[str, str]]]]:
    """Folders of the truth: name, number of files, and the channels of the first file if it is one of arrays."""
    truths = []
    for name, group in groupby(
        (path for path in paths if path.startswith(f"{TRUTH}/")), lambda path: path.split("/")[1]
    ):
        first, *others = group
        place = f"{TRUTH}/{name}" + ("/" if first.count("/") > 1 else "")
        truths.append((place, 1 + len(others), _channels(folder / first) if first.endswith(".nc") else []))
    return truths
