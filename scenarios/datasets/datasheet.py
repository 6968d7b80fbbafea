"""The datasheet of a data set, its README [Gebru2021]."""

import json
from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin import Status
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import variant_named
from scenarios.datasets.plan import ATTAINABLE, BASELINES, BUILD, TRUTH, DataSetPlan
from scenarios.datasets.spec_tables import PARTS, PAYLOAD, UNITS
from scenarios.datasets.tables import read_table
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.waveform import POINTS, Parameter
from scenarios.files.netcdf import read_netcdf

MOST_ROWS = 30
"""Rows of a table that the datasheet repeats; of more, the first ones."""

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
ENVIRONMENT.globals |= {"pose": OPERATING_POSE, "payload": PAYLOAD}


def datasheet(
    folder: Path, plan: DataSetPlan, rows: Sequence[Mapping[str, Any]], paths: Sequence[str], context: Mapping[str, Any]
) -> str:
    """Write the datasheet, Markdown; it depends on what is in the folder alone, never on when it is written.

    Args:
        folder: Folder of the data set.
        plan: The plan.
        rows: The table of experiments.
        paths: Paths of its files in the folder, without metadata.
        context: Spec, hash of all arrays and BibTeX entry, by their names in the template.
    """
    spec = plan.spec
    recorded = [row for row in rows if row["status"] == "ok"]
    by_part = {part: [row for row in recorded if row["part"] == part] for part in PARTS}
    by_block = {block: [row for row in recorded if row["block"] == block.name] for block in spec.records}
    example = recorded[0]["file"] if recorded else "data/train/NAME.nc"
    # Software that the data set was built with, and the hash of its own source; none of a folder that is written anew.
    build = json.loads((folder / BUILD).read_text(encoding="utf-8")) if (folder / BUILD).is_file() else {}
    return ENVIRONMENT.get_template("datasheet.md.j2").render(
        context,
        rate=SAMPLE_RATE,
        parts=[(part, some, _limits(plan, some)) for part, some in by_part.items()],
        blocks=[(block, some, _limits(plan, some)) for block, some in by_block.items()],
        status=Status,
        rows_shown=MOST_ROWS,
        late=_late(plan),
        tests=len(by_part["test"]),
        arms=_arms(plan),
        arms_in_all=len({row["arm"] for row in rows}),
        failed=[row for row in rows if row["status"] != "ok"],
        experiments=len(rows),
        channels=_channels(folder / example) if recorded else [],
        truths=_truths(folder, paths),
        versions={**build["versions"], "source": build["source"]} if build else {},
        attainable=read_table(folder / ATTAINABLE)[:MOST_ROWS],
        baselines=read_table(folder / BASELINES)[:MOST_ROWS],
        floor=UNITS.get(spec.scoring.unit, 1.0) * sqrt(RECORDER.noise**2 + RECORDER.resolver_step**2 / 12),
        floor_unit=spec.scoring.unit if spec.scoring.unit in UNITS else "rad",
        noise=RECORDER.noise,
        step=RECORDER.resolver_step,
        example=example,
    )


def _limits(plan: DataSetPlan, rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """How much of some records was limited: percent of the published samples, and records with clipped converters."""
    published = sum(
        min(row["samples"], plan.spec.window) if plan.spec.withheld and row["part"] == "test" else row["samples"]
        for row in rows
    )
    share = 100.0 / max(published, 1)
    return {
        "velocity": share * sum(row["velocity_limited"] for row in rows),
        "clipped": share * sum(row["clipped"] for row in rows),
        "clipped_records": sum(row["clipped"] > 0 for row in rows),
    }


def _late(plan: DataSetPlan) -> list[tuple[str, int]]:
    """Joints whose angle reaches the record late on an arm of the data set, with the delay in samples."""
    buses = [variant_named(name).bus for name in {name for block in plan.spec.records for name in block.variants}]
    delays = {joint: max(bus[joint].delay for bus in buses) for joint in JOINTS}
    return [(joint, delay) for joint, delay in delays.items() if delay]


def _arms(plan: DataSetPlan) -> list[tuple[str, ...]]:
    """The first arms with their conditions."""
    arms: dict[str, tuple[str, ...]] = {}
    for entry in plan:
        one, plant = entry.experiment, entry.experiment.plant
        arms[entry.arm] = (entry.arm, one.variant, one.payload, one.pose, plant.actuator, plant.friction)
        if len(arms) == MOST_ROWS:
            break
    return list(arms.values())


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
    kinds: dict[str, list[str]] = {}
    for path in paths:
        if path.startswith(f"{TRUTH}/"):
            kinds.setdefault(path.split("/")[1], []).append(path)
    return [
        (
            f"{TRUTH}/{name}" + ("/" if len(some) > 1 or some[0].count("/") > 1 else ""),
            len(some),
            _channels(folder / some[0]) if some[0].endswith(".nc") else [],
        )
        for name, some in kinds.items()
    ]


def excitation(one: Excitation, *, drawn: bool, amplitude: bool = True) -> str:
    """Describe an excitation, with frequencies and times as it is played.

    Args:
        one: The excitation.
        drawn: Whether every experiment draws its own, so that the seed of the spec is not used.
        amplitude: Whether its amplitude is the one that is played.
    """
    wave = one.waveform()
    faster = wave.update_rate / Excitation(one.kind, one.parameters).waveform().update_rate
    skipped = {"seed"} if drawn else set()
    skipped |= set() if amplitude else {"amplitude"}
    parameters = {key: value for key, value in wave.parameters.items() if key not in skipped}
    words = [_parameter(key, value, faster, wave.update_rate) for key, value in parameters.items()]
    words.append(f"{POINTS} points, repeated every {POINTS / wave.update_rate:.4g} s")
    if one.iterations is not None:
        words.append(f"{one.iterations} times, then nothing")
    kinds = {"prbs": "pseudorandom binary sequence", "points": "points of a file"}
    return f"{kinds.get(one.kind, one.kind.replace('_', ' '))} ({', '.join(filter(None, words))})"


ENVIRONMENT.filters["excitation"] = excitation


def _parameter(key: str, value: Parameter, faster: float, rate: float) -> str:
    """A parameter with its unit; empty where it says nothing."""
    if isinstance(value, bool | tuple):
        return key.replace("_", " ") if value is True else ""
    if key == "frequency" or key.startswith("f_"):
        return f"{key} {value * faster:.4g} Hz"
    texts = {
        "amplitude": f"amplitude {value:g} V",
        "clock": f"a level for {value / rate:.4g} s",
        "register": f"register of {value} bits" if value else "",
        "pulse_width": f"pulse width {value / faster:.4g} s",
    }
    return texts.get(key, f"{key.replace('_', ' ')} {value:g}")
