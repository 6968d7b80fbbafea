"""`hmtb control`: the ground arm made to answer like the flight arm, and how well it does."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    draw,
    json_text,
    optional_folder,
    print_json,
    print_tables,
    progress,
    say_each,
    say_next,
)
from scenarios.files.errors import ScenarioError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from scenarios.control.campaign import IdentifiedPair
    from scenarios.control.runs import Law, Tested
    from scenarios.control.study import ControlResult
    from scenarios.experiments.multisines import MultisineExperiment

DEFAULT = ("reach", "rpcm", "siso-5-elbow_pitch", "multisine")
"""Scenarios when none is named."""

MULTISINE = "multisine"
"""The word for the frequency test, which no file of 100 points can play."""

FILES_OF_OUT = {"without", "reference", "control", "model-ground", "model-reference"}
"""Names in the folder of --out that no design may have."""

SHORTEST_RUN = 1.0
"""Shortest run that is judged, s."""

WAVEFORM_SECONDS = 20.0
"""Length of a thesis waveform, s: its file of two seconds repeats."""


def control(
    scenarios: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")] = (),
    /,
    *,
    method: Annotated[tuple[str, ...], tyro.conf.arg(metavar="following|adaptive|vrft|FILE.json ...")] = ("following",),
    reference: Annotated[str, tyro.conf.arg(metavar="ARM|MODEL.json")] = "flight",
    record: Annotated[Path | None, tyro.conf.arg(metavar="LOG")] = None,
    payload: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    friction_level: float | None = None,
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
    the run itself, and error without control over that with it; both in brackets against the simulated flight arm,
    whose own joints stick; the share of ticks at a limit of rate or range; the largest contact force. A run is stable
    if its error is bounded and does not grow.

    A scenario runs as its file says. Its variant, payload, plant, specimen, pose and chain are those of the ground arm
    that is identified too, with the unit at the worksite: scenarios of one call must agree in them. A file of another
    arm (docs/your-robot.md) needs --reference.

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
        reference: Arm or model file that the ground arm is made to answer like; an arm with joints of the same names.
        record: Log (.nc) of the ground arm from which to identify it; all joints under control must move.
        payload: Payload of both arms instead of the scenario's: rpcm, none, ballast or mdm, not at the worksite.
        friction_level: Dry friction of the ground arm's seals instead of the scenario's, in multiples of the nominal.
        duration: Length of each scenario but multisine instead of its own, s.
        seed: Draws excitation and noise of the identification; with several seeds, of the first run.
        seeds: Runs of each scenario, each with other noise and another operator.
        with_stress: Run the first scenario in free space also with other payloads, worn seals and wrong models.
        threads: Threads for the physics; all processors when not given.
        out: Folder for control.json, the designs, the logs (.nc) and the figures.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    from scenarios.control.campaign import check_reference, controlled, identify_pair
    from scenarios.control.design import METHODS, designer
    from scenarios.control.result_tables import beyond_the_arm, fit_table, result_tables
    from scenarios.control.runs import run_scenarios
    from scenarios.control.study import changed_arms, results, stress
    from scenarios.experiments.waveform import check_seed, seed_range

    check_seed(seed)
    if not method:
        raise ScenarioError(f"--method: none given, expected {', '.join(METHODS)}, or files of --out")
    ground, draws = _tested(scenarios, seed_range(seeds, seed), duration, payload, friction_level)
    joints = controlled(ground.variant)
    designers = {_method_name(word): designer(word, joints) for word in method}
    if len(designers) < len(method) or FILES_OF_OUT & designers.keys():
        raise ScenarioError(f"--method {' '.join(method)} given, expected names of their own, none of a file of --out")
    free = next((tested for tested in draws if not tested.worksite), None)
    if with_stress and free is None:
        raise ScenarioError("--with-stress given without a scenario in free space, expected one, as reach")
    if with_stress and free is not None:
        # Called for its errors: an arm that the scenario cannot have is refused before any simulation.
        changed_arms(free)
    # A model from a file has no arm to simulate.
    arm = None if reference.endswith(".json") else reference
    if arm is not None:
        check_reference(arm, ground.variant)
    names = _file_names(draws, list(designers), with_stress=with_stress)
    with optional_folder(out, *names, overwrite=overwrite) as folder:
        with progress("identification") as bar:
            pair = identify_pair(seed, ground=ground, record=record, reference=reference, threads=threads, progress=bar)
        laws = {name: _designed(design, pair, record) for name, design in designers.items()}
        with progress("runs") as bar:
            runs = run_scenarios(draws, laws, reference=arm, threads=threads, progress=bar)
        scored: list[ControlResult] = []
        for run in runs:
            scored += results(pair, run, {name: (name, "") for name in laws})
        stressed: tuple[ControlResult, ...] = ()
        if with_stress and free is not None:
            with progress("stress") as bar:
                redesigned = [name for name in method if name in METHODS]
                stressed = stress(free, pair, laws, redesigned, reference=arm, threads=threads, progress=bar)
        records = {"runs": [result.record() for result in scored], "stress": [result.record() for result in stressed]}
        warnings = [*pair.warnings(), *beyond_the_arm(scored)]
        fits = {name: fit.tolist() for name, fit in pair.fits.items()}
        content = {"reference": reference, "methods": list(laws), "fits": fits, "warnings": warnings, **records}
        files = _write(folder, pair, laws, scored, stressed, content) if folder else []
    if json:
        print_json({**content, "files": files})
    else:
        print_tables([fit_table(pair), *result_tables(scored, stressed)])
        say_each("warning: ", warnings)
        say_each("failed: ", _failures([*scored, *stressed]))
        say_each("written: ", files)
        if out is not None:
            conditions = _options(payload, friction_level, record, reference)
            designs = [out / f"{name}.json" for name in laws]
            say_next("control", *(scenarios or DEFAULT)[:1], "--seeds", 5, *conditions, "--method", *designs)
    return 0


def _tested(
    words: Sequence[str],
    seeds: Sequence[int],
    duration: float | None,
    payload: str | None,
    friction_level: float | None,
) -> "tuple[MultisineExperiment, list[Tested]]":
    """The experiment that identifies the ground arm, and the runs: every scenario with every seed."""
    from dataclasses import replace

    from scenarios.control.campaign import frequency_test
    from scenarios.control.ground_arm import identification_of, on_arm_of, with_options
    from scenarios.experiments.registry import selected

    draws: list[Tested | int] = []
    for seed in seeds:
        # A single run has the noise of the scenario itself.
        scenario_seed = None if len(seeds) == 1 else seed
        for word in words or DEFAULT:
            if word == MULTISINE:
                draws.append(seed)
                continue
            for scenario in selected([word], duration=duration, seed=scenario_seed):
                # Of the default scenarios, a thesis waveform says all in a part of its four minutes.
                is_shortened = not words and duration is None and scenario.excitation
                length = WAVEFORM_SECONDS if is_shortened else scenario.duration
                draws.append(with_options(replace(scenario, duration=length), payload, friction_level))
    described = [scenario for scenario in draws if not isinstance(scenario, int)]
    if not described:
        described = [with_options(frequency_test(), payload, friction_level)]
    ground = identification_of(described, seeds[0], payload)
    # The frequency test describes no arm of its own: it runs on that of the scenarios.
    tested = [on_arm_of(ground, frequency_test(draw)) if isinstance(draw, int) else draw for draw in draws]
    _check_runs(tested)
    return ground, tested


def _check_runs(draws: "Sequence[Tested]") -> None:
    """Raise `ScenarioError` if a run is too short to be judged, or if two cannot be told apart by name and seed."""
    # Figures join the runs of a name, and the table shows name and seed alone.
    told = set()
    for tested in draws:
        if tested.duration < SHORTEST_RUN:
            raise ScenarioError(
                f"{tested.name}: a duration of {tested.duration:g} s given, expected {SHORTEST_RUN:g} s or more: "
                "whether a run is stable shows in the growth of its error"
            )
        if (tested.name, tested.seed) in told:
            raise ScenarioError(
                f"two scenarios with the name {tested.name} and the seed {tested.seed} given: expected other names, "
                "which tables, figures and files of --out tell them apart by"
            )
        told.add((tested.name, tested.seed))


def _designed(design: "Callable[[IdentifiedPair], Law]", pair: "IdentifiedPair", record: Path | None) -> "Law":
    """Design a controller; an error names the record that the model of the ground arm is from."""
    from sysid import SysidError

    try:
        return design(pair)
    except SysidError as error:
        if record is None:
            raise
        raise ScenarioError(
            f"{record.name}: no controller follows from its model ({error}); expected a record of some minutes, four "
            "without --record, in which all six joints move independently of each other"
        ) from error


def _options(payload: str | None, friction_level: float | None, record: Path | None, reference: str) -> list[object]:
    """Words of the options that name the arms, without defaults."""
    # Without them the next command would identify another arm than the design was made for.
    values = {"payload": payload, "friction-level": friction_level, "record": record, "reference": reference}
    words: list[object] = []
    for name, value in values.items():
        if value is not None and value != "flight":
            words += [f"--{name}", value]
    return words


def _method_name(word: str) -> str:
    """Name of a method, or of the file of a design without its ending."""
    return Path(word).stem if word.endswith(".json") else word


def _file_names(draws: "Sequence[Tested]", designs: Sequence[str], *, with_stress: bool) -> list[str]:
    """Names of all files that a run may write, so that none that exists is replaced unasked."""
    # A run at the worksite writes fewer of them; a name too many only asks for --overwrite.
    names = ["control.json", "model-ground.json", "model-reference.json", *(f"{name}.json" for name in designs)]
    for k, tested in enumerate(draws):
        names += [f"{tested.name}-{k}-{run}.nc" for run in ("without", "reference", *designs)]
    figures = ["errors", *(["stress"] if with_stress else [])]
    for name in dict.fromkeys(tested.name for tested in draws):
        figures += [f"{name}-run", f"{name}-response"]
    return names + [f"{name}.{ending}" for name in figures for ending in ("png", "svg")]


def _write(
    folder: Path,
    pair: "IdentifiedPair",
    laws: "dict[str, Law]",
    scored: "Sequence[ControlResult]",
    stressed: "Sequence[ControlResult]",
    content: Mapping[str, object],
) -> list[Path]:
    """Write record, designs, models, logs and figures."""
    import sysid
    from hmtb_twin.files.atomic_write import write_whole
    from scenarios.control.design import write_law

    files = [folder / "control.json"]
    files += [write_law(law, folder / f"{name}.json", pair.joints) for name, law in laws.items()]
    write_whole(files[0], json_text(content))
    files += [sysid.write_model(getattr(pair, name), folder / f"model-{name}.json") for name in ("ground", "reference")]
    # Every run has as many results as there are laws.
    for k, result in enumerate(scored[:: len(laws)]):
        name = result.runs.scenario.name
        files += [log.save(folder / f"{name}-{k}-{law}.nc") for law, log in result.runs.logs.items()]
    for name, make in _figures(pair, scored, stressed).items():
        files += draw(make, folder / f"{name}.png", folder / f"{name}.svg")
    return files


def _figures(
    pair: "IdentifiedPair", scored: "Sequence[ControlResult]", stressed: "Sequence[ControlResult]"
) -> "dict[str, partial[Figure]]":
    """The figures by name: of each scenario the first run, the errors of all, and the stress tests."""
    from scenarios.control import figures

    first_runs: dict[str, list[ControlResult]] = {}
    pictures = {}
    for result in scored:
        run, name = result.runs, result.runs.scenario.name
        if name in first_runs:
            continue
        of_run = first_runs[name] = [other for other in scored if other.runs is run]
        pictures[f"{name}-run"] = partial(figures.run_figure, of_run, pair)
        if not run.scenario.worksite:  # contact has no linear response
            pictures[f"{name}-response"] = partial(figures.response_figure, of_run, pair)
    pictures["errors"] = partial(figures.error_figure, scored)
    if stressed:
        unstressed = first_runs[stressed[0].runs.scenario.name]
        pictures["stress"] = partial(figures.robustness_figure, [*unstressed, *stressed])
    return pictures


def _failures(results: "Sequence[ControlResult]") -> list[str]:
    """Why runs failed, each reason once."""
    reasons: dict[str, None] = {}
    for result in results:
        reasons |= dict.fromkeys(f"{name}: {why}" for name, why in result.runs.failed.items())
    return list(reasons)
