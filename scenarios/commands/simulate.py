"""`hmtb simulate`: experiments on the twin, and the files of their logs."""

from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    counted,
    output_folder,
    print_json,
    print_table,
    progress,
    say,
    say_each,
    say_next_identify,
)
from scenarios.files.errors import ScenarioError, unknown

if TYPE_CHECKING:
    from hmtb_twin import JointLog


def simulate(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO ...")],
    *,
    out: Path = Path("."),
    format: str = "nc",
    duration: float | None = None,
    seed: int | None = None,
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
        threads: Threads to use; the logs do not depend on it.
        dropped: Probability that the recorder of the 1553 bus misses a message.
        invalid: Probability that a data word on the bus fails its parity check.
        silent: Probability that a terminal on the bus does not answer.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    import hmtb_twin
    from scenarios.experiments.log_review import RATE_LIMITED
    from scenarios.experiments.registry import selected
    from scenarios.experiments.run_review import review
    from scenarios.files.data_file import write_log
    from scenarios.files.record_file import ENDINGS, unnamed

    formats = tuple(dict.fromkeys(entry.strip() for entry in format.split(",")))
    if wrong := [entry for entry in formats if entry not in ENDINGS]:
        raise ScenarioError(unknown("format", wrong[0], ENDINGS))
    faults = {"dropped": dropped, "invalid": invalid, "silent": silent}
    for name, rate in faults.items():
        if not 0.0 <= rate <= 1.0:
            raise ScenarioError(f"--{name} is a probability, 0 to 1, given {rate}")
        if rate and "1553" not in formats:
            raise ScenarioError(f"--{name} is a fault of the bus; expected --format 1553")
    if "1553" in formats:
        from hmtb_twin.bus.chapter10 import pychapter10

        pychapter10()  # refuses before the work, not after
    scenarios = {}
    for entry in selected(names, duration=duration, seed=seed):
        if entry.name in scenarios:
            raise ScenarioError(f"scenario {entry.name!r} is named twice; each log needs a name of its own")
        scenarios[entry.name] = entry
    remarks: list[str] = []
    files: dict[Path, list[JointLog]] = {}
    places = [f"{name}{ENDINGS[entry]}" for name in scenarios for entry in formats if entry != "1553"]
    if "1553" in formats:
        runs = [f"run-{number}" for number in range(1, len(scenarios) + 1)]
        places += [f"{name}.ch10" for name in (scenarios if len(scenarios) == 1 else runs)]
    with output_folder(out, *places, overwrite=overwrite) as folder:
        with progress("simulating") as bar:
            result = hmtb_twin.simulate(list(scenarios.values()), threads=threads, progress=bar)
        for log in result.logs:
            for ending in (ENDINGS[entry] for entry in formats if entry != "1553"):
                files[write_log(log, folder / f"{log.name}{ending}")] = [log]
        if "1553" in formats:
            files |= _record(result.logs, folder, faults, remarks)
    reviews = {log.name: review(log, scenarios[log.name]) for log in result.logs}
    warnings = [f"{name}: {text}" for name, entry in reviews.items() for text in entry.warnings] + remarks
    if json:
        print_json(
            {
                "logs": list(files),
                "failed": result.failed,
                "physics_s": result.physics_seconds,
                "clipped": {name: entry.clipped for name, entry in reviews.items()},
                "velocity_limited": {name: entry.velocity_limited for name, entry in reviews.items()},
                "inputs": {name: entry.inputs.summary() for name, entry in reviews.items() if entry.inputs},
                "task": {name: entry.task.summary() for name, entry in reviews.items() if entry.task},
                "shutdowns": {
                    name: [interval.summary() for interval in entry.shutdowns]
                    for name, entry in reviews.items()
                    if entry.shutdowns
                },
                "warnings": warnings,
            }
        )
        return 1 if result.failed else 0
    rows = []
    for path, logs in files.items():
        length = f"{sum(len(log) * log.dt for log in logs):g} s" + f" ({len(logs)} tests)" * (len(logs) > 1)
        # Of a file with several logs the largest shares.
        clipped, limited = (
            max(getattr(reviews[log.name], key) for log in logs) for key in ("clipped", "velocity_limited")
        )
        rows.append((str(path), length, f"{100 * clipped:.3g} %", f"{100 * limited:.3g} %"))
    rows += [(name, f"failed: {why}", "", "") for name, why in result.failed.items()]
    print_table(counted(len(files), "file"), ("log", "length", "converter clips", "command rate-limited"), rows)
    if any(entry.velocity_limited for entry in reviews.values()):
        say(RATE_LIMITED)
    for name, one in reviews.items():
        say_each(f"{name}: ", ((one.task,) if one.task else ()) + one.shutdowns)
    say_each("warning: ", warnings)
    say_each("note: ", unnamed(result.logs, "csv", list(reviews)) if "csv" in formats else ())
    for path, (log, *others) in list(files.items())[:1]:
        say_next_identify(path, log.name, log.axes, tests=1 + len(others))
    return 1 if result.failed else 0


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
        remarks += [bus.message] if bus.message else []
        files[bus.path] = recorded
    return files
