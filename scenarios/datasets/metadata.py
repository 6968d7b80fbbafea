"""Metadata of a data set: table of experiments, datasheet [Gebru2021], licence, citation (CFF), Croissant."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from html import escape
from importlib.resources import files
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin import Status
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.files.hashes import bytes_hash, file_hash
from hmtb_twin.files.netcdf import read_netcdf
from hmtb_twin.parameters.arm_description import ArmDescription
from hmtb_twin.parameters.drives import Actuator
from hmtb_twin.parameters.values import RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import JOINTS, OPERATING_POSE
from scenarios.datasets.index import hash_of_records, paths_of_files
from scenarios.datasets.plan import ATTAINABLE, BASELINES, BUILD, JOURNAL, LICENSE, SUMS, TRUTH, DataSetPlan
from scenarios.datasets.record_block import PARTS, PAYLOAD
from scenarios.datasets.spec import UNITS, DataSetSpec
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
    # Markdown, JSON and YAML, no pages of HTML.
    autoescape=False,
    # A misspelt name is an error, not an empty text.
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
# A bar or a line feed would end the cell of a table in Markdown.
ENVIRONMENT.filters["cell"] = lambda value: " ".join(str(value).split()).replace("|", "\\|") or "-"
ENVIRONMENT.filters["digits"] = lambda number: f"{float(number):.4g}" if number else "-"
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
    paths = _data_paths(folder)
    context = _context(folder, spec, index, paths)

    def render(template: str) -> str:
        return ENVIRONMENT.get_template(template).render(context)

    rows = context["rows"]
    texts = {
        "experiments.csv": table_text(rows[0], rows),
        "README.md": render("datasheet.md.j2"),
        "LICENSE": render("LICENSE.j2"),
        "CITATION.cff": render("CITATION.cff.j2"),
    }
    # The catalogue entry describes the other metadata too, so it comes last.
    context |= _catalogued_files(folder, paths, texts)
    catalogue_entry = json.loads(render("croissant.json.j2"))
    texts["croissant.json"] = json.dumps(catalogue_entry, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return {path: text.encode() for path, text in texts.items()}


def _data_paths(folder: Path) -> list[str]:
    """Paths of the files that the metadata describe, without the metadata themselves."""
    paths = []
    for path in paths_of_files(folder):
        # SQLite keeps files of its own beside the journal.
        if path not in {SUMS, *METADATA} and not path.startswith(JOURNAL) and (folder / path).is_file():
            paths.append(path)
    return paths


def _context(folder: Path, spec: DataSetSpec, index: Mapping[str, Any], paths: Sequence[str]) -> dict[str, Any]:
    """What the templates of the metadata are rendered from."""
    experiments = index["experiments"]
    machines = [arm_named(name) for name in spec.machines]
    joints = tuple(dict.fromkeys(chain(JOINTS, *(arm.joints for arm in machines))))
    rows = _experiment_rows(folder, DataSetPlan(spec), experiments)
    first_file = next(listed["file"] for listed in experiments if not listed["failed"])
    records_hash = hash_of_records(experiments)
    build = json.loads((folder / BUILD).read_text(encoding="utf-8"))
    license_text = files("scenarios").joinpath("data", "licenses", "CC-BY-4.0.txt").read_text(encoding="utf-8")
    return {
        "spec": spec,
        "whole": records_hash,
        "rows": rows,
        "recorded": [row for row in rows if row["status"] == "ok"],
        "failed": [row for row in rows if row["status"] != "ok"],
        # The last experiment on each arm, in the order of their first.
        "arms": list({listed["arm"]: listed for listed in experiments}.values()),
        # Arms of other machines, of which rules supplied what no file says.
        "machines": [_machine(arm) for arm in machines],
        "test_bed": any(not block.arm for block in spec.records),
        "late": _late(spec),
        "channels": _channels(folder / first_file, joints),
        "truths": _truths(folder, paths, joints),
        "versions": {**build["versions"], "source": build["source"]},
        "attainable": read_table(folder / ATTAINABLE),
        "baselines": read_table(folder / BASELINES),
        "license": LICENSE,
        "license_url": LICENSE_URL,
        "license_text": license_text,
        "authors": [_author(name) for name in spec.creators],
        "bibtex": bibtex(spec, records_hash),
    }


def _machine(arm: ArmDescription) -> dict[str, Any]:
    """What the datasheet says of an arm of another machine."""
    hydraulic = any(isinstance(drive, Actuator) for drive in arm.actuators.values())
    return {
        "name": arm.name,
        "joints": arm.joints,
        "drives": "hydraulic" if hydraulic else "electric",
        "given": len(arm.numbers) - len(arm.assumed),
        "assumed": len(arm.assumed),
    }


def _author(name: str) -> dict[str, str]:
    """An author of the citation file: a person is written "Family, Given"; anything else is a group."""
    family_names, _, given_names = name.partition(", ")
    if given_names:
        return {"family-names": family_names, "given-names": given_names}
    return {"name": name}


def _catalogued_files(folder: Path, paths: Sequence[str], texts: Mapping[str, str]) -> dict[str, Any]:
    """Files of the catalogue entry with their sizes and hashes, and patterns of those that it has as sets."""
    # Files of one kind in one folder become a set where all together are too many to list.
    counts = Counter(map(_pattern, paths)) if len(paths) > MOST_LISTED else Counter[str]()
    patterns = [pattern for pattern, count in counts.items() if count > FEW]
    of_texts = []
    for path, text in texts.items():
        content = text.encode()
        of_texts.append((path, len(content), bytes_hash(content)))
    of_files = []
    for path in paths:
        if _pattern(path) not in patterns:
            of_files.append((path, (folder / path).stat().st_size, file_hash(folder / path)))
    return {"sets": patterns, "objects": [*of_texts[:1], *of_files, *of_texts[1:]]}


def bibtex(spec: DataSetSpec, whole: str) -> str:
    """Citation of a data set with that hash of all records."""
    return ENVIRONMENT.get_template("citation.bib.j2").render(spec=spec, whole=whole)


def _experiment_rows(folder: Path, plan: DataSetPlan, experiments: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the table of experiments, in the order of the plan; no cell is empty."""
    rows = []
    for index, listed in enumerate(experiments):
        row = {key: listed[key] for key in ("name", "part", "block", "arm")} | {"joints": " ".join(listed["joints"])}
        if listed["failed"]:
            row |= {"samples": 0, "duration": 0.0, "file": listed["file"], "bytes": 0, "sha256": "-"}
            row |= {"velocity_limited": 0, "clipped": 0, "status": listed["failed"]}
        else:
            row |= _record_cells(folder, plan, index, listed["file"])
        rows.append(row)
    return rows


def _record_cells(folder: Path, plan: DataSetPlan, index: int, file: str) -> dict[str, Any]:
    """The cells of an experiment's row that describe its record."""
    path, experiment, duration = folder / file, plan[index].experiment, plan.duration(index)
    status = read_netcdf(path, only=("status",)).variables["status"].values
    clipped = (status & Status.CONVERTER_SATURATED) != 0
    # The excitation computer clips before the flags are set. Waveforms with withheld seeds cannot be recomputed.
    if isinstance(experiment, Scenario) and not plan.spec.withheld:
        for signal in experiment.excitation:
            volts = signal.requested_volts(duration)[: len(clipped), 0]
            clipped = clipped | BOARD.exceeds_range(volts)
    return {
        "samples": round(SAMPLE_RATE * duration),
        "duration": duration,
        "file": file,
        "bytes": path.stat().st_size,
        "sha256": file_hash(path),
        "velocity_limited": np.count_nonzero(status & Status.VELOCITY_LIMITED),
        "clipped": np.count_nonzero(clipped),
        "status": "ok",
    }


def _pattern(path: str) -> str:
    """Pattern of the files of one kind in one folder."""
    folder, _, name = path.rpartition("/")
    return f"{folder}/*{Path(name).suffix}" if folder else name


def _late(spec: DataSetSpec) -> list[tuple[str, int]]:
    """Joints whose angle reaches the record late on an arm of the data set, with the delay in samples."""
    names = dict.fromkeys(chain.from_iterable(block.arms for block in spec.records))
    delays: dict[str, int] = {}
    for arm in map(arm_named, names):
        for joint in arm.joints:
            delays[joint] = max(arm.bus[joint].delay, delays.get(joint, 0))
    return [(joint, delay) for joint, delay in delays.items() if delay]


def _channels(path: Path, joints: Sequence[str]) -> list[dict[str, str]]:
    """The variables of a file; of those that every joint has, one line for all."""
    lines: dict[str, dict[str, str]] = {}
    for name, variable in read_netcdf(path).variables.items():
        line = {key: str(variable.attributes.get(key, "")) for key in ("units", "role", "long_name")}
        line |= {"name": _of_any(joints, name), "dims": ", ".join(_of_any(joints, along) for along in variable.dims)}
        lines.setdefault(line["name"], line)
    return list(lines.values())


def _of_any(joints: Sequence[str], name: str) -> str:
    """The name with JOINT in the place of the joint that it begins with."""
    for joint in joints:
        if name.startswith(f"{joint}_"):
            return name.replace(joint, "JOINT", 1)
    return name


def _truths(folder: Path, paths: Sequence[str], joints: Sequence[str]) -> list[tuple[str, int, list[dict[str, str]]]]:
    """Folders of the truth: name, number of files, and the channels of the first file if it is one of arrays."""
    paths_of_name: dict[str, list[str]] = {}
    for path in paths:
        if path.startswith(f"{TRUTH}/"):
            paths_of_name.setdefault(path.split("/")[1], []).append(path)
    truths = []
    for name, group in paths_of_name.items():
        # Tables lie beside the folders.
        ending = "/" if group[0].count("/") > 1 else ""
        channels = _channels(folder / group[0], joints) if group[0].endswith(".nc") else []
        truths.append((f"{TRUTH}/{name}{ending}", len(group), channels))
    return truths
