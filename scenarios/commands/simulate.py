"""`hmtb simulate`: one experiment or several, to files."""

from pathlib import Path
from typing import Annotated

import tyro

from scenarios.commands.output import print_json, print_table, progress, writable_folder


def simulate(
    names: Annotated[tuple[str, ...], tyro.conf.Positional],
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
    start from). All run side by side.

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
        raise ScenarioError(f"no scenario named; there are: {', '.join(registered_names())}")
    chosen = [load(name) for name in wanted]
    twice = sorted({entry.name for entry in chosen if [other.name for other in chosen].count(entry.name) > 1})
    if twice:
        raise ScenarioError(f"scenario {twice[0]!r} is named twice; each log needs a name of its own")
    if duration is not None:
        chosen = [replace(entry, duration=duration) for entry in chosen]
    if seed is not None:
        chosen = [entry.reseeded(seed) for entry in chosen]
    folder = writable_folder(out)

    import hmtb_twin

    with progress("simulating") as report:
        result = hmtb_twin.simulate(chosen, threads=threads, progress=report)
    paths = [write_log(log, folder / f"{log.name}.{ending}") for log in result.logs for ending in formats]
    if json:
        print_json({"logs": paths, "failed": result.failed, "physics_s": result.physics_seconds})
    else:
        lengths = {log.name: len(log.commanded) * log.dt for log in result.logs}
        rows = [(str(path), f"{lengths[path.stem]:g} s") for path in paths]
        rows += [(name, f"failed: {reason}") for name, reason in result.failed.items()]
        print_table(f"{len(paths)} files", ("log", "length"), rows)
    return 1 if result.failed else 0
