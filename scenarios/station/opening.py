"""What is on disk, and what is registered, as the Study tab shows it: recognised by its contents, with a log to replay.

All of it runs in the child process of the page: foreign files may hang or crash whoever reads them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hmtb_twin import JOINTS, STUDIED_JOINTS, JointLog, simulate
from hmtb_twin.run.playback import pictured_arm, pictured_log
from scenarios.bench.leaderboard_tables import metric_table
from scenarios.bench.result import Result
from scenarios.datasets.data_set import open_data_set
from scenarios.datasets.experiment_file import experiment_log
from scenarios.datasets.plan import INDEX, UNFINISHED
from scenarios.datasets.spec_tables import PARTS
from scenarios.experiments.campaign import campaign_scenario
from scenarios.experiments.joint_inputs import STILL
from scenarios.experiments.registry import load
from scenarios.experiments.run_review import log_summary
from scenarios.experiments.scenario import Scenario
from scenarios.files.data_file import log_of
from scenarios.files.errors import ScenarioError
from scenarios.files.printable import one_line
from scenarios.files.record_file import ENDINGS, is_record, read_records
from scenarios.station.recipe import Recipe
from scenarios.thesis.campaign import EVERY_TEST
from scenarios.thesis.results import RESULTS, read_results, result_tables

LARGEST = 2**28
"""Largest file that is opened, bytes: a log of an hour has a tenth of it."""

MOST_PARTS = 300
"""Parts of a data set or a folder that a menu lists."""

OPENED = (*ENDINGS.values(), ".c10", ".toml", ".json")
"""Endings of files that can be opened."""


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


def open_place(place: str, part: str = "") -> Opened:
    """Open a file, a folder or a registered scenario.

    Args:
        place: The path, or the name of the scenario.
        part: Part of a folder, or test of a record of several.

    Raises:
        ScenarioError: There is no such thing, or it is none of those that can be opened.
        TwinError: Likewise, of logs and records of ours.
    """
    path = Path(place).expanduser()
    if not place or (not path.exists() and (path.suffix in OPENED or path.name != place)):
        raise ScenarioError(f"no file or folder {place!r}; expected its path, or the name of a scenario")
    if not path.exists() or path.suffix == ".toml":
        return _simulated(load(place), place)
    if (path / INDEX).is_file() or path.name.endswith(UNFINISHED):
        return _data_set(path, part)
    if path.name == RESULTS or (path / RESULTS).is_file():
        return _study(path if path.is_dir() else path.parent, part)
    if path.is_file() and path.stat().st_size > LARGEST:
        raise ScenarioError(f"{path}: expected a file of at most {LARGEST // 2**20} MiB")
    if path.is_file() and path.suffix == ".json":
        return _bench_result(path)
    if path.is_file() and (log := log_of(path)) is not None:
        return open_log(log, str(path))
    if path.is_file() and (path.suffix == ".nc" or is_record(path)):
        return _bus_record(path, part)
    raise ScenarioError(
        f"{path}: expected a log or a record of the arm, a result of hmtb verify or a scenario ({', '.join(OPENED)}) "
        "or the folder of a data set or a study; tables from elsewhere are for the tab Identify"
    )


def files_in(folder: Path) -> list[str]:
    """Names of what can be opened in a folder, sorted."""
    there = [path for path in folder.iterdir() if path.name.isprintable()] if folder.is_dir() else []
    return sorted(p.name for p in there if p.suffix in OPENED or (p / INDEX).is_file() or (p / RESULTS).is_file())


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


def _simulated(scenario: Scenario, source: str) -> Opened:
    """Open a scenario: it is simulated first."""
    result = simulate([scenario])
    for label, reason in result.failed.items():
        raise ScenarioError(f"{label}: {reason}")
    code = f"import hmtb_twin, scenarios\n\n(log,) = hmtb_twin.simulate([scenarios.load({source!r})])"
    commands = [("hmtb", command, source) for command in ("simulate", "view", "video")]
    recipe = Recipe(commands, code, scenario.to_toml(), f"{scenario.name}.toml")
    return replace(open_log(result.logs[0]), kind="scenario, simulated now", place=source, recipe=recipe)


def _bus_record(path: Path, part: str) -> Opened:
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


def _data_set(path: Path, part: str) -> Opened:
    data = open_data_set(path)
    names = [one.name for one in data.index if one.failed is None]
    counts = ", ".join(f"{len(data.records(aim))} to {aim}" for aim in PARTS)
    code = f"from scenarios.datasets import open_data_set\n\ndata = open_data_set({str(path)!r})"
    opened = Opened(
        "data set",
        str(path),
        Recipe([("hmtb", "dataset", "check", str(path))], code + f"\nrecord = data.record({part!r})" * bool(part)),
        (),
        [f"{data.label}: {len(names)} records, {counts}; hash {data.hash}"],
        part,
        names[:MOST_PARTS],
    )
    if len(names) > MOST_PARTS:
        opened = replace(opened, lines=[*opened.lines, f"the menu lists the first {MOST_PARTS} records"])
    if not part:
        return opened
    record = data.record(part)
    about = (
        f"{part}: {record.part}, block {record.block}, {record.arm}, {', '.join(record.joints)}, {len(record)} samples"
    )
    log, origin = experiment_log(data, part)
    own = opened if log is None else open_log(log)
    return replace(
        own,
        kind=opened.kind,
        place=str(path),
        recipe=opened.recipe,
        part=part,
        parts=opened.parts,
        lines=[about, origin, *own.lines],
    )


def _study(path: Path, part: str) -> Opened:
    record = read_results(path)
    if part:
        if (path / f"{part}.nc").is_file():
            own = open_place(str(path / f"{part}.nc"))
        else:
            test = campaign_scenario(part, seed=record["seed"], duration=record["duration"])
            own = _simulated(test, f"{part}.toml")
        return replace(own, place=str(path), part=part, parts=EVERY_TEST)
    *bandwidths, findings = result_tables(record)
    kept = sum((path / f"{name}.nc").is_file() for name in EVERY_TEST)
    seed = [] if record["seed"] is None else ["--seed", str(record["seed"])]
    code = "from pathlib import Path\n\nfrom scenarios.thesis.results import read_results\n\n"
    return Opened(
        "study",
        str(path),
        Recipe([("hmtb", "thesis", *seed, "--out", str(path))], code + f"record = read_results(Path({str(path)!r}))"),
        [findings, *bandwidths],
        [record["answer"], record["certainty"], f"logs kept: {kept} of {len(EVERY_TEST)}; others are simulated"],
        parts=EVERY_TEST,
    )


def _bench_result(path: Path) -> Opened:
    result = Result.read(path)
    code = "from pathlib import Path\n\nfrom scenarios.bench.result import Result\n\n"
    return Opened(
        "result of the test bench",
        str(path),
        Recipe([("hmtb", "leaderboard", str(path))], code + f"result = Result.read(Path({str(path)!r}))"),
        [metric_table(result)],
        [f"answers: {', '.join(f'{n} {kind}' for kind, n in result.outcomes.items())}", f"again: {result.command}"],
    )
