"""`hmtb preview`: the commands of an experiment, before anything moves."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_tables, progress, say, say_each
from scenarios.commands.simulate import simulate
from scenarios.commands.usage import command_line

if TYPE_CHECKING:
    from scenarios.experiments.preview import Preview


def preview(
    names: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO ...")],
    *,
    out: Path = Path("."),
    duration: float | None = None,
    seed: int | None = None,
    arm: str | None = None,
    payload: str | None = None,
    record: Path | None = None,
    record_column: tuple[str, ...] = (),
    record_rate: float | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Show the commands of experiments before anything moves.

    The commands are those of a simulation to the bit, noise included; the arm is not simulated. Names are registered
    scenarios (hmtb scenarios), tags of them, or TOML files.

    Args:
        names: Scenarios, tags or TOML files.
        out: Folder for the plots, NAME-preview.png.
        duration: Length of every experiment instead of the scenario's own, s.
        seed: Seed of the noise, as for hmtb simulate; the scenario's own when not given.
        arm: The arm instead of the scenarios' own, by name or path, as for hmtb simulate.
        payload: What the end effector holds instead, as for hmtb simulate.
        record: File of a signal of your own to play instead, as for hmtb simulate.
        record_column: Columns of a table, one for each axis.
        record_rate: Samples of the record per second, Hz.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from scenarios.experiments.preview import preview as compute_preview
    from scenarios.experiments.preview_figure import preview_figure
    from scenarios.experiments.registry import selected
    from scenarios.experiments.replacements import Changes
    from scenarios.report.figures import save_figure

    records = {}
    changes = Changes(payload, record, record_column, record_rate)
    chosen = map(changes.made, selected(names, duration=duration, seed=seed, arm=arm))
    scenarios = {scenario.name: scenario for scenario in chosen}
    files = {name: f"{name}-preview.png" for name in scenarios}
    with output_folder(out, *files.values(), overwrite=overwrite) as folder:
        for name, scenario in scenarios.items():
            with progress(f"preview of {name}"):
                commands = compute_preview(scenario)
                picture = folder / files[name]
                save_figure(preview_figure(commands), picture, dpi=120)
            records[name] = {**commands.record(), "plot": str(picture)}
            # One after the other, as they are computed.
            if not json:
                _print(commands, picture)
    if json:
        print_json({"previews": records})
    else:
        options = {"names": names, "out": out, "duration": duration, "seed": seed, "arm": arm, "payload": payload}
        options |= {"record": record, "record_column": record_column, "record_rate": record_rate}
        say(f"next: {command_line('hmtb simulate', simulate, options)}")
    return 0


def _print(commands: "Preview", picture: Path) -> None:
    from scenarios.experiments.log_review import RATE_LIMITED

    print_tables([commands.table()])
    say_each("", commands.lines())
    if commands.velocity_limited:
        say_each("note: ", [RATE_LIMITED])
    say_each("warning: ", commands.warnings())
    say(f"plot: {picture}\n")
