"""`hmtb truth`: the true poles, zeros, bandwidths, gains and delays of the joints."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from scenarios.commands.output import output_folder, print_json, print_table, progress, say

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from hmtb_twin import Arm, JointLog
    from scenarios.truth.truth_summary import TruthSummary

FIGURES = (".svg", ".png", ".pdf")
"""Endings of figures."""

PLACE = Path("maps")
"""Folder that maps go to when none is named."""


def truth(
    *,
    variant: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    payload: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    pose: Annotated[str | None, tyro.conf.arg(metavar="NAME|DEG,DEG,...")] = None,
    actuator: Annotated[str | None, tyro.conf.arg(metavar="linear|orifice")] = None,
    friction: Annotated[str | None, tyro.conf.arg(metavar="none|viscous|coulomb|lugre")] = None,
    friction_level: Annotated[float | None, tyro.conf.arg(metavar="FLOAT")] = None,
    supply_pressure: Annotated[float | None, tyro.conf.arg(metavar="MPA")] = None,
    oil_temperature: Annotated[float | None, tyro.conf.arg(metavar="DEGC")] = None,
    process_noise: Annotated[float | None, tyro.conf.arg(metavar="FLOAT")] = None,
    bla: Annotated[float | None, tyro.conf.arg(metavar="RAD")] = None,
    data: Annotated[Path | None, tyro.conf.arg(metavar="LOG")] = None,
    maps: bool = False,
    density: Annotated[float | None, tyro.conf.arg(metavar="FLOAT")] = None,
    seed: int = 0,
    threads: int | None = None,
    out: Path | None = None,
    json: bool = False,
) -> int:
    """Print the true poles, zeros, bandwidth, gain and delay of each joint, which an estimator should recover.

    The table shows the small-signal truth: the physics linearised at the pose, sampled at 50 Hz, without dry friction.
    It is exact as the amplitude goes to zero; a line below the table gives its error at other amplitudes. A joint that
    does not follow its command is locked: it has no bandwidth. Gains are measured over commanded angle, rad/rad. A
    pole is dominant where its mode carries more than 5 % of the gain at 0 Hz; the slowest four of them are shown. The
    hydraulic resonance is that of the oil's spring with the inertia that the joint sees, the other joints held; valve
    and leakage damp it (linear actuators only).

    Two more truths on request: --bla 0.01 adds the best linear approximation, which linear models of records at that
    amplitude tend to, with friction and velocity limit, and its 95 % interval (some seconds). A remark says where it is
    worth little. --data LOG adds the errors that models can attain on that log of hmtb simulate: no model that knows
    only commands and measurements has a smaller error, except by chance; a line below the table says by how much.

    With --maps it also shows how the truth varies over the workspace, payload, supply pressure, oil temperature,
    amplitude and friction. It writes a page, figures and tables into a folder, in about a minute and a half of one
    core for the nominal arm with linear actuators, several times that for others. Both --bla and --maps need a pose by
    name.

      hmtb truth --out truth.svg
      hmtb truth --pose 0,20,50,30,-50,0,0 --oil-temperature 15
      hmtb truth --maps --out maps

    Args:
        variant: Which arm: nominal (when not given), published or flight.
        payload: What the end effector holds: rpcm (the module, when not given), none, ballast or mdm.
        pose: Operating point: rpcm_holster_out_approach (when not given) or home, or the seven joint angles in degrees,
            with commas.
        actuator: A linear load-flow law (when not given), or servo valves with square-root orifices (needs numba).
        friction: Friction of the joints, lugre when not given; of it the small-signal truth keeps only the oil's drag
            (viscous).
        friction_level: Dry friction, in multiples of the variant's; 1 when not given.
        supply_pressure: Pressure of the supply, MPa; 20.7 when not given.
        oil_temperature: Temperature of the oil, degrees Celsius; 40 when not given.
        process_noise: Noise in the valve drives, a part of each joint's rated torque, 0 when not given; with it the
            true noise model is computed too.
        bla: Amplitude of the best linear approximation, rad, root mean square; of the studied joints.
        data: A log of hmtb simulate (.nc); it defines arm, conditions and pose, and no option may contradict them.
        maps: Make the maps.
        density: Poses of the maps, in multiples of the default grid (1); 0.1 is a preview in half a minute.
        seed: Of the phases and noise of --bla, and of the random poses of --maps.
        threads: Threads for the physics of --bla and --maps; all processors when not given.
        out: One figure (.svg, .png or .pdf); with --maps the folder, "maps" when not given.
        json: Print JSON.
    """
    from dataclasses import replace

    from hmtb_twin import NOMINAL_PLANT, linearize, load_arm
    from hmtb_twin.parameters.values import OPERATING_POSE
    from scenarios.experiments.waveform import check_seed
    from scenarios.files.atomic_write import check_place
    from scenarios.files.errors import ScenarioError
    from scenarios.truth.maps import Density
    from scenarios.truth.truth_summary import attainable_on, measured_best_linear, truth_summary

    check_seed(seed)
    _check_threads(threads, used=bla is not None or maps)
    if density is not None and not maps:
        raise ScenarioError(f"--density {density:g} given without --maps, whose poses it counts")
    grid = Density.scaled(1.0 if density is None else density)
    conditions: dict[str, object] = {
        "actuator": actuator,
        "friction": friction,
        "friction_level": friction_level,
        "supply_pressure": supply_pressure,
        "oil_temperature": oil_temperature,
        "process_noise": process_noise,
    }
    conditions = {name: value for name, value in conditions.items() if value is not None}
    plant = replace(NOMINAL_PLANT, **conditions)  # type: ignore[arg-type]
    point = _point(pose or OPERATING_POSE)
    log = None
    if data is None:
        arm = load_arm(variant or "nominal", payload or "rpcm", plant=plant)
    else:
        arm, point, log = _logged(data, {"variant": variant, "payload": payload, "pose": pose, **conditions})
    if (bla is not None or maps) and not isinstance(point, str):
        raise ScenarioError("--bla and --maps start from a pose of the model; give --pose a name, not angles")
    if out is not None and maps == (out.suffix in FIGURES):
        expected = (
            "a folder: maps are several figures, tables and a page"
            if maps
            else f"a figure: {', '.join(FIGURES)} (a folder goes with --maps)"
        )
        raise ScenarioError(f"--out {out} given{' with --maps' if maps else ''}, expected {expected}")
    if out is not None and not maps:
        check_place(out)
    summary = truth_summary(arm, linearize(arm, point))
    if bla is not None and isinstance(point, str):
        with progress("best linear approximation") as bar:
            best_linear = measured_best_linear(arm, point, bla, seed=seed, threads=threads, progress=bar)
        summary = replace(summary, best_linear=best_linear)
    if log is not None:
        summary = replace(summary, attainable=attainable_on(log, summary.truth))
    sentences: tuple[str, ...] = ()
    files: list[Path] = []
    if maps:
        from scenarios.truth.map_figures import write_maps
        from scenarios.truth.map_findings import findings
        from scenarios.truth.maps import maps as computed_maps

        with output_folder(out or PLACE) as folder:
            table = computed_maps(arm, summary.truth.pose, grid, seed=seed, threads=threads, stage=progress)
            files = [*write_maps(table, folder), _figure(summary, folder / "truth.svg")]
            sentences = findings(table)
    elif out is not None:
        files = [_figure(summary, out)]
    if json:
        print_json({**summary.record(), **({"maps": sentences} if maps else {}), "files": files})
        return 0
    _print(summary)
    for text in sentences:
        say(f"- {text}")
    for path in files[:1]:
        say(f"{'maps' if maps else 'figure'}: {path}")
    return 0


def _point(pose: str) -> "str | np.ndarray":
    """A pose by name, or angles in rad from degrees with commas."""
    import numpy as np

    from hmtb_twin import JOINTS, POSES
    from scenarios.files.errors import ScenarioError, unknown

    if "," not in pose:
        if pose not in POSES:
            raise ScenarioError(unknown("pose", pose, POSES) + f"; or {len(JOINTS)} angles in degrees, with commas")
        return pose
    try:
        angles = np.radians([float(part) for part in pose.split(",")])
    except ValueError:
        angles = np.empty(0)
    if angles.shape != (len(JOINTS),) or not np.isfinite(angles).all():
        raise ScenarioError(
            f"pose {pose!r} given, expected a name or {len(JOINTS)} angles in degrees, with commas: {', '.join(JOINTS)}"
        )
    return angles


def _check_threads(threads: int | None, *, used: bool) -> None:
    from hmtb_twin.run.simulation import MOST_THREADS
    from scenarios.files.errors import ScenarioError

    if threads is not None and not 1 <= threads <= MOST_THREADS:
        raise ScenarioError(f"threads = {threads} given, expected a whole number from 1 to {MOST_THREADS}")
    if threads is not None and not used:
        raise ScenarioError(f"--threads {threads} given without --bla or --maps, which alone use threads")


def _logged(data: Path, options: "Mapping[str, object]") -> "tuple[Arm, str, JointLog]":
    """The arm and pose of a log, which the other options must not contradict."""
    from hmtb_twin import JointLog
    from scenarios.experiments.logged_arm import logged_arm
    from scenarios.files.errors import ScenarioError

    if data.suffix != ".nc":
        raise ScenarioError(
            f"--data {data} given, expected a log of hmtb simulate, .nc: it knows the noise-free angles"
        )
    log = JointLog.load(data)
    arm, pose = logged_arm(log), log.provenance["pose"]
    of_log = {"variant": arm.variant, "payload": arm.payload, "pose": pose, **vars(arm.plant)}
    others = [name for name, value in options.items() if value is not None and value != of_log[name]]
    if others:
        contradicting = ", ".join(f"--{name.replace('_', '-')} {options[name]}" for name in others)
        has = ", ".join(f"{name} = {of_log[name]}" for name in others)
        raise ScenarioError(
            "--data takes arm, conditions and pose from the log: leave out the options that say otherwise: "
            f"{contradicting} given, the log has {has}"
        )
    return arm, pose, log


def _figure(summary: "TruthSummary", path: Path) -> Path:
    import matplotlib

    from scenarios.report.figures import SETTINGS, save_figure
    from scenarios.truth.truth_figure import truth_figure

    with output_folder(path.parent), matplotlib.rc_context(SETTINGS):
        save_figure(truth_figure(summary), path, dpi=150)
    return path


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
        row = [name, f"{joint.bandwidth_hz:.3f}", f"{joint.dc_gain:.4f}", str(joint.delay_samples)]
        row += [_poles(joint.dominant_poles, np.pi / truth.dt), _zeros(np.asarray(joint.zeros, dtype=complex))]
        if summary.hydraulics:
            oil = summary.hydraulics[name]
            row.append(f"{oil.natural_frequency / (2 * np.pi):.1f} (ζ {oil.damping_ratio:.2g})")
        if name in best_linear:
            hz, low, high = (
                float(p[0, 0]) for p in (best_linear[name].bandwidth.hz, *best_linear[name].bandwidth.ci95)
            )
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
        first = next(iter(best_linear.values())).multisines
        say(
            f"Best linear: {first.rms:g} rad rms, {first.f_min:g} to {first.f_max:g} Hz, each joint alone, "
            f"{first.realisations} realisations; friction, velocity limit and noise on"
        )
    for name, approximation in best_linear.items():
        if remarks := cautions(approximation, truth):
            say(f"{name}: its best linear bandwidth says little: {'; '.join(remarks)}")
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
        f"Chance: on {first.samples} samples the RMSE of a model as good as a floor is more than "
        f"{100 * (1 - first.by_chance(1.0)):.2g} % below it once in twenty at most (if fitted to this record: further)"
    )
    say(
        "Best linear: the least of pulse responses, ARX models and models of the truth's order that are fitted to this "
        "record's noise-free angles, the initial state free; linear systems of other classes may do better"
    )
    averaged = [(name, one.mean_error) for name, one in summary.attainable.items() if one.mean_error]
    if averaged:
        errors = ", ".join(f"{name} {1e3 * error:.3f}" for name, error in averaged)
        say(f"Noise-free angles are means over draws of process noise; standard error / mrad: {errors}")


def _poles(poles: "np.ndarray", fastest: float, count: int = 4) -> str:
    """Those that the sampling rate still shows, slowest first."""
    from scenarios.truth.truth_summary import damping_ratio

    upper = [pole for pole in poles if pole.imag > -1e-6 * abs(pole) and abs(pole) < fastest]
    shown = [
        f"{pole.real:.1f}±{pole.imag:.1f}j (ζ {damping_ratio(pole):.2f})"
        if pole.imag > 1e-6 * abs(pole)
        else f"{pole.real:.1f}"
        for pole in upper[:count]
    ]
    return ", ".join(shown) + (", ..." if len(upper) > count else "")


def _zeros(zeros: "np.ndarray", count: int = 3) -> str:
    upper = sorted((zero for zero in zeros if zero.imag > -1e-9), key=abs, reverse=True)
    shown = [f"{zero.real:.2f}" + (f"±{zero.imag:.2f}j" if zero.imag > 1e-6 else "") for zero in upper[:count]]
    return ", ".join(shown) + (", ..." if len(upper) > count else "") or "none"
