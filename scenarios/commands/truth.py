"""`hmtb truth`: the true poles, zeros, bandwidths, gains and delays of the joints."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    from hmtb_twin.parameters.arm_description import ArmDescription
    from scenarios.truth.maps import Density
    from scenarios.truth.truth_summary import TruthSummary

    Pose = str | np.ndarray


def truth(
    *,
    variant: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    arm: Annotated[str | None, tyro.conf.arg(metavar="NAME|PATH")] = None,
    payload: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    pose: Annotated[str | None, tyro.conf.arg(metavar="NAME|DEG,DEG,...")] = None,
    actuator: Annotated[str | None, tyro.conf.arg(metavar="linear|orifice")] = None,
    servo: Annotated[str | None, tyro.conf.arg(metavar="flow|torque")] = None,
    friction: Annotated[str | None, tyro.conf.arg(metavar="none|viscous|coulomb|lugre")] = None,
    friction_level: float | None = None,
    supply_pressure: Annotated[float | None, tyro.conf.arg(metavar="MPA")] = None,
    oil_temperature: Annotated[float | None, tyro.conf.arg(metavar="DEGC")] = None,
    process_noise: float | None = None,
    load_flow_slope: float | None = None,
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
    that is nearest to the arm with friction and velocity limit, and its 95 % interval, from as many realisations as its
    width needs, 8 to 64 (some seconds to two minutes). A remark warns where it has little meaning. --data LOG adds the
    smallest errors that a model can reach on that log of hmtb simulate if it knows only commands and measurements; a
    line below the table says how far chance may take a model below them.

    With --maps it shows how the truth varies over workspace, payload, supply pressure, oil temperature, amplitude and
    friction. It writes a page, figures and tables into a folder: about a minute and a half of one core for the nominal
    arm with linear actuators, several times that for others. Both --bla and --maps need a pose by name.

      hmtb truth --out truth.svg
      hmtb truth --pose 0,20,50,30,-50,0,0 --oil-temperature 15
      hmtb truth --maps --out maps

    Args:
        variant: Which arm: nominal (when not given), published, flight or released.
        arm: Another arm by name (panda), or the path of an MJCF, a URDF or a folder; the numbers that its files leave
            out are assumed, and listed below the table.
        payload: What the end effector holds: of the test bed rpcm (the module, when not given), none, ballast or mdm;
            or "mass=KG centre=X,Y,Z inertia=XX,YY,ZZ", kg, m and kg m2 in the frame of the tool.
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
        load_flow_slope: Slope of the valves' load-flow line over that of the straight line from no-load flow to stall,
            which is assumed when not given (1); near the null of a spool it is a few percent.
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
    from hmtb_twin import linearize
    from scenarios.experiments.waveform import check_seed
    from scenarios.truth.maps import Density
    from scenarios.truth.truth_figure import truth_figure
    from scenarios.truth.truth_summary import truth_summary

    conditions = {
        "actuator": actuator,
        "servo": servo,
        "friction": friction,
        "friction_level": friction_level,
        "supply_pressure": supply_pressure,
        "oil_temperature": oil_temperature,
        "process_noise": process_noise,
        "load_flow_slope": load_flow_slope,
    }
    stated = {"variant": _named_arm(arm, variant), "payload": payload, "pose": pose, **conditions}
    stated = {name: value for name, value in stated.items() if value is not None}
    # Refused before the arm is linearised, which takes seconds.
    check_seed(seed)
    if threads is not None and bla is None and not maps:
        raise ScenarioError(f"--threads {threads} given without --bla or --maps, which alone use threads")
    _check_sizes(bla, density, maps=maps)
    factor = 1.0 if density is None else density
    grid = Density.scaled(factor)
    if maps and out is not None and out.suffix in FIGURES:
        raise ScenarioError(f"--out {out} given with --maps, expected a folder for figures, tables and a page")
    if out is not None and not maps:
        check_figure(out, overwrite=overwrite)
    loaded, point, log = _arm_of_options(stated) if data is None else _arm_of_log(data, stated)
    # Experiments and maps name their pose.
    if (bla is not None or maps) and not isinstance(point, str):
        raise ScenarioError("--bla and --maps start from a pose of the model; give --pose a name, not angles")
    summary = truth_summary(loaded, linearize(loaded, point))
    if bla is not None:
        summary = _with_best_linear(summary, bla, seed, threads)
    if log is not None:
        summary = _with_attainable(summary, log)
    if maps:
        return _make_maps(summary, grid, seed, threads, out or Path("maps"), overwrite=overwrite, json=json)
    files = [] if out is None else draw(lambda: truth_figure(summary), out)
    if json:
        print_json({**summary.record(), "files": files})
        return 0
    _show(summary)
    say_each("figure: ", files)
    if files:
        say_next("truth", "--maps", "--out", files[0].with_name("maps"))
    return 0


def _named_arm(arm: str | None, variant: str | None) -> str | None:
    """The arm that --arm or --variant names; None where neither does."""
    if arm is not None and variant is not None:
        raise ScenarioError(f"--arm {arm} and --variant {variant} given, expected one of them: both name the arm")
    name = arm if variant is None else variant
    if name is not None:
        from scenarios.experiments.scenario import known_arm

        # An empty name would be no name below, and the test bed its arm.
        known_arm(name)
    return name


def _check_sizes(bla: float | None, density: float | None, *, maps: bool) -> None:
    if bla is not None and not 0.0 < bla < float("inf"):
        raise ScenarioError(f"--bla {bla:g} given, expected a root mean square above 0 rad, as 0.01")
    if density is not None and not maps:
        raise ScenarioError(f"--density {density:g} given without --maps")


def _arm_of_options(stated: Mapping[str, Any]) -> "tuple[Arm, Pose, None]":
    """The arm and operating point that the options state, the nominal ones where they say nothing."""
    from dataclasses import replace

    from hmtb_twin import NOMINAL_PLANT, load_arm
    from hmtb_twin.arm_files.known_arms import arm_named

    conditions = {name: stated[name] for name in vars(NOMINAL_PLANT) if name in stated}
    plant = replace(NOMINAL_PLANT, **conditions)
    description = arm_named(stated.get("variant") or "nominal")
    point = _point(stated.get("pose") or description.operating_pose, description)
    arm = load_arm(stated.get("variant") or "nominal", stated.get("payload"), plant=plant)
    return arm, point, None


def _point(pose: str, arm: "ArmDescription") -> "Pose":
    """A pose of an arm by name, or angles in rad from degrees separated by commas."""
    import numpy as np

    joints = arm.joints
    expected = f"{len(joints)} angles in degrees, separated by commas: {', '.join(joints)}"
    # A single angle has no comma.
    if "," not in pose and (len(joints) > 1 or pose in arm.poses):
        if pose not in arm.poses:
            raise ScenarioError(f"{unknown('pose', pose, arm.poses)}; or {expected}")
        return pose
    try:
        angles = np.radians([float(word) for word in pose.split(",")])
    except ValueError:
        angles = np.empty(0)
    if angles.shape != (len(joints),) or not np.isfinite(angles).all():
        raise ScenarioError(f"pose {pose!r} given, expected a name or {expected}")
    return angles


def _arm_of_log(data: Path, stated: Mapping[str, Any]) -> "tuple[Arm, Pose, JointLog]":
    """The arm, pose and log of a file, which the stated options must not contradict."""
    from hmtb_twin import JointLog
    from hmtb_twin.truth.logged_arm import logged_arm

    if data.suffix != ".nc":
        raise ScenarioError(f"--data {data} given, expected a log of hmtb simulate (.nc), with its noise-free angles")
    log = JointLog.load(data)
    arm, pose = logged_arm(log), log.provenance["pose"]
    of_log = {"variant": arm.variant, "payload": arm.payload, "pose": pose, **vars(arm.plant)}
    contradicted = [name for name, value in of_log.items() if stated.get(name, value) != value]
    if contradicted:
        options = ", ".join(f"--{name.replace('_', '-')} {stated[name]}" for name in contradicted)
        values = ", ".join(f"{name} = {of_log[name]}" for name in contradicted)
        raise ScenarioError(
            "--data takes arm, conditions and pose from the log; leave out options that contradict it: "
            f"{options} given, the log has {values}"
        )
    return arm, pose, log


def _with_best_linear(summary: "TruthSummary", rms: float, seed: int, threads: int | None) -> "TruthSummary":
    """The summary with the best linear approximations of the studied joints at an amplitude in rad."""
    from dataclasses import replace

    from scenarios.experiments.multisines import Multisines
    from scenarios.truth import best_linear

    multisines = Multisines(rms=rms, realisations=best_linear.REALISATIONS, seed=seed)
    with progress("best linear approximation") as bar:
        approximations = best_linear.measured_best_linear(
            summary.arm, summary.truth.pose, multisines, as_needed=True, threads=threads, progress=bar
        )
    return replace(summary, best_linear=approximations)


def _with_attainable(summary: "TruthSummary", log: "JointLog") -> "TruthSummary":
    """The summary with the smallest errors that models can reach on a log."""
    from dataclasses import replace

    from scenarios.truth.truth_summary import attainable_on

    return replace(summary, attainable=attainable_on(log, summary.truth))


def _make_maps(
    summary: "TruthSummary",
    grid: "Density",
    seed: int,
    threads: int | None,
    out: Path,
    *,
    overwrite: bool,
    json: bool,
) -> int:
    """Compute the maps, write page, figures and tables, and print what they show."""
    from scenarios.truth.map_figures import write_maps
    from scenarios.truth.map_findings import findings
    from scenarios.truth.maps import maps
    from scenarios.truth.truth_figure import truth_figure

    with output_folder(out, "maps.html", "maps.csv", "truth.svg", overwrite=overwrite) as folder:
        table = maps(summary.arm, summary.truth.pose, grid, seed=seed, threads=threads, stage=progress)
        files = [*write_maps(table, folder), *draw(lambda: truth_figure(summary), folder / "truth.svg")]
        sentences = findings(table)
    if json:
        print_json({**summary.record(), "maps": sentences, "files": files})
        return 0
    _show(summary)
    say_each("- ", sentences)
    say_each("maps: ", files[:1])
    say_next("truth", "--bla", 0.01)
    return 0


def _show(summary: "TruthSummary") -> None:
    from scenarios.truth.result_tables import attainable_notes, attainable_table, joint_notes, joint_table

    print_table(*joint_table(summary))
    say_each("", joint_notes(summary))
    if summary.attainable:
        print_table(*attainable_table(summary.attainable))
        say_each("", attainable_notes(summary.attainable))
    say("All poles and zeros in the z plane: --json; as a figure: --out truth.svg; over the workspace: --maps")
