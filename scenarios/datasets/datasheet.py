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

from hmtb_twin import Status
from hmtb_twin.parameters.values import JOINTS, RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import variant_named
from scenarios.datasets.excitation_text import conditions, played
from scenarios.datasets.layout import ATTAINABLE, BASELINES, BUILD, PARTS, TRUTH
from scenarios.datasets.plan import DataSetPlan
from scenarios.datasets.spec_tables import UNITS, Scoring
from scenarios.files.netcdf import Contents, read_netcdf

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

FLAGS = {
    Status.VELOCITY_LIMITED: "a command moved as fast as its limit allows",
    Status.JOINT_LIMITED: "a command stood at an end of its joint's range",
    Status.SINGULAR: "the tool could not move as asked near a singular pose",
    Status.CONVERTER_SATURATED: "a count of the hand controller stood at an end of its converter",
    Status.SHUT_DOWN: "emergency shutdown: servo power off, valves closed",
    Status.UNIT_HELD: "the end effector held the replacement unit",
}
"""Flags of the control computer."""


@dataclass(frozen=True)
class Limits:
    """How much of some records was limited.

    Attributes:
        velocity: Samples in which a command moved as fast as its limit allows, percent.
        clipped: Samples in which a converter stood at an end of its range, percent.
        clipped_records: In how many records.
        records: Of how many.
    """

    velocity: float
    clipped: float
    clipped_records: int
    records: int


@dataclass(frozen=True)
class Channel:
    """A variable of a file, as the datasheet lists it."""

    name: str
    dims: str
    unit: str
    role: str
    meaning: str


def datasheet(
    folder: Path,
    plan: DataSetPlan,
    whole: str,
    rows: Sequence[Mapping[str, Any]],
    more: Sequence[str],
    citation: tuple[str, str],
) -> str:
    """The datasheet, Markdown; it depends on what is in the folder alone, never on when it is written.

    Args:
        folder: That of the data set, without its papers.
        plan: The plan.
        whole: Hash of its arrays.
        rows: The table of experiments.
        more: Places of every other file.
        citation: Line of a bibliography, and BibTeX entry.
    """
    spec = plan.spec
    there = [row for row in rows if row["status"] == "ok"]
    first = read_netcdf(folder / there[0]["file"]) if there else Contents({}, {})
    return ENVIRONMENT.get_template("datasheet.md.j2").render(
        spec=spec,
        whole=whole,
        rate=SAMPLE_RATE,
        parts=[(*_sum_of(part, rows), _limits(plan, rows)) for part, rows in _by("part", PARTS, there)],
        blocks=[
            (block, len(rows), _length(rows), played(block), conditions(block), _limits(plan, rows))
            for block, (_, rows) in zip(
                spec.records, _by("block", [block.name for block in spec.records], there), strict=True
            )
        ],
        flags=FLAGS,
        rows_shown=MOST_ROWS,
        late=_late(plan),
        tests=sum(row["part"] == "test" for row in there),
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
        floor=UNITS.get(spec.scoring.unit, 1.0) * sqrt(RECORDER.noise**2 + RECORDER.resolver_step**2 / 12),
        floor_unit=spec.scoring.unit if spec.scoring.unit in UNITS else "rad",
        noise=RECORDER.noise,
        step=RECORDER.resolver_step,
        example=there[0]["file"] if there else "data/train/NAME.nc",
        reference=citation[0],
        bibtex=citation[1],
    )


def _by(
    key: str, values: Sequence[str], rows: Sequence[Mapping[str, Any]]
) -> list[tuple[str, list[Mapping[str, Any]]]]:
    """Rows of the table of experiments by what stands in a column, in a given order."""
    found: dict[str, list[Mapping[str, Any]]] = {value: [] for value in values}
    for row in rows:
        found[row[key]].append(row)
    return list(found.items())


def _sum_of(part: str, rows: Sequence[Mapping[str, Any]]) -> tuple[str, int, int, float, float]:
    """Experiments, samples, hours and megabytes of a part."""
    seconds = sum(row["duration"] for row in rows)
    return part, len(rows), sum(row["samples"] for row in rows), seconds / 3600, sum(row["bytes"] for row in rows) / 1e6


def _limits(plan: DataSetPlan, rows: Sequence[Mapping[str, Any]]) -> Limits:
    """How much of some records was limited; of scored ones of a data set with hidden truth as much as is given."""
    whole = sum(row["samples"] for row in rows)
    if plan.spec.withheld:
        most = {row["name"]: plan.spec.window if row["part"] == "test" else row["samples"] for row in rows}
        whole = sum(min(row["samples"], most[row["name"]]) for row in rows)
    clipped = sum(row["clipped"] for row in rows)
    share = 100.0 / max(whole, 1)
    return Limits(
        share * sum(row["velocity_limited"] for row in rows),
        share * clipped,
        sum(row["clipped"] > 0 for row in rows),
        len(rows),
    )


def _length(rows: Sequence[Mapping[str, Any]]) -> str:
    """Length of the records of a block, from the shortest to the longest."""
    lengths = sorted({row["duration"] for row in rows})
    return " to ".join(f"{value:g} s" for value in dict.fromkeys((lengths[0], lengths[-1]))) if lengths else "-"


def _late(plan: DataSetPlan) -> list[tuple[str, int]]:
    """Joints whose angle reaches the record late on an arm of the data set, with how many samples."""
    buses = [variant_named(name).bus for name in {name for block in plan.spec.records for name in block.variants}]
    delays = {joint: max(bus[joint].delay for bus in buses) for joint in JOINTS}
    return [(joint, delay) for joint, delay in delays.items() if delay]


def _arms(plan: DataSetPlan) -> list[tuple[str, ...]]:
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
            _of_any_joint(name),
            ", ".join(map(_of_any_joint, variable.dims)),
            str(variable.attributes.get("units", "")),
            str(variable.attributes.get("role", "")),
            str(variable.attributes.get("long_name", "")),
        )
        for name, variable in contents.variables.items()
    ]
    return list({line.name: line for line in reversed(lines)}.values())[::-1]


def _of_any_joint(name: str) -> str:
    return next((name.replace(joint, "JOINT", 1) for joint in JOINTS if name.startswith(f"{joint}_")), name)


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
