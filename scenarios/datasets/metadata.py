"""Metadata of a data set: table of experiments, datasheet, licence, citation (CFF) and catalogue entry (Croissant)."""

import csv
import io
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from hmtb_twin import Status
from hmtb_twin.control.data_acquisition import BOARD
from hmtb_twin.parameters.values import SAMPLE_RATE
from scenarios.datasets.datasheet import datasheet
from scenarios.datasets.plan import JOURNAL, LICENSE, SUMS, DataSetPlan
from scenarios.datasets.spec import DataSetSpec
from scenarios.experiments.scenario import Scenario
from scenarios.files.hashes import bytes_hash, file_hash
from scenarios.files.netcdf import read_netcdf

TABLE = "experiments.csv"
"""The experiments as a table."""

METADATA = (TABLE, "README.md", "LICENSE", "CITATION.cff", "croissant.json")
"""The files of metadata, in the order in which they are written."""

COLUMNS = {
    "name": ("sc:Text", "Name of the experiment and of its files"),
    "part": ("sc:Text", "train, validation or test"),
    "block": ("sc:Text", "Block of records of the spec that asks for it"),
    "arm": ("sc:Text", "Arm under its conditions"),
    "joints": ("sc:Text", "Joints whose commands are the inputs and whose angles the outputs, separated by spaces"),
    "samples": ("sc:Integer", "Samples of the record"),
    "duration": ("sc:Float", "Length of the record, s"),
    "file": ("sc:Text", "Its record, a NetCDF4 file"),
    "bytes": ("sc:Integer", "Size of that file, 0 where there is none"),
    "sha256": ("sc:Text", "SHA-256 of that file, - where there is none"),
    "velocity_limited": ("sc:Integer", "Published samples in which a command moved as fast as its limit allows"),
    "clipped": ("sc:Integer", "Published samples in which a converter stood at an end of its range"),
    "status": ("sc:Text", "ok, or why there is no record"),
}
"""Columns of the table of experiments: type in Croissant and description; no cell is empty."""

LICENSE_NAME = "Creative Commons Attribution 4.0 International"
LICENSE_URL = "https://creativecommons.org/licenses/by/4.0/"
"""Its summary; the full text is at `legalcode` below it."""

THESIS = "Comparison of System Identification Techniques for the Hydraulic Manipulator Test Bed (HMTB)"
"""The report whose experiments the laboratory follows [Morris1996]."""

METHODS = (
    "Simulated with a MuJoCo model of a seven-joint hydraulic arm, its servos, hand controller and 1553 record at "
    "50 Hz. Built from a spec; every random draw comes from one seed."
)

MOST_LISTED = 1000
"""Files that the catalogue entry lists one by one; in larger data sets those of one kind in one folder become a set."""

FEW = 20
"""Files of one kind in one folder that are listed one by one in any data set."""

NETCDF = "application/x-netcdf"
MEDIA_TYPES = {
    ".nc": NETCDF,
    ".csv": "text/csv",
    ".json": "application/json",
    ".toml": "application/toml",
    ".md": "text/markdown",
    ".cff": "application/yaml",
}
"""Media types by file ending; other files are plain text."""

CROISSANT_TERMS = (
    "citeAs column conformsTo equivalentProperty extract field fileProperty fileObject fileSet format includes "
    "isLiveDataset jsonPath key md5 parentField path recordSet references regex repeated replace samplingRate "
    "separator source subField transform"
)
CROISSANT_CONTEXT: Mapping[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    **{term: f"cr:{term}" for term in CROISSANT_TERMS.split()},
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}
"""The JSON-LD context that Croissant 1.0 prescribes."""


def metadata_files(folder: Path, spec: DataSetSpec, index: Mapping[str, Any]) -> dict[str, bytes]:
    """Write the metadata of a data set whose records, truth and baselines are in its folder.

    Args:
        folder: Folder of the data set; metadata that is there already is ignored.
        spec: Its spec.
        index: Its index of experiments.

    Returns:
        Contents by path in the folder. The same folder gives the same bytes.
    """
    plan, data_hash = DataSetPlan(spec), index["hash"]
    rows = _experiment_rows(folder, plan, index["experiments"])
    paths = _listed_paths(folder)
    texts = {
        TABLE: _csv(rows),
        "README.md": datasheet(folder, plan, data_hash, rows, paths, (reference(spec), bibtex(spec, data_hash))),
        "LICENSE": _license_text(spec),
        "CITATION.cff": citation_cff(spec, data_hash),
    }
    sets = _file_sets(paths)
    objects = [_file_object(TABLE, texts[TABLE].encode())]
    objects += [_file_object(path, folder / path) for path in paths if _pattern(path) not in sets.values()]
    objects += [_file_object(path, text.encode()) for path, text in texts.items() if path != TABLE]
    entry = _croissant(spec, data_hash, objects, sets)
    texts["croissant.json"] = json.dumps(entry, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    return {path: text.encode() for path, text in texts.items()}


def _experiment_rows(folder: Path, plan: DataSetPlan, entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row of the table per experiment, in the order of the plan."""
    rows = []
    for number, entry in enumerate(entries):
        path = folder / entry["file"]
        recorded = not entry["failed"]
        limited, clipped = _limited_samples(path, plan, number) if recorded else (0, 0)
        duration = plan.duration(number)
        rows.append(
            {
                **{key: entry[key] for key in ("name", "part", "block", "arm", "file")},
                "joints": " ".join(entry["joints"]),
                "samples": round(SAMPLE_RATE * duration) if recorded else 0,
                "duration": duration if recorded else 0.0,
                "bytes": path.stat().st_size if recorded else 0,
                "sha256": file_hash(path) if recorded else "-",
                "velocity_limited": limited,
                "clipped": clipped,
                "status": entry["failed"] or "ok",
            }
        )
    return rows


def _limited_samples(path: Path, plan: DataSetPlan, number: int) -> tuple[int, int]:
    """Numbers of samples of a record with a command at its velocity limit, and with a clipped converter."""
    status = read_netcdf(path, only=("status",)).variables["status"].values
    clipped = (status & Status.CONVERTER_SATURATED) != 0
    experiment = plan[number].experiment
    # The excitation computer clips before the flags are set. Waveforms with withheld seeds cannot be recomputed.
    if isinstance(experiment, Scenario) and not plan.spec.withheld:
        for one in experiment.excitation:
            clipped = clipped | BOARD.exceeds_range(one.requested_volts(experiment.duration)[: len(clipped), 0])
    return int(np.count_nonzero(status & Status.VELOCITY_LIMITED)), int(np.count_nonzero(clipped))


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(COLUMNS), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _license_text(spec: DataSetSpec) -> str:
    """Notice for the data set, then the licence in full, which Creative Commons gave to the public domain."""
    text = files("scenarios").joinpath("data", "licenses", "CC-BY-4.0.txt").read_text(encoding="utf-8")
    notice = (
        f"The data set {spec.label}, by {'; '.join(spec.creators)}, is licensed under\n"
        f"{LICENSE_NAME} (SPDX: {LICENSE}).\n"
        f"Summary: {LICENSE_URL}\nFull text, also below: {LICENSE_URL}legalcode\n"
    )
    return f"{notice}\n{'=' * 71}\n\n{text.strip()}\n"


def citation_cff(spec: DataSetSpec, data_hash: str) -> str:
    """Write the citation file, CFF 1.2.0.

    Args:
        spec: The data set.
        data_hash: Hash of its arrays.
    """
    fields = {
        "cff-version": "1.2.0",
        "message": "If you use these data, please cite them, and the thesis whose experiments they follow.",
        "type": "dataset",
        "title": spec.title,
        "abstract": spec.description,
        "version": str(spec.version),
        "license": LICENSE,
        "date-released": spec.date,
        "url": spec.url,
        "authors": [_author(name) for name in spec.creators],
        "keywords": list(dict.fromkeys(spec.keywords)),
        "identifiers": [
            {"type": "other", "value": f"sha256:{data_hash}", "description": f"Hash of all arrays of {spec.label}"}
        ],
        "references": [
            {
                "type": "report",
                "title": THESIS,
                "authors": [{"family-names": "Morris", "given-names": "A. T."}],
                "institution": {"name": "NASA Langley Research Center"},
                "number": "NASA TM-110279",
                "year": 1996,
            },
            {"type": "software", "title": "HMTB twin", "authors": [{"name": "The HMTB twin contributors"}]},
        ],
    }
    # JSON texts are YAML texts, and always quoted: a YAML reader takes an unquoted day for a date, not for a text.
    return "".join(f"{key}: {json.dumps(value, ensure_ascii=False)}\n" for key, value in fields.items() if value)


def _author(name: str) -> dict[str, str]:
    """A person is written ``"Family, Given"``; anything else is a group."""
    family, comma, given_names = name.partition(", ")
    return {"family-names": family, "given-names": given_names} if comma and given_names else {"name": name}


def reference(spec: DataSetSpec) -> str:
    """Return the data set as one line of a bibliography."""
    year = f" ({spec.date[:4]})" if spec.date else ""
    url = f" {spec.url}" if spec.url else ""
    return f"{'; '.join(spec.creators)}{year}: {spec.title}. Data set {spec.name}, version {spec.version}.{url}"


def bibtex(spec: DataSetSpec, data_hash: str) -> str:
    """Return the BibTeX entry of the data set.

    Args:
        spec: The data set.
        data_hash: Hash of its arrays.
    """
    fields = {
        "title": f"{{{spec.title}}}",
        "author": " and ".join(f"{{{name}}}" if ", " not in name else name for name in spec.creators),
        "year": spec.date[:4],
        "version": str(spec.version),
        "url": spec.url,
        "note": f"SHA-256 of all arrays {data_hash}",
    }
    lines = (f"  {key} = {{{value}}},\n" for key, value in fields.items() if value)
    return f"@misc{{{spec.label},\n" + "".join(lines) + "}\n"


def _listed_paths(folder: Path) -> list[str]:
    """Paths of the files of a data set in order, except metadata, checksums and notes of the build."""
    skipped = {SUMS, *METADATA}
    paths = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in paths if path not in skipped and not path.startswith(JOURNAL))


def _file_sets(paths: Sequence[str]) -> Mapping[str, str]:
    """Patterns of files that are too many to list, by the name of the set."""
    if len(paths) <= MOST_LISTED:
        return {}
    counts = Counter(map(_pattern, paths))
    return {p.replace("/*.", "-").replace("/", "-"): p for p, count in counts.items() if count > FEW}


def _pattern(path: str) -> str:
    folder, _, name = path.rpartition("/")
    return f"{folder}/*{Path(name).suffix}" if folder else name


def _file_object(path: str, content: bytes | Path) -> Mapping[str, Any]:
    """A file of the catalogue entry, from its content or from the file on disk."""
    if isinstance(content, Path):
        size, digest = content.stat().st_size, file_hash(content)
    else:
        size, digest = len(content), bytes_hash(content)
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": path,
        "contentUrl": path,
        "contentSize": f"{size} B",
        "encodingFormat": MEDIA_TYPES.get(Path(path).suffix, "text/plain"),
        "sha256": digest,
    }


def _croissant(
    spec: DataSetSpec, data_hash: str, objects: Sequence[Mapping[str, Any]], sets: Mapping[str, str]
) -> Mapping[str, Any]:
    """Describe the data set in Croissant 1.0.

    The format knows no NetCDF: records are file objects, or sets of files where there are many. What can be read
    through it row by row is the table of experiments.
    """
    sets_of_files = [
        {"@type": "cr:FileSet", "@id": name, "name": name, "encodingFormat": NETCDF, "includes": pattern}
        for name, pattern in sets.items()
    ]
    columns = [
        {
            "@type": "cr:Field",
            "@id": f"experiments/{name}",
            "name": f"experiments/{name}",
            "description": description,
            "dataType": kind,
            "source": {"fileObject": {"@id": TABLE}, "extract": {"column": name}},
        }
        for name, (kind, description) in COLUMNS.items()
    ]
    return {
        "@context": CROISSANT_CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": spec.label,
        "alternateName": spec.title,
        "description": spec.description or spec.title,
        "version": f"{spec.version}.0.0",
        "license": LICENSE_URL,
        **({"datePublished": spec.date} if spec.date else {}),
        **({"url": spec.url} if spec.url else {}),
        "creator": [{"@type": "sc:Organization", "name": name} for name in spec.creators],
        "keywords": list(spec.keywords),
        "citeAs": bibtex(spec, data_hash),
        "isLiveDataset": False,
        "rai:dataCollection": METHODS,
        "rai:dataLimitations": "A simulation: parameters that no document of the machine gives are assumed.",
        "rai:personalSensitiveInformation": "None.",
        "distribution": [*objects, *sets_of_files],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": "experiments",
                "name": "experiments",
                "description": "One row per experiment; each record is a NetCDF4 file.",
                "key": {"@id": "experiments/name"},
                "field": columns,
            }
        ],
    }
