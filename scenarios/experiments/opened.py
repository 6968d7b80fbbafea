"""What was opened, in words and tables and with a log to replay: logs, records of the bus, and scenarios."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, simulate
from hmtb_twin.run.playback import pictured_arm, pictured_log
from scenarios.experiments.joint_inputs import STILL
from scenarios.experiments.recipe import Recipe
from scenarios.experiments.run_review import log_summary
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from scenarios.files.record_file import read_records


@dataclass(frozen=True, eq=False)
class Opened:
    """Something that was opened.

    Attributes:
        kind: What it is.
        place: Path or name by which it is opened again.
        recipe: The same without the page.
        tables: Title, headings and rows of each table.
        lines: What else there is to say.
        part: Part of it that was opened; empty for all of it.
        parts: Names of its parts.
        log: What can be replayed, or None.
        complete: Whether other tabs may use the log: it comes from the twin, not from a bus.
    """

    kind: str
    place: str
    recipe: Recipe
    tables: Sequence[tuple[str, Sequence[str], Iterable[Sequence[str]]]] = ()
    lines: Sequence[str] = ()
    part: str = ""
    parts: Sequence[str] = ()
    log: JointLog | None = None
    complete: bool = True


def moved_joints(log: JointLog) -> tuple[str, ...]:
    """Joints whose command moves; all of them if none does."""
    return tuple(joint for joint, way in zip(JOINTS, np.ptp(log.felt, axis=0), strict=True) if way > STILL) or JOINTS


def open_log(log: JointLog, place: str = "") -> Opened:
    """Open a log of the twin, from a file or of this session."""
    log = log if log.name.isprintable() else replace(log, name=one_line(log.name))
    pictured_arm(log)  # refuses arms that the laboratory does not have
    summary, moved, file = log_summary(log), moved_joints(log), place or f"{log.name}.nc"
    joint = next((name for name in moved if name in STUDIED_JOINTS), moved[0])
    toml = log.provenance.get("scenario", "")
    commands = [
        *([("hmtb", "simulate", f"{log.name}.toml")] if toml and not place else []),
        ("hmtb", "view", file),
        ("hmtb", "video", file, "--out", f"{log.name}.mp4"),
        ("hmtb", "compare", file, "--joint", joint, "--models", "truth"),
    ]
    code = f"from hmtb_twin import JointLog\n\nlog = JointLog.load({file!r})"
    return Opened(
        "log of the twin",
        place or log.name,
        Recipe(commands, code, toml, f"{log.name}.toml"),
        [("", ("log", "length", "converter clips", "command rate-limited"), [summary.row])],
        ["; ".join(f"{name}: {fact}" for name, fact in summary.facts), *summary.remarks],
        log=log,
    )


def open_scenario(scenario: Scenario, source: str) -> Opened:
    """Open a scenario: it is simulated first."""
    result = simulate([scenario])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    code = f"import hmtb_twin, scenarios\n\n(log,) = hmtb_twin.simulate([scenarios.load({source!r})])"
    commands = [("hmtb", command, source) for command in ("simulate", "view", "video")]
    recipe = Recipe(commands, code, scenario.to_toml(), f"{scenario.name}.toml")
    return replace(open_log(result.logs[0]), kind="scenario, simulated now", place=source, recipe=recipe)


def open_bus_record(path: Path, part: str) -> Opened:
    """Open a record of the bus, one test of it, with the arm where it measured the angles."""
    contents = read_records(path)
    names = [record.name for record in contents.records]
    record = contents.choose(part or names[0], path)
    joint = next((axis for axis in record.axes if axis in JOINTS), STUDIED_JOINTS[-1])
    command = ("hmtb", "identify", str(path), "--joint", joint, *(("--test", record.name) if names[1:] else ()))
    code = f"from scenarios.files.data_file import read_parts\n\nparts = read_parts({str(path)!r}, joint={joint!r}"
    row = (record.name, f"{len(record) * record.dt:g} s", ", ".join(record.axes), f"{100 * record.lost.mean():.3g} %")
    return Opened(
        "record of the bus",
        str(path),
        Recipe([command], code + f", test={record.name!r})" if names[1:] else code + ")"),
        [("", ("record", "length", "axes", "ticks with losses"), [row])],
        [*filter(None, [contents.message]), "the arm follows the measured angles; what was lost stays as it was"],
        record.name,
        names if names[1:] else (),
        pictured_log(record),
        complete=False,
    )
