"""The datasheet of a data set, its README [Gebru2021]."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from math import sqrt
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin.parameters import JOINTS, RECORDER, SAMPLE_RATE
from scenarios.dataset_papers.citation import bibtex, reference
from scenarios.datasets.layout import ATTAINABLE, BASELINES, BUILD, PARTS, TRUTH
from scenarios.datasets.netcdf import Contents, read_netcdf
from scenarios.datasets.plan import Plan
from scenarios.datasets.records import Records
from scenarios.datasets.scoring import UNITS, Scoring
from scenarios.excitation_computer import Excitation

MOST_ARMS = 30
"""Arms whose conditions the datasheet lists; of more, the first ones."""

MOST_ROWS = 30
"""Rows of other tables that it repeats."""

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

TRUTHS = {
    "signals": "What the analyst does not see of each experiment",
    "arms": "Small-signal truth of each arm: matrices, poles, zeros, bandwidths, noise model",
    "best-linear": "Best linear approximation for the conditions of an experiment",
    "attainable": "Noise floors and best attainable scores",
}
"""What stands in the folders of the truth."""


@dataclass(frozen=True)
class Channel:
    """A variable of a file, as the datasheet lists it."""

    name: str
    dims: str
    unit: str
    role: str
    meaning: str


def datasheet(folder: Path, plan: Plan, whole: str, rows: Sequence[Mapping[str, Any]], *, more: Sequence[str]) -> str:
    """The datasheet, Markdown; it depends on what is in the folder alone, never on when it is written.

    Args:
        folder: That of the data set, without its papers.
        plan: The plan.
        whole: Hash of its arrays.
        rows: The table of experiments.
        more: Places of every other file.
    """
    spec = plan.spec
    there = [row for row in rows if row["status"] == "ok"]
    first = read_netcdf(folder / there[0]["file"]) if there else Contents({}, {})
    return ENVIRONMENT.get_template("datasheet.md.j2").render(
        spec=spec,
        whole=whole,
        rate=SAMPLE_RATE,
        parts=[_sum_of(part, [row for row in there if row["part"] == part]) for part in PARTS],
        blocks=[
            (block, *_block(block, [row for row in there if row["block"] == block.name])) for block in spec.records
        ],
        arms=_arms(plan),
        arms_in_all=len({row["arm"] for row in rows}),
        failed=[row for row in rows if row["status"] != "ok"],
        experiments=len(rows),
        channels=_channels(first),
        truths=_truths(folder, more),
        more=more,
        versions=_versions(folder),
        attainable=_table(folder, ATTAINABLE, more),
        baselines=_table(folder, BASELINES, more),
        metric=_metric(spec.scoring),
        floor=UNITS[spec.scoring.unit] * sqrt(RECORDER.noise**2 + RECORDER.resolver_step**2 / 12),
        noise=RECORDER.noise,
        step=RECORDER.resolver_step,
        example=there[0]["file"] if there else "data/train/NAME.nc",
        reference=reference(spec),
        bibtex=bibtex(spec, whole),
    )


def _sum_of(part: str, rows: Sequence[Mapping[str, Any]]) -> tuple[str, int, int, float, float]:
    """Experiments, samples, hours and megabytes of a part."""
    seconds = sum(row["duration"] for row in rows)
    return part, len(rows), sum(row["samples"] for row in rows), seconds / 3600, sum(row["bytes"] for row in rows) / 1e6


def _block(block: Records, rows: Sequence[Mapping[str, Any]]) -> tuple[int, str, str, str, str]:
    """Records, length of one, what is played, on which axes, under which conditions."""
    lengths = sorted({row["duration"] for row in rows})
    length = " to ".join(f"{value:g} s" for value in dict.fromkeys((lengths[0], lengths[-1]))) if lengths else "-"
    if block.multisines is not None:
        one = block.multisines
        played = (
            f"random-phase multisines{', odd lines' if one.odd else ''}, {one.f_min:g} to {one.f_max:g} Hz, "
            f"{one.realisations} realisations of {one.periods} periods of {one.period:g} s"
        )
    elif block.scenarios:
        played = f"scenarios {', '.join(block.scenarios)}"
    else:
        played = "; ".join(_played(entry, drawn=block.draw_waveforms) for entry in block.excitation)
    if block.draw_waveforms:
        played += "; drawn anew for each experiment"
    if block.amplitudes:
        unit = "rad (root mean square)" if block.multisines is not None else "V"
        played += f"; amplitudes {', '.join(f'{a:g}' for a in block.amplitudes)} {unit}"
    axes = f"{', '.join(block.axes)}{', each alone' if block.each_axis else ''}" if block.axes else "of the scenario"
    varied = {
        "variants": block.variants,
        "payloads": block.payloads,
        "poses": block.poses,
        "actuators": block.actuators,
        "frictions": block.frictions,
        "process noise": block.process_noises,
        "mode": (block.mode,),
    }
    conditions = "; ".join(f"{key} {', '.join(map(str, values))}" for key, values in varied.items())
    return len(rows), length, played, axes, conditions


def _played(entry: Excitation, *, drawn: bool) -> str:
    """An excitation in words; where every experiment draws its own, the seed that is written is that of none."""
    told = ", ".join(f"{key} {value}" for key, value in entry.parameters.items() if not (drawn and key == "seed"))
    return f"{entry.kind} ({told})" if told else entry.kind


def _arms(plan: Plan) -> list[tuple[str, ...]]:
    """The first arms with their conditions."""
    found: dict[str, tuple[str, ...]] = {}
    for entry in plan:
        if entry.arm not in found:
            one = entry.experiment
            plant = one.plant
            found[entry.arm] = (one.variant, one.payload, one.pose, plant.actuator, plant.friction)
        if len(found) == MOST_ARMS:
            break
    return [(name, *conditions) for name, conditions in found.items()]


def _channels(contents: Contents) -> list[Channel]:
    """The variables of a file; of those that every joint has, one line for all."""
    lines = [
        Channel(
            next((name.replace(joint, "JOINT", 1) for joint in JOINTS if name.startswith(f"{joint}_")), name),
            ", ".join(variable.dims),
            str(variable.attributes.get("units", "")),
            str(variable.attributes.get("role", "")),
            str(variable.attributes.get("long_name", "names" if variable.values.dtype.kind == "U" else "")),
        )
        for name, variable in contents.variables.items()
    ]
    return list({line.name: line for line in reversed(lines)}.values())[::-1]


def _truths(folder: Path, more: Sequence[str]) -> list[tuple[str, int, str, list[Channel]]]:
    """Folders of the truth: name, files, meaning, and the channels of the first file if it is one of arrays."""
    found: dict[str, list[str]] = {}
    for path in more:
        top, *rest = path.split("/")
        if top == TRUTH and rest:
            found.setdefault(rest[0], []).append(path)
    return [
        (
            f"{TRUTH}/{name}" + ("/" if len(paths) > 1 or paths[0].count("/") > 1 else ""),
            len(paths),
            TRUTHS.get(Path(name).stem, ""),
            _channels(read_netcdf(folder / paths[0])) if paths[0].endswith(".nc") else [],
        )
        for name, paths in found.items()
    ]


def _versions(folder: Path) -> Mapping[str, str]:
    """Software that the data set was built with, and the hash of its own source."""
    if not (folder / BUILD).is_file():
        return {}
    record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
    return {**record["versions"], "source": record["source"]}


def _table(folder: Path, place: str, more: Sequence[str]) -> list[dict[str, str]]:
    """The first rows of a table, none where there is no such file."""
    if place not in more:
        return []
    with (folder / place).open(encoding="utf-8", newline="") as stream:
        return list(islice(csv.DictReader(stream), MOST_ROWS))


def _metric(scoring: Scoring) -> tuple[str, str]:
    """The primary score: its name with unit, and its formula."""
    if scoring.metric == "rmse":
        return f"root mean square error, {scoring.unit}", "sqrt(mean((y - yhat)^2))"
    if scoring.metric == "nrmse":
        return "normalised root mean square error, percent", "100 sqrt(mean((y - yhat)^2)) / std(y)"
    return "fit, percent", "100 (1 - norm(y - yhat) / norm(y - mean(y)))"
