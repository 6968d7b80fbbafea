"""`hmtb simulate`: one experiment or several, to files."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, progress, say

if TYPE_CHECKING:
    from hmtb_twin import JointLog


def simulate(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="NAME ...")],
    /,
    *,
    out: Path = Path("."),
    format: str = "nc",
    duration: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    dropped: float = 0.0,
    invalid: float = 0.0,
    silent: float = 0.0,
    json: bool = False,
) -> int:
    """Run experiments on the twin and write their 50 Hz logs.

    Names are registered scenarios (hmtb scenarios), tags of them, or TOML files (hmtb scenarios show NAME prints one to
    start from). All run side by side. Files of the same names in the folder are replaced.

    Args:
        names: Scenarios, tags or TOML files.
        out: Folder for the logs, NAME.nc and so on.
        format: File formats, comma-separated: nc (NetCDF4, everything); csv, mat, ascii (what passes over the bus);
            1553 (IRIG 106 Chapter 10: NAME.ch10, or run-1.ch10, run-2.ch10, ... of five tests each).
        duration: Length of every record instead of the scenario's own, s.
        seed: Draw other noise; the same seed gives the same bits.
        threads: Threads to use; the logs do not depend on it.
        dropped: Probability that the 1553 recorder misses a message.
        invalid: Probability that a data word on the bus fails parity.
        silent: Probability that a terminal on the bus does not answer.
        json: Print JSON.
    """
    from dataclasses import replace

    from scenarios.experiments.registry import selected
    from scenarios.files.data_file import write_log
    from scenarios.files.errors import ScenarioError, unknown
    from scenarios.files.record_file import ENDINGS

    formats = tuple(dict.fromkeys(entry.strip() for entry in format.split(",")))
    wrong = [entry for entry in formats if entry not in ENDINGS]
    if wrong:
        raise ScenarioError(unknown("format", wrong[0], ENDINGS))
    for name, rate in (("dropped", dropped), ("invalid", invalid), ("silent", silent)):
        if not 0.0 <= rate <= 1.0:
            raise ScenarioError(f"{name} is a probability, 0 to 1, given {rate}")
        if rate and "1553" not in formats:
            raise ScenarioError(f"--{name} is a fault of the bus; expected --format 1553")
    if "1553" in formats:
        from hmtb_twin.bus.chapter10 import pychapter10

        pychapter10()  # before the work, not after
    if threads is not None and threads < 1:
        raise ScenarioError(f"threads must be 1 or more, given {threads}")
    chosen = selected(names)
    twice = sorted({entry.name for entry in chosen if [other.name for other in chosen].count(entry.name) > 1})
    if twice:
        raise ScenarioError(f"scenario {twice[0]!r} is named twice; each log needs a name of its own")
    if duration is not None:
        chosen = [replace(entry, duration=duration) for entry in chosen]
    if seed is not None:
        chosen = [entry.reseeded(seed) for entry in chosen]
    with output_folder(out) as folder:
        import hmtb_twin

        with progress("simulating") as report:
            result = hmtb_twin.simulate(chosen, threads=threads, progress=report)
        endings = [ENDINGS[entry] for entry in formats if entry != "1553"]
        paths = [[write_log(log, folder / f"{log.name}{ending}") for ending in endings] for log in result.logs]
        remarks: list[str] = []
        if "1553" in formats:
            for entry, made in zip(paths, _record(result.logs, folder, dropped, invalid, silent, remarks), strict=True):
                entry.append(made)

    from scenarios.experiments.excitation_computer import MISSES_POINTS
    from scenarios.experiments.joint_inputs import logged_inputs
    from scenarios.experiments.log_review import clipped_share, shutdown_intervals, velocity_limited_share
    from scenarios.experiments.preview import deadband_warning

    by_name = {entry.name: entry for entry in chosen}
    clipped = {log.name: clipped_share(log, by_name[log.name]) for log in result.logs}
    limited = {log.name: velocity_limited_share(log) for log in result.logs}
    warnings = [
        f"{name}: {100 * share:.2g} % of the samples stand at an end of a converter's range, whatever the excitation "
        "asked for; a smaller amplitude keeps it"
        for name, share in clipped.items()
        if share > 0
    ]
    inputs = {log.name: found for log in result.logs if (found := logged_inputs(log, by_name[log.name]))}
    warnings += [f"{name}: {text}" for name, found in inputs.items() if (text := found.warning())]
    warnings += [
        f"{entry.name}: {MISSES_POINTS}" for entry in chosen if any(played.misses_points for played in entry.excitation)
    ]
    warnings += [
        f"{log.name}: {text}" for log in result.logs if (text := deadband_warning(by_name[log.name])) is not None
    ]
    warnings += remarks
    from scenarios.experiments.rpcm import task_outcome

    tasks = {log.name: done for log in result.logs if (done := task_outcome(log, by_name[log.name].task))}
    warnings += [f"{name}: {text}" for name, outcome in tasks.items() if (text := outcome.warning())]
    off = {log.name: stretches for log in result.logs if (stretches := shutdown_intervals(log))}
    written = list(dict.fromkeys(path for made in paths for path in made))
    if json:
        print_json(
            {
                "logs": written,
                "failed": result.failed,
                "physics_s": result.physics_seconds,
                "clipped": clipped,
                "velocity_limited": limited,
                "inputs": {name: found.summary() for name, found in inputs.items()},
                "task": {name: outcome.summary() for name, outcome in tasks.items()},
                "shutdowns": {name: [entry.summary() for entry in stretches] for name, stretches in off.items()},
                "warnings": warnings,
            }
        )
        return 1 if result.failed else 0
    shown = {path: [log for log, made in zip(result.logs, paths, strict=True) if path in made] for path in written}
    rows = [(str(path), *_row(logs, clipped, limited)) for path, logs in shown.items()]
    rows += [(name, f"failed: {reason}", "", "") for name, reason in result.failed.items()]
    count = len(shown)
    print_table(
        f"{count} file{'s' if count != 1 else ''}", ("log", "length", "converter clips", "at velocity limit"), rows
    )
    for name, outcome in tasks.items():
        say(f"{name}: {outcome}")
    for name, stretches in off.items():
        for stretch in stretches:
            say(f"{name}: {stretch}")
    for text in warnings:
        say(f"warning: {text}")
    return 1 if result.failed else 0


def _row(logs: "Sequence[JointLog]", clipped: dict[str, float], limited: dict[str, float]) -> tuple[str, str, str]:
    """Length and shares of a file that holds these logs; shares are the largest of them."""
    length = sum(len(log) * log.dt for log in logs)
    of = f" ({len(logs)} tests)" if len(logs) > 1 else ""
    return (
        f"{length:g} s{of}",
        f"{100 * max(clipped[log.name] for log in logs):.3g} %",
        f"{100 * max(limited[log.name] for log in logs):.3g} %",
    )


def _record(
    logs: "Sequence[JointLog]", folder: Path, dropped: float, invalid: float, silent: float, remarks: list[str]
) -> list[Path]:
    """Record logs on the bus, five to a run; return the file of each, and add to the remarks what did not fit."""
    from hmtb_twin.bus.messages import BusFaults
    from hmtb_twin.bus.record import BusRecord
    from hmtb_twin.bus.recorder_run import record_run, runs

    shared = runs([BusRecord.of(log) for log in logs])
    files: list[Path] = []
    for number, run in enumerate(shared, start=1):
        name = run[0].name if len(logs) == 1 else f"run-{number}"
        # Every run has its own noise: that of its first test's seed.
        faults = BusFaults(dropped=dropped, invalid=invalid, silent=silent, seed=logs[len(files)].seed)
        made = record_run(run, folder / f"{name}.ch10", faults=faults)
        remarks += [made.message] if made.message else []
        files += [made.path] * len(run)
    return files
