"""Logs, bus records and scenarios as the station presents them: in words and tables, with a log to replay."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, simulate
from hmtb_twin.run.playback import pictured_arm, pictured_log
from scenarios.experiments.joint_inputs import STILL
from scenarios.experiments.recipe import Recipe
from scenarios.experiments.run_review import COLUMNS, log_summary
from scenarios.experiments.scenario import Scenario
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from scenarios.files.record_file import read_records


@dataclass(frozen=True, eq=False)
class Presentation:
    """A log, record, scenario, data set or study in words and tables, with what can be replayed of it.

    Attributes:
        kind: What it is.
        place: Path or name by which it is opened again.
        recipe: The same without the page.
        tables: Title, headings and rows of each table.
        lines: What else there is to say.
        part: Part of it that is presented; empty for all of it.
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
    ranges = zip(log.joints, np.ptp(log.felt, axis=0), strict=True)
    return tuple(joint for joint, reach in ranges if reach > STILL) or log.joints


def present_log(log: JointLog, place: str = "") -> Presentation:
    """Present a log of the twin, from the file at a place, or of this session."""
    if not log.name.isprintable():
        log = replace(log, name=one_line(log.name))
    pictured_arm(log)  # refuses arms that the laboratory does not have
    summary, file = log_summary(log), place or f"{log.name}.nc"
    facts = "; ".join(f"{name}: {fact}" for name, fact in summary.facts)
    return Presentation(
        "log of the twin",
        place or log.name,
        _log_recipe(log, file, is_of_session=not place),
        [("", COLUMNS, [summary.row])],
        [facts, *summary.remarks],
        log=log,
    )


def _log_recipe(log: JointLog, file: str, *, is_of_session: bool) -> Recipe:
    """How to see and identify a log without the page; one of this session has to be simulated first."""
    moved = moved_joints(log)
    joint = next((name for name in moved if name in STUDIED_JOINTS), moved[0])
    toml, toml_file = log.provenance.get("scenario", ""), f"{log.name}.toml"
    commands = [
        ("hmtb", "view", file),
        ("hmtb", "video", file, "--out", f"{log.name}.mp4"),
        ("hmtb", "compare", file, "--joint", joint, "--models", "truth"),
    ]
    if toml and is_of_session:
        commands.insert(0, ("hmtb", "simulate", toml_file))
    code = f"from hmtb_twin import JointLog\n\nlog = JointLog.load({file!r})"
    return Recipe(commands, code, toml, toml_file)


def present_scenario(scenario: Scenario, source: str) -> Presentation:
    """Present a scenario by its log: it is simulated first."""
    result = simulate([scenario])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    code = f"import hmtb_twin, scenarios\n\n(log,) = hmtb_twin.simulate([scenarios.load({source!r})])"
    commands = [("hmtb", command, source) for command in ("simulate", "view", "video")]
    recipe = Recipe(commands, code, scenario.to_toml(), f"{scenario.name}.toml")
    return replace(present_log(result.logs[0]), kind="scenario, simulated now", place=source, recipe=recipe)


def present_bus_record(path: Path, part: str) -> Presentation:
    """Present a record of the bus, one test of it, with the arm where it measured the angles."""
    contents = read_records(path)
    names = [record.name for record in contents.records]
    record = contents.choose(part or names[0], path)
    joint = next((axis for axis in record.axes if axis in JOINTS), STUDIED_JOINTS[-1])
    command: tuple[str, ...] = ("hmtb", "identify", str(path), "--joint", joint)
    arguments = f"{str(path)!r}, joint={joint!r}"
    if len(names) > 1:
        command = (*command, "--test", record.name)
        arguments = f"{arguments}, test={record.name!r}"
    code = f"from scenarios.files.data_file import read_parts\n\nparts = read_parts({arguments})"
    row = (record.name, f"{len(record) * record.dt:g} s", ", ".join(record.axes), f"{100 * record.lost.mean():.3g} %")
    lines = [contents.message] if contents.message else []
    lines.append("the arm follows the measured angles; what was lost stays as it was")
    return Presentation(
        "record of the bus",
        str(path),
        Recipe([command], code),
        [("", ("record", "length", "axes", "ticks with losses"), [row])],
        lines,
        record.name,
        names if len(names) > 1 else (),
        pictured_log(record),
        complete=False,
    )
