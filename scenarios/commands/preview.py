"""`hmtb preview`: the commands of an experiment, before anything moves."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, progress, say, say_each
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
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from scenarios.experiments.preview import preview as compute_preview
    from scenarios.experiments.preview_figure import preview_figure
    from scenarios.experiments.registry import selected
    from scenarios.report.figures import save_figure

    records = {}
    scenarios = {scenario.name: scenario for scenario in selected(names, duration=duration, seed=seed)}
    files = {name: f"{name}-preview.png" for name in scenarios}
    with output_folder(out, *files.values(), overwrite=overwrite) as folder:
        for name, scenario in scenarios.items():
            with progress(f"preview of {name}"):
                commands = compute_preview(scenario)
                picture = folder / files[name]
                save_figure(preview_figure(commands), picture, dpi=120)
            records[name] = {**_json_record(commands), "plot": str(picture)}
            # One after the other, as they are computed.
            if not json:
                _print(commands, picture)
    if json:
        print_json({"previews": records})
    else:
        options = {"names": names, "out": out, "duration": duration, "seed": seed}
        say(f"next: {command_line('hmtb simulate', simulate, options)}")
    return 0


def _json_record(commands: "Preview") -> dict[str, object]:
    from hmtb_twin import JOINTS, Status
    from scenarios.experiments.model_structures import needed_orders

    joints = {}
    for joint in commands.moving:
        joints[joint] = {
            "peak_rate_rad_s": commands.peak_rate(joint),
            "velocity_limit_rad_s": commands.velocity_limits[JOINTS.index(joint)],
            "range_margin_rad": commands.margin(joint),
        }
    return {
        "duration_s": commands.duration,
        "power_off_s": commands.power_off,
        "joints": joints,
        "tool_deflection_m": commands.deflection,
        "tool_turn_rad": commands.turn,
        "velocity_limited": commands.velocity_limited,
        "joint_limited": commands.share(Status.JOINT_LIMITED),
        "singular": commands.share(Status.SINGULAR),
        "clipped": {"dac": commands.dac_clipped, "adc": commands.share(Status.CONVERTER_SATURATED)},
        "order_of_excitation": commands.orders,
        "needed_order": needed_orders(),
        "inputs": commands.inputs.summary() if commands.inputs else None,
        "warnings": commands.warnings(),
    }


def _print(commands: "Preview", picture: Path) -> None:
    from scenarios.experiments.log_review import RATE_LIMITED

    scenario = commands.scenario
    length = f"{commands.duration:g} s"
    if commands.duration < scenario.duration:
        length += f" of {scenario.duration:g} s"
    mode, axes = scenario.mode.replace("_", " "), ", ".join(scenario.axes)
    columns = ("joint", "peak rate", "limit", "distance from the range's end")
    print_table(f"{scenario.name}: {length}, {mode} mode, axes {axes}", columns, commands.joint_rows())
    say_each("", commands.lines())
    if commands.velocity_limited:
        say_each("note: ", [RATE_LIMITED])
    say_each("warning: ", commands.warnings())
    say(f"plot: {picture}\n")
