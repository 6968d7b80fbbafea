"""`hmtb truth`: the true poles, zeros, bandwidths, gains and delays of the joints."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import (
    FIGURES,
    check_figure,
    draw,
    output_folder,
    print_json,
    print_table,
    progress,
    say,
    say_each,
    say_next,
)
from scenarios.files.errors import ScenarioError, unknown

if TYPE_CHECKING:
    import numpy as np

    from hmtb_twin import Arm, JointLog
    from scenarios.truth.truth_summary import TruthSummary


def truth(
    *,
    variant: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    payload: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    pose: Annotated[str | None, tyro.conf.arg(metavar="NAME|DEG,DEG,...")] = None,
    actuator: Annotated[str | None, tyro.conf.arg(metavar="linear|orifice")] = None,
    servo: Annotated[str | None, tyro.conf.arg(metavar="flow|torque")] = None,
    friction: Annotated[str | None, tyro.conf.arg(metavar="none|viscous|coulomb|lugre")] = None,
    friction_level: float | None = None,
    supply_pressure: Annotated[float | None, tyro.conf.arg(metavar="MPA")] = None,
    oil_temperature: Annotated[float | None, tyro.conf.arg(metavar="DEGC")] = None,
    process_noise: float | None = None,
    bla: Annotated[float | None, tyro.conf.arg(metavar="RAD")] = None,
    data: Annotated[Path | None, tyro.conf.arg(metavar="LOG")] = None,
    maps: bool = False,
    density: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    out: Path | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Print true poles, zeros, bandwidth, gain and delay of each joint.

    The table shows the small-signal truth: the physics linearised at the pose, sampled at 50 Hz, without dry friction.
    It is exact as the amplitude goes to zero; a line below the table gives its error at other amplitudes. A locked
    joint, which does not follow its command, has no bandwidth. Gains are measured over commanded angle, rad/rad. A pole
    is dominant where its mode carries more than 5 % of the gain at 0 Hz; the slowest four of them are shown. The
    hydraulic resonance is that of the oil's spring with the inertia that the joint moves, the other joints held; valve
    and leakage damp it (linear actuators only).

    Two options add other truths. --bla 0.01 adds the best linear approximation at that amplitude: the linear system
    that is nearest to the arm with friction and velocity limit, and its 95 % interval (some seconds). A remark warns
    where it has little meaning. --data LOG adds the smallest errors that a model can reach on that log of hmtb simulate
    if it knows only commands and measurements; a line below the table says how far chance may take a model below them.

    With --maps it shows how the truth varies over workspace, payload, supply pressure, oil temperature, amplitude and
    friction. It writes a page, figures and tables into a folder: about a minute and a half of one core for the nominal
    arm with linear actuators, several times that for others. Both --bla and --maps need a pose by name.

      hmtb truth --out truth.svg
      hmtb truth --pose 0,20,50,30,-50,0,0 --oil-temperature 15
      hmtb truth --maps --out maps

    Args:
        variant: Which arm: nominal (when not given), published, flight or released.
        payload: What the end effector holds: rpcm (the module, when not given), none, ballast or mdm.
        pose: Operating point: rpcm_holster_out_approach (when not given) or home, or the seven joint angles in degrees,
            separated by commas.
        actuator: Linear law of load and flow (when not given), or servo valves with square-root orifices.
        servo: What the joint servos command, the flow of the oil or the torque; that of the variant when not given.
        friction: Friction of the joints, lugre when not given. The small-signal truth keeps only its viscous part.
        friction_level: Dry friction, in multiples of the variant's; 1 when not given.
        supply_pressure: Pressure of the supply, MPa; 20.7 when not given.
        oil_temperature: Temperature of the oil, degrees Celsius; 40 when not given.
        process_noise: Noise in the valve drives as a fraction of each joint's rated torque, 0 when not given; with it
            the true noise model is computed too.
        bla: Amplitude (root mean square) of the best linear approximation of the studied joints, rad.
        data: A log of hmtb simulate (.nc); it defines arm, conditions and pose, and no option may contradict them.
        maps: Make the maps.
        density: Number of poses in the maps, in multiples of the default grid (1); 0.1 is a preview in half a minute.
        seed: Seed of the phases and noise of --bla, and of the random poses of --maps.
        threads: Threads for the physics of --bla and --maps; all processors when not given.
        out: One figure (.svg, .png or .pdf); with --maps the folder, "maps" when not given.
        overwrite: Replace files that exist, without a question.
        json: Print JSON.
    """
    # Before any other local variable: the options that were given.
    options = {name: value for name, value in locals().items() if value is not None}

    from dataclasses import replace

    from hmtb_twin import NOMINAL_PLANT, linearize, load_arm
    from hmtb_twin.parameters.values import OPERATING_POSE
    from scenarios.experiments.multisines import Multisines
    from scenarios.experiments.waveform import check_seed
    from scenarios.truth.best_linear import REALISATIONS, measured_best_linear
    from scenarios.truth.maps import Density
    from scenarios.truth.truth_figure import truth_figure
    from scenarios.truth.truth_summary import attainable_on, truth_summary

    check_seed(seed)
    if threads is not None and bla is None and not maps:
        raise ScenarioError(f"--threads {threads} given without --bla or --maps, which alone use threads")
    if density is not None and not maps:
        raise ScenarioError(f"--density {density:g} given without --maps")
    grid = Density.scaled(1.0 if density is None else density)
    if maps and out is not None and out.suffix in FIGURES:
        raise ScenarioError(f"--out {out} given with --maps, expected a folder for figures, tables and a page")
    if out is not None and not maps:
        check_figure(out, overwrite=overwrite)
    conditions = {name: options[name] for name in vars(NOMINAL_PLANT) if name in options}
    plant = replace(NOMINAL_PLANT, **conditions)
    point, log = _point(pose or OPERATING_POSE), None
    if data is None:
        arm = load_arm(variant or "nominal", payload or "rpcm", plant=plant)
    else:
        arm, point, log = _logged(data, options)
    if (bla is not None or maps) and not isinstance(point, str):
        raise ScenarioError("--bla and --maps start from a pose of the model; give --pose a name, not angles")
    summary = truth_summary(arm, linearize(arm, point))
    if bla is not None and isinstance(point, str):
        with progress("best linear approximation") as bar:
            multisines = Multisines(rms=bla, realisations=REALISATIONS, seed=seed)
            best_linear = measured_best_linear(arm, point, multisines, threads=threads, progress=bar)
        summary = replace(summary, best_linear=best_linear)
    if log is not None:
        summary = replace(summary, attainable=attainable_on(log, summary.truth))
    sentences: tuple[str, ...] = ()
    files: list[Path] = []
    if maps:
        from scenarios.truth.map_figures import write_maps
        from scenarios.truth.map_findings import findings
        from scenarios.truth.maps import maps as computed_maps

        names = ("maps.html", "maps.csv", "truth.svg")
        with output_folder(out or Path("maps"), *names, overwrite=overwrite) as folder:
            table = computed_maps(arm, summary.truth.pose, grid, seed=seed, threads=threads, stage=progress)
            files = [*write_maps(table, folder), *draw(lambda: truth_figure(summary), folder / "truth.svg")]
            sentences = findings(table)
    elif out is not None:
        files = draw(lambda: truth_figure(summary), out)
    if json:
        print_json({**summary.record(), **({"maps": sentences} if maps else {}), "files": files})
        return 0
    _print(summary)
    say_each("- ", sentences)
    say_each("maps: " if maps else "figure: ", files[:1])
    if maps:
        say_next("truth", "--bla", 0.01)
    elif files:
        say_next("truth", "--maps", "--out", files[0].with_name("maps"))
    return 0


def _point(pose: str) -> "str | np.ndarray":
    """A pose by name, or angles in rad from degrees separated by commas."""
    import numpy as np

    from hmtb_twin import JOINTS, POSES

    expected = f"{len(JOINTS)} angles in degrees, separated by commas: {', '.join(JOINTS)}"
    if "," not in pose:
        if pose not in POSES:
            raise ScenarioError(f"{unknown('pose', pose, POSES)}; or {expected}")
        return pose
    try:
        angles = np.radians([float(part) for part in pose.split(",")])
    except ValueError:
        angles = np.empty(0)
    if angles.shape != (len(JOINTS),) or not np.isfinite(angles).all():
        raise ScenarioError(f"pose {pose!r} given, expected a name or {expected}")
    return angles


def _logged(data: Path, options: Mapping[str, object]) -> "tuple[Arm, str, JointLog]":
    """The arm and pose of a log, which the other options must not contradict."""
    from hmtb_twin import JointLog
    from hmtb_twin.truth.logged_arm import logged_arm

    if data.suffix != ".nc":
        raise ScenarioError(f"--data {data} given, expected a log of hmtb simulate (.nc), with its noise-free angles")
    log = JointLog.load(data)
    arm, pose = logged_arm(log), log.provenance["pose"]
    of_log = {"variant": arm.variant, "payload": arm.payload, "pose": pose, **vars(arm.plant)}
    others = [name for name, value in of_log.items() if options.get(name, value) != value]
    if others:
        contradicting = ", ".join(f"--{name.replace('_', '-')} {options[name]}" for name in others)
        has = ", ".join(f"{name} = {of_log[name]}" for name in others)
        raise ScenarioError(
            "--data takes arm, conditions and pose from the log; leave out options that contradict it: "
            f"{contradicting} given, the log has {has}"
        )
    return arm, pose, log


def _print(summary: "TruthSummary") -> None:
    import numpy as np

    from scenarios.truth.best_linear import cautions
    from scenarios.truth.truth_summary import LOCKED_NOTE, conditions_in_words, pose_in_words

    truth, best_linear = summary.truth, summary.best_linear
    columns = ["joint", "bandwidth\n/ Hz", "gain at 0 Hz\n/ (rad/rad)", "delay\n/ samples", "dominant poles\n/ (rad/s)"]
    columns += ["largest zeros\n(z plane)"]
    columns += ["hydraulic resonance\n/ Hz"] if summary.hydraulics else []
    columns += ["best linear\n/ Hz (95 %)", "distortion\n/ %"] if best_linear else []
    rows = []
    for name, joint in summary.joints.items():
        if name in summary.locked:
            rows.append([name, "locked", *["—"] * (len(columns) - 2)])
            continue
        shown = [pole for pole in joint.dominant_poles if abs(pole) < np.pi / truth.dt]  # at 50 Hz others are aliases
        row = [name, f"{joint.bandwidth_hz:.3f}", f"{joint.dc_gain:.4f}", str(joint.delay_samples)]
        row += [_roots(shown, 1, 4, damping=True), _roots(joint.zeros, 2, 3) or "none"]
        if summary.hydraulics:
            oil = summary.hydraulics[name]
            row.append(f"{oil.natural_frequency / (2 * np.pi):.1f} (ζ {oil.damping_ratio:.2g})")
        if name in best_linear:
            hz, low, high = best_linear[name].bandwidth.path()
            row.append(f"{hz:.3f} ({low:.3f}..{high:.3f})" if np.isfinite(hz) else "none shows")
            row.append(f"{best_linear[name].distortion_percent[0]:.1f}")
        rows.append(row + [""] * (len(columns) - len(row)))
    title = f"Linearised truth of the arm '{truth.variant}' with payload '{truth.payload}', pose {pose_in_words(truth)}"
    print_table(title, columns, rows)
    for name in sorted(summary.locked):
        say(f"{name}: {LOCKED_NOTE}")
    say(f"Conditions: {conditions_in_words(summary.arm)}")
    if summary.arm.friction:
        exception = " but for the best linear ones" if best_linear else "; see --bla 0.01"
        say(f"Dry friction is not in these numbers{exception}")
    errors = ", ".join(f"{error:.1e} at {amplitude:g} rad" for amplitude, error in truth.small_signal_error.items())
    say(f"Relative error of the linear model against the simulated arm (friction off): {errors}")
    if truth.plant.process_noise:
        innovations = ", ".join(
            f"{name} {1e3 * float(np.sqrt(joint.model.innovation_covariance[0, 0])):.4f}"
            for name, joint in summary.joints.items()
            if name not in summary.locked and joint.model.innovation_covariance is not None
        )
        say(f"Standard deviation of each joint's innovations / mrad: {innovations} (K and covariance: --json)")
    if best_linear:
        first = next(iter(best_linear.values())).experiment.multisines
        say(
            f"Best linear: {first.rms:g} rad rms, {first.f_min:g} to {first.f_max:g} Hz, each joint alone, "
            f"{first.realisations} realisations; friction, velocity limit and noise on"
        )
    for name, approximation in best_linear.items():
        if remarks := cautions(approximation, truth):
            say(f"{name}: its best linear bandwidth has little meaning: {'; '.join(remarks)}")
    if summary.attainable:
        _print_attainable(summary)
    say("All poles and zeros in the z plane: --json; as a figure: --out truth.svg; over the workspace: --maps")


def _print_attainable(summary: "TruthSummary") -> None:
    rows = []
    for name, limit in summary.attainable.items():
        for label, horizon in (("simulation", limit.simulation), ("one step", limit.one_step)):
            of_order = limit.right_order if label == "simulation" else None
            floors = (horizon.any_model, horizon.best_linear, of_order, horizon.small_signal)
            cells = [f"{one.fit:.2f} % ({1e3 * one.rmse:.3f})" if one else "—" for one in floors]
            rows.append([name, label, *cells])
    first = next(iter(summary.attainable.values()))
    columns = ("joint", "horizon", "any model", "best linear", "of the truth's order", "small-signal truth")
    print_table(f"Attainable on {first.provenance['record']}: fit (RMSE / mrad)", columns, rows)
    say(
        f"Chance: on {first.samples} samples, at most one model in twenty that is as good as a limit has an RMSE more "
        f"than {100 * (1 - first.by_chance(1.0)):.2g} % below it (more where the model is fitted to this record)"
    )
    say(
        "Best linear: the least of pulse responses, ARX models and models of the truth's order that are fitted to this "
        "record's noise-free angles, the initial state free; linear systems of other classes may do better"
    )
    averaged = [f"{name} {1e3 * one.mean_error:.3f}" for name, one in summary.attainable.items() if one.mean_error]
    if averaged:
        say(f"Noise-free angles are means over draws of process noise; standard error / mrad: {', '.join(averaged)}")


def _roots(roots: Iterable[complex], digits: int, count: int, *, damping: bool = False) -> str:
    """The first few poles or zeros, each conjugate pair once."""
    from scenarios.truth.truth_summary import damping_ratio

    texts = []
    for root in roots:
        pair = abs(root.imag) > 1e-6 * abs(root)
        if not pair:
            texts.append(f"{root.real:.{digits}f}")
        elif root.imag > 0.0:
            ratio = f" (ζ {damping_ratio(root):.2f})" if damping else ""
            texts.append(f"{root.real:.{digits}f}±{root.imag:.{digits}f}j{ratio}")
    return ", ".join(texts[:count]) + (", ..." if len(texts) > count else "")
