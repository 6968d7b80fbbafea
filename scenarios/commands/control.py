"""`hmtb control`: the ground arm made to answer like the flight arm, and how well it does."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    draw,
    json_text,
    output_folder,
    print_json,
    print_table,
    progress,
    say_each,
    say_next,
)
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from scenarios.control.campaign import IdentifiedPair
    from scenarios.control.runs import Law, Tested
    from scenarios.control.score import Score
    from scenarios.control.study import ControlResult

DEFAULT = ("reach", "rpcm", "siso-5-elbow_pitch", "multisine")
"""Scenarios when none is named."""

MULTISINE = "multisine"
"""The word for the frequency test, which no file of 100 points can play."""

WAVEFORM_SECONDS = 20.0
"""Length of a thesis waveform, s: its file of two seconds repeats."""


def control(
    scenarios: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")] = (),
    /,
    *,
    method: Annotated[tuple[str, ...], tyro.conf.arg(metavar="following|adaptive|vrft|FILE.json ...")] = ("following",),
    reference: Annotated[str, tyro.conf.arg(metavar="VARIANT|MODEL.json")] = "flight",
    record: Annotated[Path | None, tyro.conf.arg(metavar="LOG")] = None,
    payload: Annotated[str, tyro.conf.arg(metavar="NAME")] = "rpcm",
    friction_level: float = 1.0,
    duration: float | None = None,
    seed: int = 0,
    seeds: int = 1,
    with_stress: bool = False,
    threads: int | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Make the ground arm answer like the flight arm.

    Both arms are identified from four simulated minutes each, in which all six joints move. A controller is designed
    from the two models alone, never from the truth, and runs at 50 Hz between the operator and the arm with its
    friction, quantisation, delays and limits. Each scenario is then run without control, with it and, in free space,
    by the flight arm.

    The table shows the root mean square error over the joints against the reference model's answer to the requests of
    the run itself, and in brackets against the simulated flight arm, whose own seals stick; the share of ticks at a
    limit of rate or range; the largest contact force. A run is stable if its error is bounded and does not grow.

    Without SCENARIO: reach (an operator in free space), rpcm (the exchange of the replacement unit), 20 s of a binary
    sequence of the thesis, and multisine, two minutes that show the response up to 3 Hz. docs/control.md says
    how the methods work and where they break.

      hmtb control
      hmtb control reach --seeds 5 --with-stress --out control
      hmtb control reach --method control/following.json       the design of an earlier run
      hmtb control --record log.nc --reference model.json

    Args:
        scenarios: Names, tags or TOML files (hmtb scenarios list), or multisine.
        method: How the controller is designed, one or several; or the file of a design that --out wrote.
        reference: Arm or model file that the ground arm is made to answer like.
        record: Log (.nc) of the ground arm from which to identify it; all six joints must move.
        payload: Payload of both arms: rpcm, none, ballast or mdm; at the worksite the operator takes the unit.
        friction_level: Dry friction of the ground arm's seals, in multiples of the nominal.
        duration: Length of each scenario but multisine instead of its own, s.
        seed: Draws excitation and noise of the identification; with several seeds, of the first run.
        seeds: Runs of each scenario, each with other noise and another operator.
        with_stress: Run the first scenario in free space also with other payloads, worn seals and wrong models.
        threads: Threads for the physics; all processors when not given.
        out: Folder for control.json, the designs, the logs (.nc) and the figures.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from dataclasses import replace

    from hmtb_twin import VARIANTS, Plant
    from scenarios.control.campaign import frequency_test, identification_experiment, identify_pair
    from scenarios.control.design import METHODS, designer
    from scenarios.control.runs import run_scenarios
    from scenarios.control.study import results, stress
    from scenarios.experiments.registry import selected
    from scenarios.experiments.waveform import check_seed, seed_range

    check_seed(seed)
    designers = {Path(name).stem if name.endswith(".json") else name: designer(name) for name in method}
    if not method:
        raise ScenarioError(f"--method: none given, expected {', '.join(METHODS)}, or files of --out")
    taken = {"without", "reference", "control", "model-ground", "model-reference"}
    if len(designers) < len(method) or taken & designers.keys():
        raise ScenarioError(f"--method {' '.join(method)} given, expected names of their own, none of a file of --out")
    plant = Plant(friction_level=friction_level)
    draws: list[Tested] = []
    for own in seed_range(seeds, seed):
        for word in scenarios or DEFAULT:
            if word == MULTISINE:
                draws.append(replace(frequency_test(own), plant=plant, payload=payload))
                continue
            for one in selected([word], duration=duration, seed=None if seeds == 1 else own):
                length = WAVEFORM_SECONDS if not scenarios and duration is None and one.excitation else one.duration
                held = one.payload if one.worksite else payload
                draws.append(replace(one, plant=plant, payload=held, duration=length))
    free = next((one for one in draws if not one.worksite), None)
    if with_stress and free is None:
        raise ScenarioError("--with-stress given without a scenario in free space, expected one, as reach")
    arm = reference if reference in VARIANTS else None
    names = ("control.json", *(f"{name}.json" for name in designers))  # logs and figures come with these
    with nullcontext() if out is None else output_folder(out, *names, overwrite=overwrite) as folder:
        with progress("identification") as bar:
            ground = record or replace(identification_experiment(seed=seed), payload=payload, plant=plant)
            pair = identify_pair(seed, ground=ground, reference=reference, threads=threads, progress=bar)
        laws = {name: design(pair) for name, design in designers.items()}
        with progress("runs") as bar:
            runs = run_scenarios(draws, laws, reference=arm, threads=threads, progress=bar)
        scored = [one for run in runs for one in results(pair, run, {name: (name, "") for name in laws})]
        broken: tuple[ControlResult, ...] = ()
        if with_stress and free is not None:
            with progress("stress") as bar:
                redesigned = [name for name in method if name in METHODS]
                broken = stress(free, pair, laws, redesigned, reference=arm, threads=threads, progress=bar)
        records = {"runs": [one.record() for one in scored], "stress": [one.record() for one in broken]}
        content = {"reference": reference, "methods": list(laws), **records}
        files = _write(folder, pair, laws, scored, broken, content) if folder else []
    if json:
        print_json({**content, "files": files})
    else:
        _print(scored, broken)
        say_each("written: ", files)
        if out is not None:
            say_next("control", "reach", "--seeds", 5, "--method", *(out / f"{name}.json" for name in laws))
    return 0


def _write(
    folder: Path,
    pair: "IdentifiedPair",
    laws: "dict[str, Law]",
    scored: "Sequence[ControlResult]",
    broken: "Sequence[ControlResult]",
    content: Mapping[str, object],
) -> list[Path]:
    """Write record, designs, models, logs and figures."""
    import sysid
    from hmtb_twin.files.atomic_write import write_whole
    from scenarios.control import figures
    from scenarios.control.design import write_law

    files = [folder / "control.json", *(write_law(law, folder / f"{name}.json") for name, law in laws.items())]
    write_whole(files[0], json_text(content))
    files += [sysid.write_model(getattr(pair, name), folder / f"model-{name}.json") for name in ("ground", "reference")]
    firsts: dict[str, list[ControlResult]] = {}
    pictures = {}
    for number, one in enumerate(scored[:: len(laws)]):
        run, name = one.runs, one.runs.scenario.name
        files += [log.save(folder / f"{name}-{number}-{law}.nc") for law, log in run.logs.items()]
        if name in firsts:
            continue
        own = firsts[name] = [other for other in scored if other.runs is run]
        pictures[f"{name}-run"] = partial(figures.run_figure, own, pair)
        if not run.scenario.worksite:
            pictures[f"{name}-response"] = partial(figures.response_figure, own, pair)
    pictures["errors"] = partial(figures.error_figure, scored)
    if broken:
        same = firsts[broken[0].runs.scenario.name]
        pictures["stress"] = partial(figures.robustness_figure, [*same, *broken])
    for name, make in pictures.items():
        files += draw(make, *(folder / f"{name}.{ending}" for ending in ("png", "svg")))
    return files


def _print(scored: "Sequence[ControlResult]", broken: "Sequence[ControlResult]") -> None:
    import numpy as np

    from scenarios.control.campaign import CONTROLLED

    def millirad(score: "Score") -> str:
        arm = f" ({1e3 * score.total_arm:.3g})" if np.isfinite(score.total_arm) else ""
        return f"{1e3 * score.total:.3g}{arm}"

    def line(one: "ControlResult", first: str) -> list[str]:
        none, own = one.without, one.controlled
        cells = [first, one.method, millirad(none)]
        if own is None:
            return [*cells, "failed", *[""] * 4]
        forces = "" if np.isnan(none.force) else f"{none.force:.0f} / {own.force:.0f}"
        cells += [millirad(own), f"{none.total / own.total:.2g}", f"{100 * own.limited:.2g}", forces]
        return [*cells, "yes" if own.stable else "NO"]

    columns = ["scenario", "method", "without\n/ mrad", "with\n/ mrad", "factor", "at limits\n/ %"]
    columns += ["contact without / with\n/ N", "stable"]
    print_table(
        "RMS error against the reference model (in brackets: against the simulated flight arm)",
        columns,
        [line(one, f"{one.runs.scenario.name}, seed {one.runs.scenario.seed}") for one in scored],
    )
    seen = []
    for one in scored:
        for k, joint in enumerate(CONTROLLED):
            if one.controlled is None or not np.isfinite(one.without.reference_response.gains[1, k]):
                continue
            three = (one.without.response, one.controlled.response, one.without.reference_response)
            gains = " / ".join(f"{each.gains[1, k]:.2f}" for each in three)
            phases = " / ".join(f"{np.degrees(each.phases[1, k]):.0f}" for each in three)
            bands = " / ".join(f"{each.bandwidth_hz[k]:.2f}" for each in three)
            cells = (cell.replace("nan", "-") for cell in (gains, phases, bands))
            seen.append([f"{one.runs.scenario.name}, {one.method}", joint, *cells])
    if seen:
        titles = ["scenario", "joint", "gain at 1 Hz", "phase at 1 Hz / °", "bandwidth / Hz"]
        print_table("What the operator sees: without / with / reference", titles, seen)
    if broken:
        heading = f"{broken[0].runs.scenario.name} with the same laws on other arms, and designs from wrong models"
        print_table(heading, ["condition", *columns[1:]], [line(one, one.condition) for one in broken])
    reasons = (f"{name}: {why}" for one in (*scored, *broken) for name, why in one.runs.failed.items())
    say_each("failed: ", dict.fromkeys(reasons))
