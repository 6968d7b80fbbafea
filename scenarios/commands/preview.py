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
    chosen = {f"{one.name}-preview.png": one for one in selected(names, duration=duration, seed=seed)}
    with output_folder(out, *chosen, overwrite=overwrite) as folder:
        for name, scenario in chosen.items():
            with progress(f"preview of {scenario.name}"):
                seen = compute_preview(scenario)
                picture = folder / name
                save_figure(preview_figure(seen), picture, dpi=120)
            records[scenario.name] = {**_record(seen), "plot": str(picture)}
            if not json:
                _print(seen, picture)
    if json:
        print_json({"previews": records})
    else:
        options = {"names": names, "out": out, "duration": duration, "seed": seed}
        say(f"next: {command_line('hmtb simulate', simulate, options)}")
    return 0


def _record(seen: "Preview") -> dict[str, object]:
    from hmtb_twin import JOINTS, Status
    from scenarios.experiments.model_structures import needed_orders

    return {
        "duration_s": seen.duration,
        "power_off_s": seen.power_off,
        "joints": {
            joint: {
                "peak_rate_rad_s": seen.peak_rate(joint),
                "velocity_limit_rad_s": seen.velocity_limits[JOINTS.index(joint)],
                "range_margin_rad": seen.margin(joint),
            }
            for joint in seen.moving
        },
        "tool_deflection_m": seen.deflection,
        "tool_turn_rad": seen.turn,
        "velocity_limited": seen.velocity_limited,
        "joint_limited": seen.share(Status.JOINT_LIMITED),
        "singular": seen.share(Status.SINGULAR),
        "clipped": {"dac": seen.dac_clipped, "adc": seen.share(Status.CONVERTER_SATURATED)},
        "order_of_excitation": seen.orders,
        "needed_order": needed_orders(),
        "inputs": seen.inputs.summary() if seen.inputs else None,
        "warnings": seen.warnings(),
    }


def _print(seen: "Preview", picture: Path) -> None:
    from scenarios.experiments.log_review import RATE_LIMITED

    scenario = seen.scenario
    of = f" of {scenario.duration:g} s" if seen.duration < scenario.duration else ""
    mode, axes = scenario.mode.replace("_", " "), ", ".join(scenario.axes)
    columns = ("joint", "peak rate", "limit", "distance from the range's end")
    print_table(f"{scenario.name}: {seen.duration:g} s{of}, {mode} mode, axes {axes}", columns, seen.joint_rows())
    say_each("", seen.lines())
    say_each("note: ", [RATE_LIMITED] if seen.velocity_limited else [])
    say_each("warning: ", seen.warnings())
    say(f"plot: {picture}\n")
