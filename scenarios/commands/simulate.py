"""`hmtb simulate`: one experiment or several, to files."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, progress, say


def simulate(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="NAME ...")],
    /,
    *,
    out: Path = Path("."),
    format: str = "nc",
    duration: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    json: bool = False,
) -> int:
    """Run experiments on the twin and write their 50 Hz logs.

    Names are registered scenarios (hmtb scenarios), tags of them, or TOML files (hmtb scenarios show NAME prints one to
    start from). All run side by side. Files of the same names in the folder are replaced.

    Args:
        names: Scenarios, tags or TOML files.
        out: Folder for the logs, NAME.nc and so on.
        format: File formats, comma-separated: nc (NetCDF4, everything), csv (time, commanded and measured angles).
        duration: Length of every record instead of the scenario's own, s.
        seed: Draw other noise; the same seed gives the same bits.
        threads: Threads to use; the logs do not depend on it.
        json: Print JSON.
    """
    from dataclasses import replace

    from scenarios.datafile import write_log
    from scenarios.errors import ScenarioError
    from scenarios.registry import load, registered
    from scenarios.registry import names as registered_names

    formats = tuple(dict.fromkeys(entry.strip() for entry in format.split(",")))
    wrong = [entry for entry in formats if entry not in ("nc", "csv")]
    if wrong:
        raise ScenarioError(f"unknown format {wrong[0]!r}; there are: nc, csv")
    if threads is not None and threads < 1:
        raise ScenarioError(f"threads must be 1 or more, given {threads}")
    wanted = [entry for name in names for entry in (registered_names(name) if name in registered().tags() else [name])]
    if not wanted:
        raise ScenarioError(
            f"no scenario named; there are {len(registered_names())}, listed by: hmtb scenarios list; "
            f"tags: {', '.join(registered().tags())}"
        )
    chosen = [load(name) for name in wanted]
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
        paths = [[write_log(log, folder / f"{log.name}.{ending}") for ending in formats] for log in result.logs]

    from scenarios.saturation import clipped_share, velocity_limited_share

    clipped = {log.name: clipped_share(log) for log in result.logs}
    limited = {log.name: velocity_limited_share(log) for log in result.logs}
    warnings = [
        f"{name}: {100 * share:.2g} % of the samples stand at an end of the converter's range, whatever the excitation "
        "asked for; a smaller amplitude keeps it"
        for name, share in clipped.items()
        if share > 0
    ]
    if json:
        print_json(
            {
                "logs": [path for written in paths for path in written],
                "failed": result.failed,
                "physics_s": result.physics_seconds,
                "clipped": clipped,
                "velocity_limited": limited,
                "warnings": warnings,
            }
        )
        return 1 if result.failed else 0
    rows = [
        (str(path), f"{len(log) * log.dt:g} s", f"{100 * clipped[log.name]:.3g} %", f"{100 * limited[log.name]:.3g} %")
        for log, written in zip(result.logs, paths, strict=True)
        for path in written
    ]
    rows += [(name, f"failed: {reason}", "", "") for name, reason in result.failed.items()]
    count = sum(map(len, paths))
    print_table(
        f"{count} file{'s' if count != 1 else ''}", ("log", "length", "converter clips", "at velocity limit"), rows
    )
    for text in warnings:
        say(f"warning: {text}")
    return 1 if result.failed else 0
