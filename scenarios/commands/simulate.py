"""`hmtb simulate`: experiments on the twin, and the files of their logs."""

from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    output_folder,
    print_json,
    print_tables,
    progress,
    say,
    say_each,
    say_next_identify,
)
from scenarios.files.errors import ScenarioError, unknown

if TYPE_CHECKING:
    from hmtb_twin import JointLog
    from hmtb_twin.run.simulation import Logs
    from scenarios.experiments.run_review import RunReview
    from scenarios.experiments.scenario import Scenario


def simulate(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO ...")],
    *,
    out: Path = Path("."),
    format: str = "nc",
    duration: float | None = None,
    seed: int | None = None,
    arm: str | None = None,
    payload: str | None = None,
    record: Path | None = None,
    record_column: tuple[str, ...] = (),
    record_rate: float | None = None,
    threads: int | None = None,
    dropped: float = 0.0,
    invalid: float = 0.0,
    silent: float = 0.0,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Run experiments on the twin and write their 50 Hz logs.

    Names are registered scenarios (hmtb scenarios), tags of them, or TOML files (hmtb scenarios show NAME prints one to
    start from). All run side by side.

    Args:
        names: Scenarios, tags or TOML files.
        out: Folder for the logs, NAME.nc and so on.
        format: File formats, comma-separated: nc (NetCDF4, everything); csv, mat, ascii (what passes over the bus);
            1553 (IRIG 106 Chapter 10: NAME.ch10, or run-1.ch10, run-2.ch10, ... of five tests each).
        duration: Length of every record instead of the scenario's own, s.
        seed: Seed of the noise; the scenario's own when not given. The same seed gives the same bits.
        arm: The arm instead of the scenarios' own: a variant of the test bed, another arm by name (panda), or the path
            of an MJCF, a URDF or a folder. hmtb scenarios --arm ARM lists its own tests.
        payload: What the end effector holds instead: a payload of the arm by name, or your own, as
            "mass=2.5 centre=0,0,0.05 inertia=0.01,0.01,0.02" (kg, m and kg m2 in the frame of the tool).
        record: File of a signal of your own to play instead: one number in V per line, or a table with a header.
        record_column: Columns of the table, one for each axis.
        record_rate: Samples of the record per second, Hz; by default that of the table's times, else 50.
        threads: Threads to use; the logs do not depend on it.
        dropped: Probability that the recorder of the 1553 bus misses a message.
        invalid: Probability that a data word on the bus fails its parity check.
        silent: Probability that a terminal on the bus does not answer.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    import hmtb_twin
    from scenarios.experiments.registry import selected
    from scenarios.experiments.replacements import Changes
    from scenarios.experiments.run_review import review
    from scenarios.files.record_file import ENDINGS

    formats = tuple(dict.fromkeys(word.strip() for word in format.split(",")))
    for name in formats:
        if name not in ENDINGS:
            raise ScenarioError(unknown("format", name, ENDINGS))
    faults = {"dropped": dropped, "invalid": invalid, "silent": silent}
    _check_bus(formats, faults)
    scenarios: dict[str, Scenario] = {}
    changes = Changes(payload, record, record_column, record_rate)
    for scenario in map(changes.made, selected(names, duration=duration, seed=seed, arm=arm)):
        if scenario.name in scenarios:
            raise ScenarioError(f"scenario {scenario.name!r} is named twice; each log needs a name of its own")
        scenarios[scenario.name] = scenario
    with output_folder(out, *_file_names(list(scenarios), formats), overwrite=overwrite) as folder:
        with progress("simulating") as bar:
            result = hmtb_twin.simulate(list(scenarios.values()), threads=threads, progress=bar)
        files, remarks = _write(result.logs, folder, formats, faults)
    reviews = {log.name: review(log, scenarios[log.name]) for log in result.logs}
    warnings: list[str] = []
    for name, reviewed in reviews.items():
        warnings += [f"{name}: {warning}" for warning in reviewed.warnings]
    warnings += remarks
    if json:
        print_json(_json_record(result, list(files), reviews, warnings))
    else:
        _print(result, files, reviews, warnings, formats)
    return 1 if result.failed else 0


def _check_bus(formats: Sequence[str], faults: Mapping[str, float]) -> None:
    """Refuse faults of the bus without its recorder, and a recorder that cannot write, before the work begins."""
    for name, rate in faults.items():
        if not 0.0 <= rate <= 1.0:
            raise ScenarioError(f"--{name} is a probability, 0 to 1, given {rate}")
        if rate and "1553" not in formats:
            raise ScenarioError(f"--{name} is a fault of the bus; expected --format 1553")
    if "1553" in formats:
        from hmtb_twin.bus.chapter10 import pychapter10

        pychapter10()


def _file_names(scenarios: Sequence[str], formats: Sequence[str]) -> list[str]:
    """Names of files that may be written: a log for each scenario and format, and runs of the bus."""
    from scenarios.files.record_file import ENDINGS

    names = []
    for scenario in scenarios:
        names += [f"{scenario}{ENDINGS[name]}" for name in formats if name != "1553"]
    if "1553" in formats:
        # How many tests fit into a run is known after the simulation: at worst one.
        runs = scenarios if len(scenarios) == 1 else [f"run-{k}" for k in range(1, len(scenarios) + 1)]
        names += [f"{run}.ch10" for run in runs]
    return names


def _write(
    logs: Sequence["JointLog"], folder: Path, formats: Sequence[str], faults: Mapping[str, float]
) -> "tuple[dict[Path, list[JointLog]], list[str]]":
    """Write the logs in all formats; the logs by file, and remarks on what did not fit into a recorder."""
    from scenarios.files.data_file import write_log
    from scenarios.files.record_file import ENDINGS

    files: dict[Path, list[JointLog]] = {}
    remarks: list[str] = []
    for log in logs:
        for name in formats:
            if name != "1553":
                files[write_log(log, folder / f"{log.name}{ENDINGS[name]}")] = [log]
    if "1553" in formats:
        files |= _record(logs, folder, faults, remarks)
    return files, remarks


def _json_record(
    result: "Logs", files: Sequence[Path], reviews: "Mapping[str, RunReview]", warnings: Sequence[str]
) -> dict[str, object]:
    inputs, tasks, shutdowns = {}, {}, {}
    for name, reviewed in reviews.items():
        if reviewed.inputs:
            inputs[name] = reviewed.inputs.summary()
        if reviewed.task:
            tasks[name] = reviewed.task.summary()
        if reviewed.shutdowns:
            shutdowns[name] = [interval.summary() for interval in reviewed.shutdowns]
    return {
        "logs": files,
        "failed": result.failed,
        "physics_s": result.physics_seconds,
        "clipped": {name: reviewed.clipped for name, reviewed in reviews.items()},
        "velocity_limited": {name: reviewed.velocity_limited for name, reviewed in reviews.items()},
        "inputs": inputs,
        "task": tasks,
        "shutdowns": shutdowns,
        "warnings": warnings,
    }


def _print(
    result: "Logs",
    files: "Mapping[Path, Sequence[JointLog]]",
    reviews: "Mapping[str, RunReview]",
    warnings: Sequence[str],
    formats: Sequence[str],
) -> None:
    from scenarios.experiments.log_review import RATE_LIMITED
    from scenarios.experiments.run_review import run_table
    from scenarios.files.record_file import unnamed

    print_tables([run_table(files, reviews, result.failed)])
    if any(reviewed.velocity_limited for reviewed in reviews.values()):
        say(RATE_LIMITED)
    for name, reviewed in reviews.items():
        if reviewed.task:
            say_each(f"{name}: ", [reviewed.task])
        say_each(f"{name}: ", reviewed.shutdowns)
    say_each("warning: ", warnings)
    if "csv" in formats:
        say_each("note: ", unnamed(result.logs, "csv", list(reviews)))
    for path, logs in list(files.items())[:1]:
        arm = logs[0].provenance["variant"]
        say_next_identify(path, logs[0].name, logs[0].axes, arm=arm, tests=len(logs))


def _record(
    logs: Sequence["JointLog"], folder: Path, faults: Mapping[str, float], remarks: list[str]
) -> "dict[Path, list[JointLog]]":
    """Record logs on the bus, five to a run; return the logs by file, and add to the remarks what did not fit."""
    from hmtb_twin.bus.messages import BusFaults
    from hmtb_twin.bus.record import BusRecord
    from hmtb_twin.bus.recorder_run import record_run, runs

    files: dict[Path, list[JointLog]] = {}
    remaining = iter(logs)
    for number, run in enumerate(runs([BusRecord.of(log) for log in logs]), start=1):
        recorded = list(islice(remaining, len(run)))
        name = run[0].name if len(logs) == 1 else f"run-{number}"
        # Every run has its own noise: that of its first test's seed.
        bus = record_run(run, folder / f"{name}.ch10", faults=BusFaults(**faults, seed=recorded[0].seed))
        if bus.message:
            remarks.append(bus.message)
        files[bus.path] = recorded
    return files
