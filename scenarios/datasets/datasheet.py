"""The datasheet of a data set, its README [Gebru2021]."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import islice
from math import sqrt
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hmtb_twin import Status
from hmtb_twin.parameters.values import JOINTS, OPERATING_POSE, RECORDER, SAMPLE_RATE
from hmtb_twin.parameters.variants import variant_named
from scenarios.datasets.plan import ATTAINABLE, BASELINES, BUILD, TRUTH, DataSetPlan
from scenarios.datasets.spec_tables import PARTS, PAYLOAD, UNITS, RecordBlock, Scoring
from scenarios.experiments.excitation_computer import Excitation
from scenarios.experiments.multisines import Multisines
from scenarios.experiments.waveform import POINTS, Parameter
from scenarios.files.netcdf import read_netcdf

Row = Mapping[str, Any]
"""A row of the table of experiments."""

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
"""Contents of the folders of the truth."""

FLAGS = {
    Status.VELOCITY_LIMITED: "a command moved as fast as its limit allows",
    Status.JOINT_LIMITED: "a command stood at an end of its joint's range",
    Status.SINGULAR: "the tool could not move as asked near a singular pose",
    Status.CONVERTER_SATURATED: "a count of the hand controller stood at an end of its converter",
    Status.SHUT_DOWN: "emergency shutdown: servo power off, valves closed",
    Status.UNIT_HELD: "the end effector held the replacement unit",
}
"""Flags of the control computer."""


KINDS = {"prbs": "pseudorandom binary sequence", "points": "points of a file"}
"""Names of excitations that their kind does not tell."""

MODES = {
    "single_joint": "the stick commands {joints}",
    "single_joint_rate": "the stick commands velocities of {joints}",
    "cartesian": "the stick commands where the tool is",
    "cartesian_rate": "the stick commands velocities of the tool",
}
"""Control modes."""


def datasheet(
    folder: Path,
    plan: DataSetPlan,
    data_hash: str,
    rows: Sequence[Row],
    paths: Sequence[str],
    citation: tuple[str, str],
) -> str:
    """Write the datasheet, Markdown; it depends on what is in the folder alone, never on when it is written.

    Args:
        folder: Folder of the data set.
        plan: The plan.
        data_hash: Hash of its arrays.
        rows: The table of experiments.
        paths: Paths of its files in the folder, without metadata.
        citation: Line of a bibliography, and BibTeX entry.
    """
    spec = plan.spec
    recorded = [row for row in rows if row["status"] == "ok"]
    example = recorded[0]["file"] if recorded else "data/train/NAME.nc"
    by_part = {part: [row for row in recorded if row["part"] == part] for part in PARTS}
    by_block = [(block, [row for row in recorded if row["block"] == block.name]) for block in spec.records]
    return ENVIRONMENT.get_template("datasheet.md.j2").render(
        spec=spec,
        whole=data_hash,
        rate=SAMPLE_RATE,
        parts=[(part, *_sizes(some), _limits(plan, some)) for part, some in by_part.items()],
        blocks=[
            (block, len(some), _length(some), played(block), conditions(block), _limits(plan, some))
            for block, some in by_block
        ],
        flags=FLAGS,
        rows_shown=MOST_ROWS,
        late=_late(plan),
        tests=len(by_part["test"]),
        arms=_arms(plan),
        arms_in_all=len({row["arm"] for row in rows}),
        failed=[row for row in rows if row["status"] != "ok"],
        experiments=len(rows),
        channels=_channels(folder / example) if recorded else [],
        truths=_truths(folder, paths),
        versions=_versions(folder),
        attainable=_first_rows(folder / ATTAINABLE),
        baselines=_first_rows(folder / BASELINES),
        metric=_metric(spec.scoring),
        floor=UNITS.get(spec.scoring.unit, 1.0) * sqrt(RECORDER.noise**2 + RECORDER.resolver_step**2 / 12),
        floor_unit=spec.scoring.unit if spec.scoring.unit in UNITS else "rad",
        noise=RECORDER.noise,
        step=RECORDER.resolver_step,
        example=example,
        reference=citation[0],
        bibtex=citation[1],
    )


def _sizes(rows: Sequence[Row]) -> tuple[int, int, float, float]:
    """Records, samples, hours and megabytes of some experiments."""
    hours = sum(row["duration"] for row in rows) / 3600
    return len(rows), sum(row["samples"] for row in rows), hours, sum(row["bytes"] for row in rows) / 1e6


def _limits(plan: DataSetPlan, rows: Sequence[Row]) -> dict[str, float]:
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
        "records": len(rows),
    }


def _length(rows: Sequence[Row]) -> str:
    """Length of the records of a block, from the shortest to the longest."""
    lengths = sorted({row["duration"] for row in rows})
    return " to ".join(f"{value:g} s" for value in dict.fromkeys((lengths[0], lengths[-1]))) if lengths else "-"


def _late(plan: DataSetPlan) -> list[tuple[str, int]]:
    """Joints whose angle reaches the record late on an arm of the data set, with the delay in samples."""
    buses = [variant_named(name).bus for name in {name for block in plan.spec.records for name in block.variants}]
    delays = {joint: max(bus[joint].delay for bus in buses) for joint in JOINTS}
    return [(joint, delay) for joint, delay in delays.items() if delay]


def _arms(plan: DataSetPlan) -> list[tuple[str, ...]]:
    """The first arms with their conditions."""
    arms: dict[str, tuple[str, ...]] = {}
    for entry in plan:
        one = entry.experiment
        arms.setdefault(
            entry.arm, (entry.arm, one.variant, one.payload, one.pose, one.plant.actuator, one.plant.friction)
        )
        if len(arms) == MOST_ARMS:
            break
    return list(arms.values())


def _channels(path: Path) -> list[dict[str, str]]:
    """The variables of a file; of those that every joint has, one line for all."""
    lines: dict[str, dict[str, str]] = {}
    for name, variable in read_netcdf(path).variables.items():
        words = {key: str(variable.attributes.get(key, "")) for key in ("units", "role", "long_name")}
        line = {
            "name": _of_any_joint(name),
            "dims": ", ".join(map(_of_any_joint, variable.dims)),
            "unit": words["units"],
            "role": words["role"],
            "meaning": words["long_name"],
        }
        lines.setdefault(line["name"], line)
    return list(lines.values())


def _of_any_joint(name: str) -> str:
    return next((name.replace(joint, "JOINT", 1) for joint in JOINTS if name.startswith(f"{joint}_")), name)


def _truths(folder: Path, paths: Sequence[str]) -> list[tuple[str, int, str, list[dict[str, str]]]]:
    """Folders of the truth: name, files, meaning, and the channels of the first file if it is one of arrays."""
    kinds: dict[str, list[str]] = {}
    for path in paths:
        top, *rest = path.split("/")
        if top == TRUTH and rest:
            kinds.setdefault(rest[0], []).append(path)
    return [
        (
            f"{TRUTH}/{name}" + ("/" if len(some) > 1 or some[0].count("/") > 1 else ""),
            len(some),
            TRUTHS.get(Path(name).stem, ""),
            _channels(folder / some[0]) if some[0].endswith(".nc") else [],
        )
        for name, some in kinds.items()
    ]


def _versions(folder: Path) -> Mapping[str, str]:
    """Software that the data set was built with, and the hash of its own source."""
    if not (folder / BUILD).is_file():
        return {}
    record = json.loads((folder / BUILD).read_text(encoding="utf-8"))
    return {**record["versions"], "source": record["source"]}


def _first_rows(path: Path) -> list[dict[str, str]]:
    """The first rows of a table, none where there is no such file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as stream:
        return list(islice(csv.DictReader(stream), MOST_ROWS))


def _metric(scoring: Scoring) -> tuple[str, str]:
    """Name with unit and formula of the primary score."""
    return {
        "rmse": (f"root mean square error, {scoring.unit}", "sqrt(mean((y - yhat)^2))"),
        "nrmse": ("normalised root mean square error, percent", "100 sqrt(mean((y - yhat)^2)) / std(y)"),
        "fit": ("fit, percent", "100 (1 - norm(y - yhat) / norm(y - mean(y)))"),
    }[scoring.metric]


def played(block: RecordBlock) -> str:
    """Describe what the records of a block are excited by."""
    if block.multisines is not None:
        text = _multisines(block, block.multisines)
    elif block.scenarios:
        text = f"scenarios, as `hmtb scenarios show NAME` prints each: {', '.join(block.scenarios)}"
    else:
        text = _excitations(block)
    if block.amplitudes:
        unit = "rad root mean square" if block.multisines is not None else "V"
        text += f"; at {', '.join(f'{value:g}' for value in block.amplitudes)} {unit}"
    if not block.draw_waveforms:
        return text
    return f"{text}; drawn anew for each {'experiment' if block.multisines is None else 'measurement'}"


def conditions(block: RecordBlock) -> str:
    """Describe arms, payloads, poses, drives and control mode of a block."""
    own = bool(block.scenarios)
    varied = {
        "variant": block.variants,
        "payload": ("that of the scenario",) if own and block.payloads == (PAYLOAD,) else block.payloads,
        "pose": ("that of the scenario",) if own and block.poses == (OPERATING_POSE,) else block.poses,
        "actuators": block.actuators,
        "friction": block.frictions,
    }
    phrases = [f"{key} {', '.join(values)}" for key, values in varied.items()]
    if any(block.process_noises):
        phrases.append(f"process noise {', '.join(f'{value:g}' for value in block.process_noises)} of the rated torque")
    together = len(block.axes) > 1 and not block.each_axis
    joints = "several joints at once, an axis of the stick for each" if together else "one joint"
    phrases.append("mode of the scenario" if own else MODES[block.mode].format(joints=joints))
    off = [] if own else [entry.name for entry in fields(block.chain) if not getattr(block.chain, entry.name)]
    return "; ".join([*phrases, *(f"without {name.replace('_', ' ')}" for name in off)])


def _multisines(block: RecordBlock, one: Multisines) -> str:
    records = len(block.axes) if not block.each_axis else 1
    rms = "" if block.amplitudes else f" of {one.rms:g} rad root mean square"
    times = f" x {records} records, with phases that are orthogonal over these," if records > 1 else ""
    return (
        f"random-phase multisines{rms}, {one.f_min:g} to {one.f_max:g} Hz, "
        f"{'odd lines of a grid' if one.odd else 'lines'} {1.0 / one.period:.4g} Hz apart; {one.realisations} "
        f"realisations{times} of {one.settling} + {one.periods} periods of {one.period:g} s, the first "
        f"{'one' if one.settling == 1 else one.settling} to settle"
    )


def _excitations(block: RecordBlock) -> str:
    texts = [excitation(one, drawn=block.draw_waveforms, amplitude=not block.amplitudes) for one in block.excitation]
    if len(texts) == 1:
        shared = len(block.axes) > 1 and not block.each_axis
        return f"one waveform that all axes share: {texts[0]}" if shared else texts[0]
    if len(set(texts)) == 1:
        return f"a waveform of its own on each axis: {texts[0]}"
    return "; ".join(f"{axis}: {text}" for axis, text in zip(block.axes, texts, strict=True))


def excitation(one: Excitation, *, drawn: bool, amplitude: bool = True) -> str:
    """Describe an excitation, with frequencies and times as it is played.

    Args:
        one: The excitation.
        drawn: Whether every experiment draws its own, so that the seed of the spec is not used.
        amplitude: Whether its amplitude is the one that is played.
    """
    wave = one.waveform()
    unscaled = Excitation(one.kind, one.parameters).waveform()
    faster = wave.update_rate / unscaled.update_rate
    skipped = {"seed"} if drawn else set()
    skipped |= set() if amplitude else {"amplitude"}
    words = [
        word
        for key, value in wave.parameters.items()
        if key not in skipped
        for word in _parameter(key, value, faster, wave.update_rate)
    ]
    words.append(f"{POINTS} points, repeated every {POINTS / wave.update_rate:.4g} s")
    if one.iterations is not None:
        words.append(f"{one.iterations} times, then nothing")
    return f"{KINDS.get(one.kind, one.kind.replace('_', ' '))} ({', '.join(words)})"


def _parameter(key: str, value: Parameter, faster: float, rate: float) -> Iterator[str]:
    """A parameter with its unit; what says nothing is left out."""
    name = key.replace("_", " ")
    match key, value:
        case _, tuple():
            return
        case _, bool():
            if value:
                yield name
        case "amplitude", _:
            yield f"amplitude {value:g} V"
        case "clock", _:
            yield f"a level for {value / rate:.4g} s"
        case "register", _:
            if value:
                yield f"register of {value} bits"
        case "pulse_width", _:
            yield f"{name} {value / faster:.4g} s"
        case _ if key == "frequency" or key.startswith("f_"):
            yield f"{name.replace('f ', 'f_')} {value * faster:.4g} Hz"
        case _:
            yield f"{name} {value:g}"
